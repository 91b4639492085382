"""Which joint of a skeleton stands for which of the humanoid's, and how the two are turned against each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.errors import InputError
from interpose.motion import Motion
from interpose.retarget import naming, rest
from interpose.skeleton import HUMANOID, Skeleton

_END_BONES = ("Head", "Hand", "Foot", "Toe")
_ANKLE_HEIGHT = -float(HUMANOID.offsets[HUMANOID.index("LeftToe"), 1])  # the toe joint of a flat foot is on the floor

MOST_SPARE = 0.4
"""Share of a skeleton's bone length that may be unmapped; with more (more legs, a tail) it is not a humanoid."""


@dataclass(frozen=True, eq=False)
class Mapping:
    """How `skeleton` stands for the humanoid; made by :func:`map_skeleton`.

    profile: the recognised family of rigs, or how the joints were found.
    joints: for each of the 22 joints the source joint, or None.
    rest_global: global rotation of each source joint when its character stands in the humanoid's T-pose (identity where
    there is none), so that q_humanoid = q_source * inverse(rest_global) and q_source = q_humanoid * rest_global.
    scale: the humanoid's metres for one of the source, from the lengths of the legs. lift: metres added to the height
    after scaling, which keeps both soles on the same floor. hip_centre: the point midway between the thighs in the
    hips' own frame, metres.
    torso: unmapped source joints between mapped joints of the spine or neck, which bend with their neighbours. All
    other unmapped joints keep their rest rotation.
    """

    profile: str
    skeleton: Skeleton
    joints: tuple[int | None, ...]
    rest_global: Float[ndarray, "22 4"]
    scale: float
    lift: float
    hip_centre: Float[ndarray, "3"]
    torso: tuple[int, ...]

    @property
    def hips(self) -> int:
        """The source joint that stands for the hips."""
        joint = self.joints[HUMANOID.index("Hips")]
        assert joint is not None
        return joint

    def pairs(self) -> dict[str, str | None]:
        """For each of the 22 joints the name of the source joint, or None."""
        names = self.skeleton.names
        return {ours: None if j is None else names[j] for ours, j in zip(HUMANOID.names, self.joints, strict=True)}

    @property
    def missing(self) -> tuple[str, ...]:
        """The humanoid's joints that the source lacks."""
        return tuple(name for name, source in self.pairs().items() if source is None)

    @property
    def unmapped(self) -> tuple[str, ...]:
        """The source joints that the humanoid lacks."""
        used = set(self.joints)
        return tuple(name for j, name in enumerate(self.skeleton.names) if j not in used)

    @property
    def spare(self) -> float:
        """The unmapped share of the bone length, without what hangs on head, hands and feet (fingers, toes, hair)."""
        parents, lengths = self.skeleton.parents, np.linalg.norm(self.skeleton.offsets, axis=1)
        kept = {joint for joint in self.joints if joint is not None}
        for joint in range(len(parents) - 1, 0, -1):  # what leads to a joint of the humanoid
            if joint in kept:
                kept.add(parents[joint])
        ends = {j for n, j in zip(HUMANOID.names, self.joints, strict=True) if n.endswith(_END_BONES)}
        for joint in range(1, len(parents)):  # what hangs on the head, the hands and the feet
            if parents[joint] in ends:
                ends.add(joint)
        return float(sum(lengths[j] for j in range(1, len(parents)) if j not in kept | ends) / lengths[1:].sum())


def map_skeleton(source: Skeleton | Motion) -> Mapping:
    """Finds the humanoid in a skeleton. The frames of a motion are used only where the rest pose shows no body.

    Raises InputError where hips or legs are missing, naming them, and where a rig of no known family leaves more than
    :data:`MOST_SPARE` of its bone length unmapped.
    """
    motion = source if isinstance(source, Motion) else None
    skeleton = source.skeleton if isinstance(source, Motion) else source
    found = naming.find(skeleton, motion)
    stance = rest.stance(skeleton, found, motion)
    leg = stance.leg_length
    if not leg > 0:
        raise InputError("the skeleton's legs have no length; its joint offsets are missing")
    ours = float(np.abs(HUMANOID.offsets[[HUMANOID.index("LeftLeg"), HUMANOID.index("LeftFoot")], 1]).sum())
    scale = ours / leg
    mapping = Mapping(
        found.profile,
        skeleton,
        found.joints,
        stance.rest_global,
        scale,
        _ANKLE_HEIGHT - scale * stance.ankle_height,
        stance.hip_centre,
        found.torso,
    )
    if found.known is None and mapping.spare > MOST_SPARE:
        share, names = 100.0 * mapping.spare, ", ".join(mapping.unmapped[:6])
        raise InputError(
            f"no humanoid was found in the skeleton: {share:.0f} % of its bones' length has no counterpart in one "
            f"({names}{', …' if len(mapping.unmapped) > 6 else ''}); it may have more than two legs"
        )
    return mapping
