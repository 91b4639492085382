"""Method ``stitch``: gaps stitched from both ends, the run time of S-CVAE (Ren et al. 2024, section 3).

The planner, the forward generator and the backward one are ONNX files; here is what surrounds them: the base between
the keys, the two chains made in turn, and how they become one (`interpose.features.stitch`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose.data.contacts import CONTACT_INDICES
from interpose.features.stitch import STANDING, memory_shapes, schedule, seam, shares, smoothed
from interpose.runtime import planner
from interpose.runtime.backends.backend import Abilities, trained
from interpose.runtime.gap_batch import GapBatch, Generated, by_length
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Pose, continued, local_of, pose_of

ChainFrame = dict[str, ndarray]
"""One frame of a chain, the network's outputs by name."""


@dataclass(frozen=True)
class StitchBackend:
    """Two generators that meet in the middle. refined: with the model's detail transformer."""

    refined: bool = False

    @property
    def name(self) -> str:
        return "stitch+detail" if self.refined else "stitch"

    @property
    def summary(self) -> str:
        return "stitch, refined by a transformer" if self.refined else "two generators, from both ends"

    def abilities(self, model: Session | None) -> Abilities | None:
        if model is None or model.method != "stitch" or (self.refined and not model.has_detail):
            return None
        return trained(model, latent_variants=True)

    def generate(self, model: Session | None, batch: GapBatch) -> Generated:
        assert model is not None
        return by_length(batch, lambda rows: _stitch(model, rows, self.refined))


BACKEND, REFINED = StitchBackend(), StitchBackend(refined=True)


def _stitch(session: Session, batch: GapBatch, refined: bool) -> Generated:
    """Gaps of one length."""
    steps, network = batch.longest + 1, session.info["network"]
    buffer, aligned, both = session.chain_layout
    moves = schedule(steps, buffer, aligned, both)
    by_gap = network["latents"] == "gap"
    drawn = (
        planner.noise(batch.draws, (session.plan_latent,)) if by_gap else np.zeros((len(batch), session.plan_latent))
    )
    base, z = planner.base(session, batch, drawn if session.has_planner else None)
    if not network["planned"]:
        base, _ = planner.base(session, batch, None)
    latent = z if by_gap else planner.noise(batch.draws, (len(moves), network["latent"]))
    assert latent is not None
    speeds = batch.leaving, None if batch.arriving is None else -batch.arriving
    poses = batch.start, batch.target
    paper = None
    if network["form"] == "paper":
        paper = PaperForm(np.array(session.info["mean_quaternions"]), batch.start)
        bodies = [paper.body(*key, speed) for key, speed in zip(batch.keys, speeds, strict=True)]
    else:
        bodies = [_body(pose, speed) for pose, speed in zip(poses, speeds, strict=True)]
    style = session.style_weights(batch.styles, batch.style_strength)
    chains = _chains(session, bodies, base, latent, style, steps)
    hips, turned, contacts = joined(chains, steps, buffer, both)
    if paper is not None:
        hips, local = paper.back(hips, turned)
    else:
        if refined:
            hips, turned, contacts = _refined(session, poses, hips, turned, contacts)
        local = local_of(turned)
    return Generated(hips, continued(batch.context_local[:, -1], local), contacts, _apart(chains, steps))


def joined(
    chains: tuple[list[ChainFrame], list[ChainFrame]], steps: int, buffer: int, both: bool = True
) -> tuple[Float[ndarray, "batch frame 3"], Float[ndarray, "batch frame 22 turn"], Float[ndarray, "batch frame 4"]]:
    """Hips, rotations and contacts of the frames between the keys: both chains, each in the order in which it made its
    frames, blended where they overlap and smoothed there. Rotations are not yet proper again."""
    out = []
    for name in ("hips", "rotations", "contacts"):
        first = chains[0][0][name]
        whole = np.zeros((2, len(first), steps + 1, *first.shape[1:]))
        for number, chain in enumerate(chains):
            for i, frame in enumerate(chain, start=1):
                whole[number, :, steps - i if number else i] = frame[name]
        of_back = shares(steps, buffer, both).reshape(-1, *[1] * (first.ndim - 1))
        mixed = (1.0 - of_back) * whole[0] + of_back * whole[1]
        mixed[:, 0], mixed[:, -1] = mixed[:, 1], mixed[:, -2]
        out.append((smoothed(mixed, steps) if both else mixed)[:, 1:-1])
    hips, turned, contacts = out
    return hips, turned, contacts


def _refined(
    session: Session,
    keys: tuple[Pose, Pose],
    hips: Float[ndarray, "batch frame 3"],
    turned: Float[ndarray, "batch frame 22 6"],
    contacts: Float[ndarray, "batch frame 4"],
) -> tuple[ndarray, ndarray, ndarray]:
    """What the detail transformer makes of a motion (`interpose.models.detail_transformer`); rotations as 6-D."""
    start, target = keys
    whole = {
        "hips": np.concatenate([start.hips[:, None], hips, target.hips[:, None]], axis=1),
        "rotations": np.concatenate([start.rotations[:, None], turned, target.rotations[:, None]], axis=1),
        "contacts": np.pad(contacts, ((0, 0), (1, 1), (0, 0)), mode="edge"),
    }
    out = session.run("detail", {name: value.astype(np.float32) for name, value in whole.items()})
    made = (out[f"refined_{name}"][:, 1:-1].astype(float) for name in whole)
    hips, turned, contacts = made
    return hips, turned, contacts


def _apart(chains: tuple[list[ChainFrame], list[ChainFrame]], steps: int) -> Float[ndarray, "batch"]:
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
        "contacts": (pose.positions[:, CONTACT_INDICES, 1] < np.array(STANDING)).astype(float),
        "phase": np.zeros((count, 4)),
    }


@dataclass(frozen=True, eq=False)
class PaperForm:
    """To and from the paper's form: local quaternions with fixed signs, in the start's root frame."""

    mean: Float[ndarray, "22 4"]
    start: Pose

    @property
    def _turn(self) -> Float[ndarray, "batch 4"]:
        """From the world into the start's root frame."""
        half = -0.5 * np.arctan2(self.start.facing[:, 0], self.start.facing[:, 1])
        zero = np.zeros_like(half)
        return np.stack([zero, np.sin(half), zero, np.cos(half)], axis=-1)

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
) -> tuple[list[ChainFrame], list[ChainFrame]]:
    """The frames of both chains, each in the order in which it made them."""
    count = len(base)
    base = base.astype(np.float32)
    keys = [{name: value.astype(np.float32) for name, value in key.items()} for key in keys]
    network = session.info["network"]
    memories = memory_shapes(network["memory"], network["decoder_memory"])
    memory = [{name: np.zeros((count, *shape), dtype=np.float32) for name, shape in memories.items()} for _ in keys]
    buffer, aligned, both = session.chain_layout
    newest, at = [*keys], [0, steps]
    made: tuple[list[ChainFrame], list[ChainFrame]] = ([], [])
    ends = seam(steps, buffer, both)
    middle, kept = ends.middle, ends.forward - ends.middle
    for number, move in enumerate(schedule(steps, buffer, aligned, both)):
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
        out = session.run("back" if side else "front", feed)
        newest[side] = {name: out[f"next_{name}"] for name in keys[0] if name != "known"}
        newest[side]["known"] = np.ones((count, 1), dtype=np.float32)
        memory[side] = {name: out[f"next_{name}"] for name in memories}
        made[side].append(newest[side])
        at[side] = move.made
    return made
