"""Whole roll-outs on frames held out from training, from a lone start pose, as ratios to interpolation."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from interpose.models.dcmoe import DCMoE
from interpose.models.geometry import joint_positions, to_matrix
from interpose.train.frames import Frames
from interpose.train.sequences import Keys, Rows, Sampling, base_window, control, fresh_state

GAPS = (5, 15, 30, 45, 60, 90)


def fixed_rows(data: Frames, gap: int, count: int, styles: int) -> Rows:
    """``count`` evenly spaced gaps of ``gap`` frames, style free and no path, at their lone start pose."""
    total = gap + 1
    able = torch.nonzero(data.last - torch.arange(len(data), device=data.hips.device) >= total)[:, 0]
    start = able[torch.linspace(0, len(able) - 1, count, device=able.device).long()]
    style = torch.zeros(count, styles + 1, device=start.device)
    style[:, 0] = 1.0
    unknown = torch.zeros(count, dtype=torch.bool, device=start.device)
    keys = Keys(unknown, data.local[start], data.local[start + total])
    here = data.positions[start]
    state = fresh_state(data, start, start, data.hips[start], to_matrix(data.rotations[start]), here, unknown)
    whole = torch.full_like(start, total)
    return Rows(start, torch.zeros_like(start), whole, torch.zeros_like(style[:, :1]), style, keys, state)


@torch.no_grad()
def roll_out(model: DCMoE, data: Frames, rows: Rows) -> Float[Tensor, "row frame 22 3"]:
    """Joint positions of the frames between start and target; all rows have gaps of one length."""
    out = []
    steps = int(rows.total[0])
    base = base_window(data, rows, steps)
    target = rows.start + rows.total
    for i in range(steps - 1):
        steer = control(data, rows, base[i], base[i + 1], data.rotations[target], data.positions[target])
        rows.state, _ = model(rows.state, steer)
        out.append(rows.state.positions)
        rows.gone = rows.gone + 1
    return torch.stack(out, dim=1)


@torch.no_grad()
def ratios(model: DCMoE, data: Frames, rule: Sampling, count: int = 128) -> dict[str, float]:
    """Mean joint position error over interpolation's, by gap, where the held-out clips are long enough."""
    longest = int((data.last - data.first).max())
    styles = model.size.styles
    out = {}
    for gap in GAPS:
        if gap + 1 > min(longest, rule.longest + 1):
            continue
        rows = fixed_rows(data, gap, count, styles)
        true = rows.start[:, None] + torch.arange(1, gap + 1, device=rows.start.device)
        real = data.positions[true]
        base = base_window(data, rows, gap)[1:].transpose(0, 1).flatten(0, 1)
        matrices = to_matrix(base[:, 3:].unflatten(1, (22, 6)))
        naive = joint_positions(base[:, :3], matrices).unflatten(0, (count, gap))
        made = roll_out(model, data, rows)
        out[f"valid/{gap}"] = float((made - real).norm(dim=-1).mean() / (naive - real).norm(dim=-1).mean())
    return out
