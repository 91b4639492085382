"""The trained methods behind one call: each makes the frames of batched gaps on the 22 joints at 30 Hz."""

from __future__ import annotations

from collections.abc import Sequence

from jaxtyping import Float
from numpy import ndarray

from interpose.runtime.backends import dcmoe, dcmoe_both_ends, stitch
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path


def generate_batch(
    session: Session,
    start_root: Float[ndarray, "batch context 3"],
    start_local: Float[ndarray, "batch context 22 4"],
    target_root: Float[ndarray, "batch 3"],
    target_local: Float[ndarray, "batch 22 4"],
    frames: int | Sequence[int],
    style: list[str | None] | None = None,
    seed: int = 0,
    vary: bool = False,
    paths: Sequence[Path | None] | None = None,
    control: float = 1.0,
    arriving: Float[ndarray, "batch 22 3"] | None = None,
    strength: float = 1.0,
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"], Float[ndarray, "batch frame 4"]]:
    """Hips, local rotations and contact probabilities by the model's own method; see
    `interpose.runtime.backends.dcmoe.generate_batch`. arriving: the joints' velocities at the target, where they are
    known and the method sees them. strength: of the styles, see
    `interpose.runtime.model_folder.Session.style_weights`."""
    keys = start_root, start_local, target_root, target_local
    if session.method == "stitch":
        return stitch.stitch(session, *keys, frames, style, seed, vary, paths, control, arriving, strength)[0]
    if "back" in session.shapes:
        return dcmoe_both_ends.generate_batch(session, *keys, frames, style, seed, vary, paths, arriving, strength)
    return dcmoe.generate_batch(
        session,
        *keys,
        frames,
        style=style,
        seed=seed,
        vary=vary,
        paths=paths,
        control=control,
        arriving=arriving,
        strength=strength,
    )
