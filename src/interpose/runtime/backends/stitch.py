"""Gaps stitched from both ends: the run time of S-CVAE (Ren et al. 2024, section 3), on ONNX Runtime alone.

The networks are in three files: the plan of a gap, the forward generator and the backward one. Here is what surrounds
them: interpolation between the keys and the plan's poses on it, the two chains made in turn, and how they become one
(`interpose.stitch_layout`). Random latents are inputs, so that a seed gives the same motion again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose.data.contacts import INDICES
from interpose.features import RATE
from interpose.runtime import planner
from interpose.runtime.backends.chains import Frame, Made, by_length, joined
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path, Pose, continued, interpolation, last, local_of, pose_of
from interpose.stitch_layout import STANDING, memory_shapes, schedule, seam, spread


def stitch(
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
) -> tuple[Made, Float[ndarray, "batch"]]:
    """As `interpose.runtime.backends.dcmoe.generate_batch`, for a model of method stitch; and how far apart the chains'
    joints are in the middle, metres (MMPE, equation 13), NaN where only one chain comes so far.

    arriving: the joints' velocities at the target, where they are known.
    """
    count = len(start_root)
    apart = np.full(count, np.nan)
    weights = session.style_weights(style or [None] * count, strength)

    def make(rows: list[int], length: int) -> Made:
        made, apart[rows] = _of_length(
            session,
            (start_root[rows], start_local[rows]),
            (target_root[rows], target_local[rows]),
            length,
            weights[rows],
            planner.noise(_latents(session, length + 1), count, seed, vary)[rows],
            [None if paths is None else paths[row] for row in rows],
            control,
            None if arriving is None else arriving[rows],
        )
        return made

    return by_length(frames, target_root, target_local, make), apart


def _latents(session: Session, steps: int) -> tuple[int, ...]:
    """The shape of a gap's latents: one for the whole of it, or one for each frame made."""
    network = session.info["network"]
    units = (network["latent"],)
    return units if network["latents"] == "gap" else (len(schedule(steps, *session.course)), *units)


def _of_length(
    session: Session,
    start: tuple[Float[ndarray, "batch context 3"], Float[ndarray, "batch context 22 4"]],
    target: tuple[Float[ndarray, "batch 3"], Float[ndarray, "batch 22 4"]],
    frames: int,
    style: Float[ndarray, "batch style"],
    drawn: Float[ndarray, "batch *unit"],
    paths: list[Path | None],
    control: float,
    arriving: Float[ndarray, "batch 22 3"] | None,
) -> tuple[Made, Float[ndarray, "batch"]]:
    """Gaps of one length."""
    steps, network = frames + 1, session.info["network"]
    context, goal = pose_of(*start), pose_of(*target)
    first = last(context)
    leaving = None
    if context.hips.shape[1] > 1:
        leaving = (context.positions[:, -1] - context.positions[:, -2]) * RATE
    keys = (start[0][:, -1], start[1][:, -1]), target
    base = interpolation(*keys, frames)
    latent = drawn
    if "plan" in session.shapes:
        ends = planner.ends(first, leaving, goal, arriving, [steps] * len(drawn), style, paths, control)
        one = drawn if network["latents"] == "gap" else np.zeros((len(drawn), network["latent"]))
        added, z = planner.plan(session, ends, one)
        if network["planned"]:
            base = base + np.einsum("ta,bac->btc", spread(steps), added)
        if network["latents"] == "gap":
            latent = z
    base = planner.laid(base, paths, control)
    speeds = leaving, None if arriving is None else -arriving
    if network["form"] == "paper":
        letter = Letter(np.array(session.info["mean_quaternions"]), first)
        bodies = [letter.body(*key, speed) for key, speed in zip(keys, speeds, strict=True)]
    else:
        letter = None
        bodies = [_body(pose, speed) for pose, speed in zip((first, goal), speeds, strict=True)]
    chains = _chains(session, bodies, base, latent, style, steps)
    buffer, _, both = session.course
    hips, turned, contacts = joined(chains, steps, buffer, both)
    if letter is not None:
        hips, local = letter.back(hips, turned)
    else:
        if session.refines:
            hips, turned, contacts = _refined(session, (first, goal), hips, turned, contacts)
        local = local_of(turned)
    return (hips, continued(start[1][:, -1], local), contacts), _apart(chains, steps)


def _refined(
    session: Session,
    keys: tuple[Pose, Pose],
    hips: Float[ndarray, "batch frame 3"],
    turned: Float[ndarray, "batch frame 22 6"],
    contacts: Float[ndarray, "batch frame 4"],
) -> Made:
    """What the detail transformer makes of a motion (`interpose.models.detail_transformer`); rotations as 6-D."""
    start, target = keys
    whole = {
        "hips": np.concatenate([start.hips[:, None], hips, target.hips[:, None]], axis=1),
        "rotations": np.concatenate([start.rotations[:, None], turned, target.rotations[:, None]], axis=1),
        "contacts": np.pad(contacts, ((0, 0), (1, 1), (0, 0)), mode="edge"),
    }
    said = session.run("detail", {name: value.astype(np.float32) for name, value in whole.items()})
    made = (said[f"refined_{name}"][:, 1:-1].astype(float) for name in whole)
    hips, turned, contacts = made
    return hips, turned, contacts


def _apart(chains: tuple[list[Frame], list[Frame]], steps: int) -> Float[ndarray, "batch"]:
    """The mean distance of the chains' joints in the middle frame; NaN where not both have it."""
    middle = steps // 2
    if len(chains[0]) < middle or len(chains[1]) < steps - middle or not middle:
        return np.full(len(chains[0][0]["hips"]), np.nan)
    front, back = chains[0][middle - 1]["positions"], chains[1][steps - middle - 1]["positions"]
    return np.asarray(np.linalg.norm(front - back, axis=-1).mean(axis=-1), dtype=float)


def _body(pose: Pose, velocities: Float[ndarray, "batch 22 3"] | None) -> dict[str, ndarray]:
    """A chain's first frame."""
    count = len(pose.hips)
    return {
        "hips": pose.hips,
        "rotations": pose.rotations,
        "positions": pose.positions,
        "velocities": np.zeros_like(pose.positions) if velocities is None else velocities,
        "known": np.full((count, 1), float(velocities is not None)),
        "contacts": (pose.positions[:, INDICES, 1] < np.array(STANDING)).astype(float),
        "phase": np.zeros((count, 4)),
    }


@dataclass(frozen=True, eq=False)
class Letter:
    """To and from the paper's form: local quaternions with fixed signs, in the start's root frame."""

    mean: Float[ndarray, "22 4"]
    start: Pose

    @property
    def _turn(self) -> Float[ndarray, "batch 4"]:
        """From the world into the start's root frame."""
        half = -0.5 * np.arctan2(self.start.facing[:, 0], self.start.facing[:, 1])
        nothing = np.zeros_like(half)
        return np.stack([nothing, np.sin(half), nothing, np.cos(half)], axis=-1)

    @property
    def _origin(self) -> Float[ndarray, "batch 3"]:
        return self.start.hips * np.array([1.0, 0.0, 1.0])

    def body(
        self,
        root: Float[ndarray, "batch 3"],
        local: Float[ndarray, "batch 22 4"],
        velocities: Float[ndarray, "batch 22 3"] | None,
    ) -> dict[str, ndarray]:
        """A chain's first frame."""
        turn = self._turn
        turned = local.copy()
        turned[:, 0] = rotation.multiply(turn, local[:, 0])
        turned = np.where(np.sum(turned * self.mean, axis=-1, keepdims=True) < 0.0, -turned, turned)
        hips = rotation.rotate(turn, root - self._origin)
        speed = None if velocities is None else rotation.rotate(turn[:, None], velocities)
        return _body(pose_of(hips, turned), speed) | {"rotations": turned}

    def back(
        self, hips: Float[ndarray, "batch frame 3"], turned: Float[ndarray, "batch frame 22 4"]
    ) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 4"]]:
        """Hips and local rotations in the world."""
        local = turned / np.linalg.norm(turned, axis=-1, keepdims=True)
        back = rotation.inverse(self._turn)[:, None]
        local[:, :, 0] = rotation.multiply(np.broadcast_to(back, local[:, :, 0].shape), local[:, :, 0])
        return rotation.rotate(np.broadcast_to(back, (*hips.shape[:2], 4)), hips) + self._origin[:, None], local


def _chains(
    session: Session,
    keys: list[dict[str, ndarray]],
    base: Float[ndarray, "batch time pose"],
    latent: Float[ndarray, "batch *unit"],
    style: Float[ndarray, "batch style"],
    steps: int,
) -> tuple[list[Frame], list[Frame]]:
    """The frames of both chains, each in the order in which it made them."""
    count = len(base)
    base = base.astype(np.float32)
    keys = [{name: value.astype(np.float32) for name, value in key.items()} for key in keys]
    network = session.info["network"]
    memories = memory_shapes(network["memory"], network["decoder_memory"])
    memory = [{name: np.zeros((count, *shape), dtype=np.float32) for name, shape in memories.items()} for _ in keys]
    newest, at = [*keys], [0, steps]
    made: tuple[list[Frame], list[Frame]] = ([], [])
    ends = seam(steps, session.course[0], session.course[2])
    middle, kept = ends.middle, ends.forward - ends.middle
    for number, move in enumerate(schedule(steps, *session.course)):
        side = int(move.backward)
        other = keys[1 - side] if move.to_key else newest[1 - side]
        gone = at[side] if not side else steps - at[side]
        share = gone / middle if gone < middle else gone / (middle + kept)
        value = latent if latent.ndim == 2 else latent[:, number]
        feed = newest[side] | memory[side]
        feed |= {f"aim_{name}": other[name] for name in ("hips", "rotations", "positions")}
        feed |= {"base_here": base[:, at[side]], "base_following": base[:, move.made], "base_there": base[:, move.aim]}
        feed |= {
            "left": np.full((count, 1), move.left, dtype=np.float32),
            "latent": value.astype(np.float32),
            "share": np.full((count, 1), min(1.0, share), dtype=np.float32),
            "style": style,
        }
        said = session.run("back" if side else "front", feed)
        newest[side] = {name: said[f"next_{name}"] for name in keys[0] if name != "known"}
        newest[side]["known"] = np.ones((count, 1), dtype=np.float32)
        memory[side] = {name: said[f"next_{name}"] for name in memories}
        made[side].append(newest[side])
        at[side] = move.made
    return made
