"""One pose a call, for games: the target and the time left may change at any call.

Each call is one step of the roll-out (`rollout`). While target and time go on as they were, the interpolation base of
docs/method.md, D1, stays what it was, so that undisturbed calls give the very frames of the whole roll-out; where they
change, a new base begins at the present pose, which then leads to the new target in the new time. Feet are as the
model makes them: the clean-up of a whole transition needs to know what comes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import retarget, rotation
from interpose import skeleton as kinematics
from interpose.errors import InputError
from interpose.motion import Motion, concatenate, sample
from interpose.runtime import rollout
from interpose.runtime.interpolate import aligned, check_gap
from interpose.runtime.resampling import CONTEXT, MODEL_RATE, recent
from interpose.runtime.session import Session
from interpose.skeleton import HUMANOID


class Stream:
    """A character on its way, one pose a thirtieth of a second. Made by :meth:`interpose.Model.stream`.

    pose: the present pose on the user's rig, a motion of one frame.
    """

    def __init__(
        self,
        session: Session,
        start: Motion,
        style: str | None = None,
        seed: int = 0,
        mapping: retarget.Mapping | None = None,
    ) -> None:
        """``start``: its last frame is the first pose, those before it are context. ``mapping``: of the rig, where
        it is known. Raises InputError for a rig that is no humanoid, an unknown style, and a model for whole gaps.
        """
        if session.method != "dcmoe":
            raise InputError(
                f"the model '{session.name}' makes whole gaps (method {session.method}); stream with one for dcmoe"
            )
        self._session, self._style = session, style
        session.style_weights([style])
        self._mapping = retarget.plan(start) if mapping is None else mapping
        self.pose = replace(start[-1], rate=MODEL_RATE)
        known = retarget.to_humanoid(recent(start, CONTEXT), self._mapping)
        context = rollout.pose_of(known.root_positions[None], known.local_rotations[None])
        state = rollout.initial_state(context, rollout.initial_phases(session, 1, seed, vary=True))
        self._state = {name: np.ascontiguousarray(value, dtype=np.float32) for name, value in state.items()}
        self._path = rollout.resting_path(context)
        self._now = known[-1]
        self._target: Motion | None = None
        self._left = 0

    def step(self, target: Motion, seconds_left: float) -> Motion:
        """The pose a thirtieth of a second later, on the way to be at ``target`` in ``seconds_left`` from now.

        ``target``: its first frame, on the start's skeleton. With a thirtieth of a second left or less the pose is the
        target. Raises InputError for another skeleton and a time that is negative or not finite.
        """
        check_gap(self.pose, target, 1)
        if not 0.0 <= seconds_left < np.inf:
            raise InputError(f"seconds_left must be 0 or more, got {seconds_left}")
        left = max(1, round(seconds_left * MODEL_RATE))
        if self._target is None or left != self._left or not _same(self._target, target):
            self._aim(target[0], left)
        said = self._session.step(self._feed(left))
        self._state, self._path, self._left = rollout.after(said), said["next_path"], left - 1
        goal = aligned(self.pose, target[0])[1]
        if left == 1:
            self._now, self.pose = retarget.to_humanoid(goal, self._mapping), goal
            return goal
        world = rotation.from_6d(self._state["rotations"].astype(float))
        local = kinematics.local_rotations(world, HUMANOID.parents)
        self._now = Motion(HUMANOID, self._state["hips"].astype(float), local, MODEL_RATE)
        details = sample(concatenate(self.pose, goal), np.array([1.0 / left]))
        after = retarget.from_humanoid(self._now, self._mapping, details)
        signs = np.sign(np.sum(after.local_rotations * self.pose.local_rotations, axis=-1, keepdims=True))
        self.pose = replace(after, local_rotations=after.local_rotations * np.where(signs < 0.0, -1.0, 1.0))
        return self.pose

    def _aim(self, target: Motion, left: int) -> None:
        """Begin a new base, from the present pose to ``target`` in ``left`` frames."""
        goal = retarget.to_humanoid(aligned(self.pose, target)[1], self._mapping)
        ends = [(m.root_positions, m.local_rotations) for m in (self._now, goal)]
        self._base: Float[ndarray, "1 time pose"] = rollout.interpolation(ends[0], ends[1], left - 1).astype(np.float32)
        self._fixed = rollout.steering(self._session, rollout.pose_of(*ends[1]), [self._style])
        self._target, self._frames = target, left

    def _feed(self, left: int) -> dict[str, ndarray]:
        at = self._frames - left
        moving = {
            "base": self._base[:, at],
            "base_next": self._base[:, at + 1],
            "frames_left": np.full((1, 1), left, dtype=np.float32),
        }
        if self._session.feeds_path_back:
            moving["path"] = self._path
        return self._state | self._fixed | moving


def _same(a: Motion, b: Motion) -> bool:
    return np.array_equal(a.root_positions[0], b.root_positions[0]) and np.array_equal(
        a.local_rotations[0], b.local_rotations[0]
    )
