"""Poses for many characters, one a call: targets, times and styles may change at any call.

Each call runs one step of the roll-out for all characters. While a character's target, time and style stay the same,
its calls give the frames of the whole roll-out. When one of them changes, a new base begins at the present pose, and
the change in velocity fades (`fading`), as it does at a key where the velocity before it is known.

Feet are as the model predicts them, or held where they stand (`feet.stream_lock`): the foot lock of whole transitions
needs the frames to come.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from interpose import retarget, rotation
from interpose import skeleton as kinematics
from interpose.data.contacts import CONTACT_JOINTS
from interpose.errors import InputError
from interpose.features import POSE
from interpose.features.plan import LONGEST_PLAN_STEPS
from interpose.motion import Motion, concatenate
from interpose.runtime import planner, poses
from interpose.runtime.backends import dcmoe
from interpose.runtime.feet.stream_lock import FootLock
from interpose.runtime.gap_batch import draws
from interpose.runtime.interpolate import aligned, check_gap
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import local_of, pose_of
from interpose.runtime.resampling import CONTEXT, MODEL_RATE, recent
from interpose.runtime.streaming import fading
from interpose.skeleton import HUMANOID

Pose = tuple[Float[ndarray, "_ 3"], Float[ndarray, "_ 22 4"]]
"""Hips and local rotations of the humanoid."""


class Streams:
    """Characters of one rig, a pose each every thirtieth of a second. Made by :meth:`interpose.Model.streams`.

    poses: the present poses on the user's rig; frame i is character i's. contacts: (character, 4), probabilities that
    LeftFoot, LeftToe, RightFoot, RightToe stand in them; zero before the first step.
    """

    def __init__(
        self,
        session: Session,
        starts: Sequence[Motion],
        styles: str | Sequence[str | None] | None = None,
        seeds: Sequence[int] | None = None,
        mapping: retarget.Mapping | None = None,
        plant: bool = False,
    ) -> None:
        """``starts``: the last frame of each is a first pose, those before it are context. ``styles``: one for all, or
        one each. ``seeds``: one each, zero where left out. ``mapping``: of the rig, where it is known. ``plant``: hold
        feet where they stand. Raises InputError for no character, several rigs, a rig that is no humanoid, an unknown
        style, and a model for whole gaps.
        """
        if session.method != "dcmoe":
            raise InputError(
                f"the model '{session.name}' makes whole gaps (method {session.method}); stream with one for dcmoe"
            )
        if not starts:
            raise InputError("streams need at least one start")
        self._session, self._count = session, len(starts)
        self.styles = styles
        for start in starts[1:]:
            check_gap(starts[0], start, 1)
        self._mapping = retarget.map_skeleton(starts[0]) if mapping is None else mapping
        # Whether the 22 joints hold all of the rig's pose.
        self._simple = not self._mapping.unmapped and starts[0].translations is None and self._mapping.hips == 0
        self.poses = self._begin(starts, [0] * self._count if seeds is None else seeds)
        self._goals = self.poses
        self._given: list[Motion | None] = [None] * self._count
        self._aimed_styles = self._styles
        self._left: Int[ndarray, "row"] = np.zeros(self._count, dtype=int)
        self.contacts = np.zeros((self._count, len(CONTACT_JOINTS)))
        self._fade = fading.none(self._count)
        self._feet = FootLock(self._count) if plant else None

    def __len__(self) -> int:
        return self._count

    @property
    def styles(self) -> tuple[str | None, ...]:
        """Each character's style, None where it is free; set to one label or to one each, for the next call."""
        return self._styles

    @styles.setter
    def styles(self, styles: str | Sequence[str | None] | None) -> None:
        each = (styles,) * self._count if styles is None or isinstance(styles, str) else tuple(styles)
        self._check_number(each, "styles")
        self._session.style_weights(list(each))
        self._styles = each

    def step(self, targets: Motion | Sequence[Motion], seconds_left: float | Sequence[float]) -> Motion:
        """The poses a thirtieth of a second later, each to be at its target in ``seconds_left`` from now.

        ``targets``: one for all or one each; the first frame counts, on the starts' skeleton. ``seconds_left``: one for
        all or one each; with a thirtieth of a second or less the pose is the target. Raises InputError for another
        skeleton and a time that is negative or not finite.
        """
        goals = [targets] * self._count if isinstance(targets, Motion) else list(targets)
        self._check_number(goals, "targets")
        left = self._frames(seconds_left)
        new = self._changed(goals, left)
        fresh = new & (self._left == 0)
        kept = new & ~fresh & (left > 1)
        former = self._feed(np.flatnonzero(kept), self._left[kept]) if kept.any() else None
        if new.any():
            self._aim(np.flatnonzero(new), goals, left)
        feed = self._feed(np.arange(self._count), left)
        self._base = feed["base_next"]
        if former is not None:
            feed = {name: np.concatenate([value, former[name]]) for name, value in feed.items()}
        out = self._session.step(feed)
        after = {name: value[: self._count] for name, value in out.items()}
        self._state, self._path, self._left = dcmoe.after(after), after["next_path"], left - 1
        self.contacts = after["contacts"].astype(float)
        pose = _pose(out, slice(self._count))
        self._keep_speed(pose, kept, _pose(out, slice(self._count, None)) if former else None, fresh & self._moving)
        self._fade = fading.advanced(self._fade, left.astype(float))
        self._before, self._now, self._moving = self._now, pose, np.ones(self._count, dtype=bool)
        show = fading.shown(self._fade, *pose)
        if self._feet is not None:
            show = show[0], self._feet.step(*show, self.contacts, left)
        return self._show(show, left)

    def _keep_speed(
        self, pose: Pose, kept: Bool[ndarray, "row"], former: Pose | None, fresh: Bool[ndarray, "row"]
    ) -> None:
        """Adds offsets for lost velocity: of ``kept`` rows, whose ``former`` next poses are known, and of ``fresh``
        ones, which continue from a key."""
        if former is not None:
            change = fading.velocity((pose[0][kept], pose[1][kept]), former)
            self._fade = fading.kicked(self._fade, kept, change)
        if fresh.any():
            was, now, then = ((p[0][fresh], p[1][fresh]) for p in (self._before, self._now, pose))
            change = fading.velocity(was, now) - fading.velocity(now, then)
            self._fade = fading.kicked(self._fade, fresh, change)

    def _begin(self, starts: Sequence[Motion], seeds: Sequence[int]) -> Motion:
        """The state at the starts; their last frames on one skeleton."""
        drawn = [draws(seed, 1)[0] for seed in seeds]
        self._noise = planner.noise(drawn, (self._session.plan_latent,))
        states, paths, before, now = [], [], [], []
        for start, draw in zip(starts, drawn, strict=True):
            known = retarget.to_humanoid(recent(start, CONTEXT), self._mapping)
            context = pose_of(known.root_positions[None], known.local_rotations[None])
            states.append(dcmoe.initial_state(context, dcmoe.initial_phases(self._session, [draw])))
            paths.append(dcmoe.resting_path(context))
            before.append(known[max(len(known) - 2, 0)])
            now.append(known[-1])
        self._state = {name: np.concatenate([s[name] for s in states]).astype(np.float32) for name in states[0]}
        self._path = np.concatenate(paths)
        self._moving = self._state["velocity_known"][:, 0] > 0.5
        self._before, self._now = (_stacked(poses) for poses in (before, now))
        self._fixed = dcmoe.steering(self._session, pose_of(*self._now), list(self._styles))
        self._base = np.zeros((self._count, POSE), dtype=np.float32)
        self._bases = _Bases.standing(self._now)
        lasts = [start[-1] for start in starts]
        moved = next((last for last in lasts if last.translations is not None), lasts[0])
        first, _ = aligned(lasts[0], moved)
        return replace(concatenate(first, *(aligned(first, last)[1] for last in lasts[1:])), rate=MODEL_RATE)

    def _check_number(self, given: Sequence[object], what: str) -> None:
        if len(given) != self._count:
            raise InputError(f"there are {self._count} characters, and {len(given)} {what}; give one each")

    def _frames(self, seconds_left: float | Sequence[float]) -> Int[ndarray, "row"]:
        seconds = np.asarray(seconds_left, dtype=float)
        if seconds.ndim:
            self._check_number(list(seconds), "times")
        bad = ~((seconds >= 0.0) & (seconds < np.inf))
        if bad.any():
            raise InputError(f"seconds_left must be 0 or more, got {seconds[bad].ravel()[0]}")
        return np.broadcast_to(np.maximum(1, np.rint(seconds * MODEL_RATE).astype(int)), self._count)

    def _changed(self, goals: list[Motion], left: Int[ndarray, "row"]) -> Bool[ndarray, "row"]:
        """The characters whose target, time or style is not what it was to be. Raises InputError for another rig."""
        out = left != self._left
        for row, (goal, known) in enumerate(zip(goals, self._given, strict=True)):
            if goal is known:
                continue
            if goal.skeleton is not self.poses.skeleton:
                check_gap(self.poses, goal, 1)
            out[row] |= known is None or not _same(known, goal)
        if self._styles is not self._aimed_styles:
            out |= np.array([a != b for a, b in zip(self._styles, self._aimed_styles, strict=True)])
        return out

    def _aim(self, rows: Int[ndarray, "some"], goals: list[Motion], left: Int[ndarray, "row"]) -> None:
        """Begin new bases for ``rows``, from the present poses to their goals."""
        moved = next((goals[row] for row in rows if goals[row].translations is not None), None)
        if moved is not None and self.poses.translations is None:
            self.poses, self._goals, self._simple = aligned(self.poses, moved)[0], aligned(self._goals, moved)[0], False
        here = self.poses[0]
        wanted = concatenate(*(aligned(here, goals[row][0])[1] for row in rows))
        on22 = retarget.to_humanoid(wanted, self._mapping)
        ends = on22.root_positions, on22.local_rotations
        target = pose_of(*ends)
        steer = dcmoe.steering(self._session, target, [self._styles[row] for row in rows])
        for name, value in steer.items():
            self._fixed[name][rows] = value
        start = self._now[0][rows], self._now[1][rows]
        self._bases.aim(
            rows, start, ends, left[rows], self._planned(rows, pose_of(*start), target, steer["style"], left[rows])
        )
        self._base[rows] = self._bases.base(rows, left[rows])
        self._goals = _with_rows(self._goals, rows, wanted)
        for row in rows:
            self._given[row] = goals[row]
        self._aimed_styles = self._styles

    def _planned(
        self,
        rows: Int[ndarray, "some"],
        start: poses.Pose,
        target: poses.Pose,
        style: Float[ndarray, "some style"],
        frames: Int[ndarray, "some"],
    ) -> Float[ndarray, "some time pose"]:
        """What the model's planner adds to the bases of ``rows`` at each frame; zero without one, and for longer times
        than plans."""
        if not self._session.has_planner:
            return np.zeros((len(rows), LONGEST_PLAN_STEPS + 1, POSE))
        speed = self._state["velocities"][rows]
        gap = planner.gap_inputs(start, speed, target, None, frames.tolist(), style, [None] * len(rows))
        gap["start_known"] = self._moving[rows, None].astype(float)
        added, _ = planner.predict(self._session, gap, self._noise[rows], LONGEST_PLAN_STEPS + 1)
        return added * (frames <= LONGEST_PLAN_STEPS)[:, None, None]

    def _feed(self, rows: Int[ndarray, "some"], left: Int[ndarray, "some"]) -> dict[str, ndarray]:
        """The step's inputs for ``rows``, with so many frames left to their targets."""
        feed = {name: value[rows] for name, value in (self._state | self._fixed).items()}
        feed["base"] = self._base[rows]
        feed["base_next"] = self._bases.base(rows, left - 1)
        feed["frames_left"] = left[:, None].astype(np.float32)
        if self._session.feeds_path_back:
            feed["path"] = self._path[rows]
        return feed

    def _show(self, pose: Pose, left: Int[ndarray, "row"]) -> Motion:
        """The poses on the user's rig; those of characters that arrive are their targets."""
        arrived = left == 1
        details = None if self._simple else _towards(self.poses, self._goals, 1.0 / left)
        on22 = Motion(HUMANOID, pose[0], pose[1], MODEL_RATE)
        made = retarget.from_humanoid(on22, self._mapping, details)
        local = made.local_rotations
        signs = np.sign(np.sum(local * self.poses.local_rotations, axis=-1, keepdims=True))
        local = local * np.where(signs < 0.0, -1.0, 1.0)
        self.poses = replace(
            self.poses, root_positions=made.root_positions, local_rotations=local, translations=made.translations
        )
        if arrived.any():
            rows = np.flatnonzero(arrived)
            self._now[0][rows], self._now[1][rows] = self._bases.goal_hips[rows], self._bases.goal_local[rows]
            self.poses = _with_rows(self.poses, rows, self._goals[rows])
        return self.poses


class Stream:
    """One character, one pose every thirtieth of a second. Made by :meth:`interpose.Model.stream`."""

    def __init__(
        self,
        session: Session,
        start: Motion,
        style: str | None = None,
        seed: int = 0,
        mapping: retarget.Mapping | None = None,
        plant: bool = False,
    ) -> None:
        """As for :class:`Streams`, of one character."""
        self._one = Streams(session, [start], style, [seed], mapping, plant)

    @property
    def pose(self) -> Motion:
        """The present pose on the user's rig, a motion of one frame."""
        return self._one.poses

    @property
    def contacts(self) -> Float[ndarray, "4"]:
        """Probabilities that LeftFoot, LeftToe, RightFoot, RightToe stand in it; zero before the first step."""
        return self._one.contacts[0]

    @property
    def style(self) -> str | None:
        """The style, None where it is free; set it for the next call. Raises InputError for an unknown one."""
        return self._one.styles[0]

    @style.setter
    def style(self, style: str | None) -> None:
        self._one.styles = style

    def step(self, target: Motion, seconds_left: float) -> Motion:
        """The pose a thirtieth of a second later, to be at ``target`` in ``seconds_left`` from now.

        ``target``: its first frame, on the start's skeleton. With a thirtieth of a second left or less the pose is the
        target. Raises InputError for another skeleton and a time that is negative or not finite.
        """
        return self._one.step(target, seconds_left)


@dataclass(frozen=True, eq=False)
class _Bases:
    """Interpolations from where each character was to its target, a row each; arrays that are written to.

    hips and local: of the pose where it began. turn: rotation vectors from there to the target. added: by a
    plan at each frame. frames: in all.
    """

    hips: Float[ndarray, "row 3"]
    local: Float[ndarray, "row 22 4"]
    turn: Float[ndarray, "row 22 3"]
    added: Float[ndarray, "row time pose"]
    goal_hips: Float[ndarray, "row 3"]
    goal_local: Float[ndarray, "row 22 4"]
    frames: Int[ndarray, "row"]

    @staticmethod
    def standing(pose: Pose) -> _Bases:
        """Bases that stay where they are."""
        hips, local = pose
        turn = np.zeros((*local.shape[:-1], 3))
        added = np.zeros((len(hips), LONGEST_PLAN_STEPS + 1, POSE))
        return _Bases(hips.copy(), local.copy(), turn, added, hips.copy(), local.copy(), np.ones(len(hips), dtype=int))

    def aim(
        self,
        rows: Int[ndarray, "some"],
        start: Pose,
        goal: Pose,
        frames: Int[ndarray, "some"],
        added: Float[ndarray, "some time pose"],
    ) -> None:
        """New bases for those characters, from ``start`` to ``goal`` in so many frames."""
        self.added[rows] = added
        self.hips[rows], self.local[rows] = start
        self.goal_hips[rows], self.goal_local[rows] = goal
        self.turn[rows] = rotation.to_rotation_vector(rotation.multiply(rotation.inverse(start[1]), goal[1]))
        self.frames[rows] = frames

    def base(self, rows: Int[ndarray, "some"], left: Int[ndarray, "some"]) -> Float[ndarray, "some pose"]:
        """The bases of those characters with so many frames left: hips, then global rotations as 6-D."""
        part = 1.0 - left / self.frames[rows]
        hips = self.hips[rows] + part[:, None] * (self.goal_hips[rows] - self.hips[rows])
        step = rotation.from_rotation_vector(part[:, None, None] * self.turn[rows])
        world = kinematics.global_rotations(rotation.multiply(self.local[rows], step), HUMANOID.parents)
        six = rotation.to_6d(world)
        base = np.concatenate([hips, six.reshape(len(rows), -1)], axis=-1)
        if self.added.any():
            base += self.added[rows, np.minimum(self.frames[rows] - left, LONGEST_PLAN_STEPS)]
        return base.astype(np.float32)


def _pose(out: dict[str, ndarray], rows: slice) -> Pose:
    """The poses that the network out, in double precision."""
    hips, six = (out[f"next_{name}"][rows].astype(float) for name in ("hips", "rotations"))
    return hips, local_of(six)


def _stacked(poses: Sequence[Motion]) -> Pose:
    return np.concatenate([p.root_positions for p in poses]), np.concatenate([p.local_rotations for p in poses])


def _with_rows(motion: Motion, rows: Int[ndarray, "some"], other: Motion) -> Motion:
    """``motion`` with ``other`` for those frames."""
    root, local = motion.root_positions.copy(), motion.local_rotations.copy()
    root[rows], local[rows] = other.root_positions, other.local_rotations
    moved = None
    if motion.translations is not None and other.translations is not None:
        moved = motion.translations.copy()
        moved[rows] = other.translations
    return replace(motion, root_positions=root, local_rotations=local, translations=moved)


def _towards(poses: Motion, goals: Motion, part: Float[ndarray, "row"]) -> Motion:
    """Each frame of ``poses`` moved by that share towards its frame of ``goals``."""
    share = part[:, None]
    moved = None
    if poses.translations is not None and goals.translations is not None:
        moved = poses.translations + share[..., None] * (goals.translations - poses.translations)
    return replace(
        poses,
        root_positions=poses.root_positions + share * (goals.root_positions - poses.root_positions),
        local_rotations=rotation.slerp(poses.local_rotations, goals.local_rotations, share),
        translations=moved,
    )


def _same(a: Motion, b: Motion) -> bool:
    return np.array_equal(a.root_positions[0], b.root_positions[0]) and np.array_equal(
        a.local_rotations[0], b.local_rotations[0]
    )
