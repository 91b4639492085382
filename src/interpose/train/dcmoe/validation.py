"""Whole roll-outs on frames held out from training, from a lone start pose, as ratios to interpolation."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from interpose.models.dcmoe import DCMoE
from interpose.train.common.frames import Frames
from interpose.train.dcmoe.sequences import Rows, at_lone_start, base_window, control
from interpose.train.planner.objective import plans, validation_gaps


@torch.no_grad()
def roll_out(model: DCMoE, data: Frames, rows: Rows) -> Float[Tensor, "row frame 22 3"]:
    """Joint positions of the frames between start and target; all rows have gaps of one length."""
    out = []
    steps = int(rows.gaps.steps[0])
    base = base_window(data, rows, steps)
    target = rows.gaps.target
    for i in range(steps - 1):
        steer = control(data, rows, base[i], base[i + 1], data.rotations[target], data.positions[target])
        rows.state, _ = model(rows.state, steer)
        out.append(rows.state.positions)
        rows.gone = rows.gone + 1
    return torch.stack(out, dim=1)


@torch.no_grad()
def ratios(model: DCMoE, data: Frames, longest: int, count: int = 128) -> dict[str, float]:
    """Mean joint position error over interpolation's, by gap, where the held-out clips are long enough: ``valid/30``
    with no path, ``path/30`` along the true one, and ``jerk/30``, the jerk without a path over the truth's.

    longest: steps of the gaps that the training draws.
    """
    generator = torch.Generator(data.hips.device).manual_seed(0)
    out = {}
    for name, gaps, at, real, naive in validation_gaps(data, longest, count, model.size.styles):
        rows = at_lone_start(data, gaps)
        if model.planner is not None:
            rows.plan, _ = plans(model.planner, data, gaps, 0.0, generator)
        made = roll_out(model, data, rows)
        out[f"{name}/{at.shape[1]}"] = float((made - real).norm(dim=-1).mean() / naive)
        if name == "valid":
            shake, real_shake = (x.diff(n=3, dim=1).norm(dim=-1).mean() for x in (made, real))
            out[f"jerk/{at.shape[1]}"] = float(shake / real_shake)
    return out
