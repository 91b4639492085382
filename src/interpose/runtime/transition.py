"""Finished transitions of the 22 joints at 30 Hz: the network's roll-out, then feet kept where they stand."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.runtime import feet, rollout
from interpose.runtime.session import Session


def transitions(
    session: Session,
    start_root: Float[ndarray, "batch context 3"],
    start_local: Float[ndarray, "batch context 22 4"],
    target_root: Float[ndarray, "batch 3"],
    target_local: Float[ndarray, "batch 22 4"],
    frames: int,
    *,
    style: list[str | None] | None = None,
    seed: int = 0,
    vary: bool = False,
) -> tuple[Float[ndarray, "batch {frames}+2 3"], Float[ndarray, "batch {frames}+2 22 4"]]:
    """Hips and local rotations from the start key to the target, both keys included; see `rollout.generate_batch`."""
    root, local, contacts = rollout.generate_batch(
        session, start_root, start_local, target_root, target_local, frames, style, seed, vary
    )
    root = np.concatenate([start_root[:, -1:], root, target_root[:, None]], axis=1)
    local = np.concatenate([start_local[:, -1:], local, target_local[:, None]], axis=1)
    if not frames:
        return root, local
    around = np.pad(contacts, ((0, 0), (1, 1), (0, 0)), mode="edge")
    return root, feet.plant_batch(root, local, around)
