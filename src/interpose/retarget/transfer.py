"""Motions from a user's skeleton to the humanoid and back, with the details that the humanoid does not carry.

Rotations are transferred globally; the root by the point midway between the thighs, so that the feet of both skeletons
meet the same floor.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose import skeleton as kinematics
from interpose.errors import InputError
from interpose.motion import Motion, concatenate, from_global
from interpose.retarget.mapping import Mapping
from interpose.rotation import UP
from interpose.skeleton import HUMANOID

_HIPS = HUMANOID.index("Hips")
_HIP_CENTRE = (HUMANOID.offsets[HUMANOID.index("LeftUpLeg")] + HUMANOID.offsets[HUMANOID.index("RightUpLeg")]) / 2
_TORSO = tuple(HUMANOID.index(name) for name in ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"))
_HANGING_ARM = np.radians(75.0)  # from the T-pose to an arm at the side, for sources without arms


def to_humanoid(motion: Motion, mapping: Mapping) -> Motion:
    """The motion on the 22 joints, at its own rate. Joints that the source lacks are filled from their neighbours.

    Raises InputError where the motion has another skeleton than the mapping.
    """
    _check(motion, mapping)
    world = motion.global_rotations()
    turned = _fill(_turned({j: world[:, j] for j in mapping.joints if j is not None}, mapping))
    hips = mapping.hips
    centre = motion.global_positions()[:, hips] + rotation.rotate(world[:, hips], mapping.hip_centre)
    root = centre * mapping.scale - rotation.rotate(turned[:, _HIPS], _HIP_CENTRE) + mapping.lift * UP
    return from_global(HUMANOID, root, turned, motion.rate)


def from_humanoid(motion: Motion, mapping: Mapping, like: Motion | None = None) -> Motion:
    """A motion of the 22 joints on the mapping's skeleton, at its own rate.

    Unmapped joints follow ``like``: frame by frame where it is as long as the motion, else its first frame. Without it
    they keep the rest pose. The file layout is that of ``like``, too. Raises InputError for a motion that is not of the
    22 joints, and for ``like`` with another skeleton than the mapping.
    """
    if motion.skeleton.names != HUMANOID.names:
        raise InputError("only a motion of the 22-joint humanoid can be transferred to another skeleton")
    turned = motion.global_rotations()
    centre = (
        motion.root_positions - mapping.lift * UP + rotation.rotate(turned[:, _HIPS], _HIP_CENTRE)
    ) / mapping.scale
    pairs = [(ours, joint) for ours, joint in enumerate(mapping.joints) if joint is not None]
    known = [ours for ours, _ in pairs]
    carried = rotation.multiply(turned[:, known], mapping.rest_global[known])
    world = {joint: carried[:, i] for i, (_, joint) in enumerate(pairs)}
    place = centre - rotation.rotate(world[mapping.hips], mapping.hip_centre)
    if like is None:
        rest = np.tile(rotation.IDENTITY, (len(motion), len(mapping.skeleton), 1))
        like = Motion(mapping.skeleton, np.zeros((len(motion), 3)), rest, motion.rate)
        details = _Details(rest, like.root_positions, None)
    else:
        _check(like, mapping)
        if len(like) != len(motion):
            like = concatenate(*[like[0]] * len(motion))
        details = _details(like, mapping)
    return _assemble(world, place, details, mapping, replace(like, rate=motion.rate))


@dataclass(frozen=True)
class _Details:
    """What a pose has beyond the 22 joints.

    rotations: of unmapped joints, in the torso relative to the bend of their neighbours, elsewhere local; identity for
    mapped joints. root: the position of joint 0, metres, used if the hips are below it.
    """

    rotations: Float[ndarray, "frame joint 4"]
    root: Float[ndarray, "frame 3"]
    translations: Float[ndarray, "frame joint 3"] | None


def _details(motion: Motion, mapping: Mapping) -> _Details:
    world = motion.global_rotations()
    mapped = {joint: world[:, joint] for joint in mapping.joints if joint is not None}
    bent = _bent(mapped, mapping)
    rotations = motion.local_rotations.copy()
    for joint in mapped:
        rotations[:, joint] = rotation.IDENTITY
    for joint, base in bent.items():
        rotations[:, joint] = rotation.multiply(rotation.inverse(base), world[:, joint])
    return _Details(rotations, motion.root_positions, motion.translations)


def _assemble(
    mapped: dict[int, Float[ndarray, "frame 4"]],
    hips_place: Float[ndarray, "frame 3"],
    details: _Details,
    mapping: Mapping,
    like: Motion,
) -> Motion:
    """A motion from the mapped joints' global rotations, the hips' positions, and the details of all other joints."""
    skeleton, hips = mapping.skeleton, mapping.hips
    bent = _bent(mapped, mapping)
    world: list[Float[ndarray, "frame 4"]] = []
    for joint, parent in enumerate(skeleton.parents):
        if joint in mapped:
            world.append(mapped[joint])
        elif joint in bent:
            world.append(rotation.multiply(bent[joint], details.rotations[:, joint]))
        else:
            own = details.rotations[:, joint]
            world.append(own if parent < 0 else rotation.multiply(world[parent], own))
    turned = np.stack(world, axis=1)
    root, moved = hips_place, None
    if details.translations is not None:
        moved = details.translations.copy()
        if hips != 0:
            root = details.root
            above = skeleton.parents[hips]
            place = kinematics.global_positions(root, turned, skeleton.parents, moved)[:, above]
            moved[:, hips] = rotation.rotate(rotation.inverse(turned[:, above]), hips_place - place)
        moved[:, 0] = root
    elif hips != 0:
        zero = np.zeros_like(hips_place)
        root = hips_place - kinematics.global_positions(zero, turned, skeleton.parents, skeleton.offsets)[:, hips]
    local = rotation.continuous(kinematics.local_rotations(turned, skeleton.parents))
    return replace(like, skeleton=skeleton, root_positions=root, local_rotations=local, translations=moved)


def _turned(world: dict[int, Float[ndarray, "frame 4"]], mapping: Mapping) -> list[Float[ndarray, "frame 4"] | None]:
    """For each of the 22 joints its rotation since the T-pose, None where the source lacks it."""
    known = [ours for ours, joint in enumerate(mapping.joints) if joint is not None]
    given = np.stack([world[joint] for joint in mapping.joints if joint is not None], axis=1)
    turned = rotation.multiply(given, rotation.inverse(mapping.rest_global[known]))
    return [turned[:, known.index(ours)] if ours in known else None for ours in range(len(mapping.joints))]


def _bent(mapped: dict[int, Float[ndarray, "frame 4"]], mapping: Mapping) -> dict[int, Float[ndarray, "frame 4"]]:
    """Global rotations of the torso's unmapped joints, interpolated evenly between their mapped neighbours."""
    parents = mapping.skeleton.parents
    rests = {joint: mapping.rest_global[ours] for ours, joint in enumerate(mapping.joints) if joint is not None}
    spread: dict[int, Float[ndarray, "frame 4"]] = {}
    for below in mapped:
        run: list[int] = []
        above = parents[below]
        while above in mapping.torso:
            run.insert(0, above)
            above = parents[above]
        if not run or above not in mapped or run[0] in spread:
            continue
        low = rotation.multiply(mapped[above], rotation.inverse(rests[above]))
        high = rotation.multiply(mapped[below], rotation.inverse(rests[below]))
        for step, joint in enumerate(run, start=1):
            share = np.full(len(low), step / (len(run) + 1))
            spread[joint] = rotation.multiply(rotation.slerp(low, high, share), rests[above])
    return spread


def _fill(turned: list[Float[ndarray, "frame 4"] | None]) -> Float[ndarray, "frame 22 4"]:
    """Rotations for missing joints: in the torso interpolated evenly, elsewhere those of their parents."""
    out: list[Float[ndarray, "frame 4"]] = []
    for joint, given in enumerate(turned):
        if given is not None:
            out.append(given)
            continue
        parent = out[HUMANOID.parents[joint]]
        name = HUMANOID.names[joint]
        if name.endswith("Arm") and not name.endswith("ForeArm"):
            sign = -1.0 if name.startswith("Left") else 1.0
            parent = rotation.multiply(parent, rotation.from_rotation_vector(np.array([0.0, 0.0, sign * _HANGING_ARM])))
        elif joint in _TORSO:
            rest = _TORSO[_TORSO.index(joint) :]
            ahead = next((k for k in range(len(rest)) if turned[rest[k]] is not None), None)
            if ahead is not None:
                high = turned[rest[ahead]]
                assert high is not None
                parent = rotation.slerp(parent, high, np.full(len(parent), 1.0 / (ahead + 1)))
        out.append(parent)
    return np.stack(out, axis=1)


def _check(motion: Motion, mapping: Mapping) -> None:
    if motion.skeleton.names != mapping.skeleton.names or motion.skeleton.parents != mapping.skeleton.parents:
        raise InputError("the motion has another skeleton than the mapping; map its own skeleton")
