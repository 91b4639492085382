"""Reads Human3.6M's exponential maps: `S1/walking_1.txt` of the archive h3.6m.zip, 50 rows of 99 numbers a second.

The motion is from Ionescu et al. 2014 (`Human3.6M`), the archive from Jain et al. 2016 (`Structural-RNN`). A row holds
three numbers for the root's translation and an exponential map for each of 32 joints.

**The first six columns are differences** from the previous row, in the root's own frame there: millimetres, then the
rotation. The first row is zero, so the file does not hold the up direction or the place of the first pose.
**Exponential maps have the opposite sign**: the archive's code multiplies row vectors by matrices, so a joint rotates
by minus its numbers. With all rotations zero the body looks along +Z, Y up, left at +X; the legs hang along -Y, and
all bones of the torso and the arms point along +Y.

The up direction is estimated: takes begin upright, and people who stand straight have their neck above their ankles
within about 3 degrees. Then :func:`up` fits the floor to toes that stand still, which is more accurate the farther the
take walks. The clip starts at the origin, its first pose along +Z; `interpose.io.grounding` finds height and size.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose.errors import InputError
from interpose.io import grounding
from interpose.motion import Motion, from_global, velocities

_RATE = 50.0
_COLUMNS = 99
_MILLIMETRE = 0.001
_LARGEST_STEP = 0.3  # metres in a fiftieth of a second
_LARGEST_TURN = 1.0  # radians in a fiftieth of a second
_LARGEST_ANGLE = 1e3  # radians
_STANDING_SHARE = 0.97  # of the longest distance from ankles to neck: from there on a body stands straight
_UPRIGHT_ANGLE = 0.8  # radians, between ankles to neck and the Y axis of the first pose
_FLOOR_BANDS = (0.25, 0.15, 0.08)  # metres above the lowest still toes that count as floor, one per iteration
_FLOOR_DEVIATION = 0.01  # metres, of still toes from the floor
_LEAN_DEVIATION = 0.05  # radians, of standing people from the vertical


def _rotation(x: float = 0.0, z: float = 0.0) -> Float[ndarray, "4"]:
    return rotation.from_rotation_vector(np.array([x, 0.0, z]))


_QUARTER = np.pi / 2.0
_JOINTS: list[tuple[str, int, str | None, tuple[float, float, float], Float[ndarray, "4"]]] = [
    # name, index among the 32, parent, offset in the T-pose, and the rotation of the file's joint in that T-pose
    ("Hips", 0, None, (0.0, 0.0, 0.0), rotation.IDENTITY),
    ("RightUpLeg", 1, "Hips", (-0.11, 0.0, 0.0), rotation.IDENTITY),
    ("RightLeg", 2, "RightUpLeg", (0.0, -0.44, 0.0), rotation.IDENTITY),
    ("RightFoot", 3, "RightLeg", (0.0, -0.43, 0.0), _rotation(x=0.1)),
    ("RightToeBase", 4, "RightFoot", (0.0, -0.065, 0.14), _rotation(x=-0.25)),
    ("LeftUpLeg", 6, "Hips", (0.11, 0.0, 0.0), rotation.IDENTITY),
    ("LeftLeg", 7, "LeftUpLeg", (0.0, -0.44, 0.0), rotation.IDENTITY),
    ("LeftFoot", 8, "LeftLeg", (0.0, -0.43, 0.0), _rotation(x=0.1)),
    ("LeftToeBase", 9, "LeftFoot", (0.0, -0.065, 0.14), _rotation(x=-0.25)),
    ("Spine", 11, "Hips", (0.0, 0.0, 0.0), rotation.IDENTITY),
    ("Spine1", 12, "Spine", (0.0, 0.24, 0.0), rotation.IDENTITY),
    ("Neck", 13, "Spine1", (0.0, 0.25, 0.0), _rotation(x=0.7)),
    ("Head", 14, "Neck", (0.0, 0.09, 0.07), _rotation(x=-0.6)),
    ("LeftShoulder", 16, "Spine1", (0.02, 0.23, 0.0), _rotation(z=-_QUARTER)),
    ("LeftArm", 17, "LeftShoulder", (0.15, 0.0, 0.0), _rotation(z=-_QUARTER)),
    ("LeftForeArm", 18, "LeftArm", (0.28, 0.0, 0.0), _rotation(z=-_QUARTER)),
    ("LeftHand", 19, "LeftForeArm", (0.25, 0.0, 0.0), _rotation(z=-_QUARTER)),
    ("RightShoulder", 24, "Spine1", (-0.02, 0.23, 0.0), _rotation(z=_QUARTER)),
    ("RightArm", 25, "RightShoulder", (-0.15, 0.0, 0.0), _rotation(z=_QUARTER)),
    ("RightForeArm", 26, "RightArm", (-0.28, 0.0, 0.0), _rotation(z=_QUARTER)),
    ("RightHand", 27, "RightForeArm", (-0.25, 0.0, 0.0), _rotation(z=_QUARTER)),
]

H36M_SKELETON = grounding.skeleton_of([(name, parent, offset) for name, _, parent, offset, _ in _JOINTS])
"""Human3.6M's joints without bone ends, thumbs and duplicates, with our own offsets in a T-pose that looks along +Z.

In a T-pose the file's legs, collars and arms are at right angles to the body. Its feet, toes, neck (the bone to the
nose) and head are not; their rotations were estimated from a few frames of four subjects in an upright pose, and differ
between subjects by about 0.2 radians.
"""

_TOES = [H36M_SKELETON.index("LeftToeBase"), H36M_SKELETON.index("RightToeBase")]
_FILE_JOINTS = [index for _, index, _, _, _ in _JOINTS]
_REST_ROTATIONS = np.array([turned for _, _, _, _, turned in _JOINTS])
_NECK = H36M_SKELETON.index("Neck")
_ANKLES = [H36M_SKELETON.index("LeftFoot"), H36M_SKELETON.index("RightFoot")]


def recognises(data: bytes) -> bool:
    """Whether the first line that is not blank holds 99 numbers."""
    head = data.removeprefix(b"\xef\xbb\xbf").lstrip()[:10_000]
    fields = re.split(rb"[\r\n]", head, maxsplit=1)[0].decode(errors="replace").split(",")
    return len(fields) == _COLUMNS and all(map(_is_number, fields))


def parse(data: bytes, name: str) -> Motion:
    """The motion in a file of exponential maps, on :data:`H36M_SKELETON` in the performer's size, the floor at y = 0.

    ``name`` stands for the path in messages. Raises InputError, with the line if there is one, for a file without a
    complete motion.
    """
    rows = _rows(data, name)
    rotations = rotation.from_rotation_vector(-rows[:, 3:].reshape(-1, 32, 3))
    root, facing = _accumulate(rows[:, :3] * _MILLIMETRE, rotations[:, 0])
    local = rotations[:, _FILE_JOINTS]
    local[:, 0] = facing
    world = Motion(H36M_SKELETON, root, local, _RATE).global_rotations()
    motion = from_global(H36M_SKELETON, root, rotation.multiply(world, rotation.inverse(_REST_ROTATIONS)), _RATE)
    motion = _rotated_to_y(motion, _standing_direction(motion))
    motion = grounding.grounded(_rotated_to_y(motion, up(motion)), _TOES)
    return replace(motion, layout=grounding.UnitLayout(_MILLIMETRE))


def up(motion: Motion) -> Float[ndarray, "3"]:
    """The floor's normal, a unit vector, for a motion whose Y axis is close to it.

    A least-squares plane through the toes that stand still, regularised towards Y: where the toes cover little ground,
    Y decides. Toes that rest on something higher are left out by ever narrower bands.
    """
    toes = motion.global_positions()[:, _TOES]
    normal = np.array([0.0, 1.0, 0.0])
    still = toes[np.linalg.norm(velocities(toes, motion.rate), axis=-1) < grounding.STILL_SPEED]
    if not len(still):
        return normal
    for band in _FLOOR_BANDS:
        heights = still @ normal
        floor = still[heights <= np.percentile(heights, 10.0) + band]
        floor = floor - floor.mean(axis=0)
        ground = floor[:, [0, 2]]
        prior = (_FLOOR_DEVIATION / _LEAN_DEVIATION) ** 2 * np.eye(2)
        slope = np.linalg.solve(ground.T @ ground / len(floor) + prior, -ground.T @ floor[:, 1] / len(floor))
        normal = np.array([slope[0], 1.0, slope[1]])
        normal /= np.linalg.norm(normal)
    return normal


def _standing_direction(motion: Motion) -> Float[ndarray, "3"]:
    """The mean direction from the ankles to the neck, a unit vector, over the frames in which the body is upright like
    the first pose and nearly as long as ever; the first pose's Y axis where there are none."""
    points = motion.global_positions()
    body = points[:, _NECK] - points[:, _ANKLES].mean(axis=1)
    length = np.linalg.norm(body, axis=-1)
    upright = body[:, 1] > np.cos(_UPRIGHT_ANGLE) * length
    if not upright.any():
        return np.array([0.0, 1.0, 0.0])
    standing = upright & (length >= _STANDING_SHARE * length[upright].max())
    mean = (body[standing] / length[standing, None]).mean(axis=0)
    return mean / np.linalg.norm(mean)


def _rotated_to_y(motion: Motion, direction: Float[ndarray, "3"]) -> Motion:
    """The motion rotated about the origin by the smallest rotation from ``direction`` to Y."""
    turn = rotation.between(direction, np.array([0.0, 1.0, 0.0]))
    local = motion.local_rotations.copy()
    local[:, 0] = rotation.multiply(turn, local[:, 0])
    return replace(motion, root_positions=rotation.rotate(turn, motion.root_positions), local_rotations=local)


def _accumulate(
    steps: Float[ndarray, "frame 3"], turns: Float[ndarray, "frame 4"]
) -> tuple[Float[ndarray, "frame 3"], Float[ndarray, "frame 4"]]:
    """The root's positions and rotations, from their differences in its own frame of the previous row."""
    facing = np.empty_like(turns)
    before = facing[0] = turns[0]
    for frame in range(1, len(turns)):
        before = facing[frame] = rotation.multiply(before, turns[frame])
    previous = np.concatenate([rotation.IDENTITY[None], facing[:-1]])
    root = np.cumsum(rotation.rotate(previous, steps), axis=0)
    return root, facing / np.linalg.norm(facing, axis=-1, keepdims=True)


def _rows(data: bytes, name: str) -> Float[ndarray, "frame 99"]:
    """The numbers of the file, checked."""
    text = data.decode("utf-8-sig", errors="replace")
    rows = [(number, row.split(",")) for number, row in enumerate(text.splitlines(), start=1) if row.strip()]
    if not rows:
        raise InputError(f"{name}: the file is empty")
    for number, fields in rows:
        if len(fields) != _COLUMNS:
            raise InputError(
                f"{name} line {number}: {len(fields)} comma-separated fields, expected the {_COLUMNS} numbers of a "
                "Human3.6M exponential map"
            )
    try:
        values = np.array([fields for _, fields in rows], dtype=float)
    except ValueError:
        bad_fields = ((n, field) for n, fields in rows for field in fields if not _is_number(field))
        number, field = next(bad_fields, (rows[0][0], rows[0][1][0]))
        raise InputError(f"{name} line {number}: {field.strip()[:40]!r} is not a number") from None
    differences = "; columns 1 to 6 must be differences between rows, as in h3.6m.zip"
    step, turn = np.linalg.norm(values[:, :3], axis=1) * _MILLIMETRE, np.linalg.norm(values[:, 3:6], axis=1)
    for bad, problem in (
        (~np.isfinite(values).all(axis=1), "holds nan or infinity"),
        (np.abs(values[:, 3:]).max(axis=1) > _LARGEST_ANGLE, "holds an angle of more than a thousand radians"),
        (step > _LARGEST_STEP, f"moves the root by more than {_LARGEST_STEP:g} m{differences}"),
        (turn > _LARGEST_TURN, f"rotates the root by more than {_LARGEST_TURN:g} rad{differences}"),
    ):
        if bad.any():
            raise InputError(f"{name} line {rows[int(np.argmax(bad))][0]}: {problem}")
    return values


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True
