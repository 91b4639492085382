"""One pose a call, for games: target, time and style may change at any call.

Feet are as the model predicts them, or held where they stand (`feet.stream_lock`): the foot lock of whole transitions
needs the frames to come.
"""

from __future__ import annotations

from jaxtyping import Float
from numpy import ndarray

from interpose import retarget
from interpose.motion import Motion
from interpose.runtime.model_folder import Session
from interpose.runtime.streaming.streams import Streams


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
        """``start``: its last frame is the first pose, those before it are context. ``mapping``: of the rig, where
        it is known. ``plant``: hold feet where they stand. Raises InputError for a rig that is no humanoid, an unknown
        style, and a model for whole gaps.
        """
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
