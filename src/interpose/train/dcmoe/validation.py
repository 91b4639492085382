"""Whole roll-outs on frames held out from training, from a lone start pose, as ratios to interpolation."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from interpose.models.dcmoe import DCMoE
from interpose.models.geometry import joint_positions, to_matrix
from interpose.models.planner import POSE
from interpose.stitch_layout import ANCHORS
from interpose.train.common.frames import Frames
from interpose.train.dcmoe.sequences import Keys, Rows, Sampling, base_window, control, fresh_state
from interpose.train.planner import objective

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
    path_known, start_known, target_known = torch.zeros(3, count, 1, device=start.device)
    added = torch.zeros(count, ANCHORS, POSE, device=start.device)
    gone = torch.zeros_like(start)
    return Rows(start, gone, whole, path_known, style, start_known, target_known, added, keys, state)


@torch.no_grad()
def roll_out(model: DCMoE, data: Frames, rows: Rows) -> Float[Tensor, "row frame 22 3"]:
    """Joint positions of the frames between start and target; all rows have gaps of one length."""
    out = []
    steps = int(rows.total[0])
    base = base_window(data, rows, steps, model.planner is not None)
    target = rows.start + rows.total
    for i in range(steps - 1):
        steer = control(data, rows, base[i], base[i + 1], data.rotations[target], data.positions[target])
        rows.state, _ = model(rows.state, steer)
        out.append(rows.state.positions)
        rows.gone = rows.gone + 1
    return torch.stack(out, dim=1)


@torch.no_grad()
def ratios(model: DCMoE, data: Frames, rule: Sampling, count: int = 128, plan_alone: bool = False) -> dict[str, float]:
    """Mean joint position error over interpolation's, by gap, where the held-out clips are long enough: ``valid/30``
    with no path, ``path/30`` along the true one, and ``jerk/30``, the jerk without a path over the truth's.

    plan_alone: of what the planner foresees, and no step makes.
    """
    longest = int((data.last - data.first).max())
    generator = torch.Generator(data.hips.device).manual_seed(0)
    out = {}
    for gap in GAPS:
        if gap + 1 > min(longest, rule.longest + 1):
            continue
        for name in ("valid", "path"):
            rows = fixed_rows(data, gap, count, model.size.styles)
            rows.path_known.fill_(float(name == "path"))
            if model.planner is not None:
                objective.add_plans(model.planner, data, rows, 0.0, generator)
            true = rows.start[:, None] + torch.arange(1, gap + 1, device=rows.start.device)
            real, naive = data.positions[true], _placed(base_window(data, rows, gap)[1:])
            made = _placed(base_window(data, rows, gap, True)[1:]) if plan_alone else roll_out(model, data, rows)
            kind = f"plan {name}" if plan_alone else name
            out[f"{kind}/{gap}"] = float((made - real).norm(dim=-1).mean() / (naive - real).norm(dim=-1).mean())
            if name == "valid" and not plan_alone and gap > 3:
                shake, real_shake = (x.diff(n=3, dim=1).norm(dim=-1).mean() for x in (made, real))
                out[f"jerk/{gap}"] = float(shake / real_shake)
    return out


def _placed(base: Float[Tensor, "frame row pose"]) -> Float[Tensor, "row frame 22 3"]:
    """Joint positions of poses as (hips, global 6-D)."""
    flat = base.transpose(0, 1).flatten(0, 1)
    return joint_positions(flat[:, :3], to_matrix(flat[:, 3:].unflatten(1, (22, 6)))).unflatten(0, base.shape[1::-1])
