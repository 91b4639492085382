"""Reading Human3.6M's exponential maps: `S1/walking_1.txt` of the archive h3.6m.zip, 99 numbers a row, 50 a second.

The archive was made for Jain et al. 2016 (`Structural-RNN`); Martinez et al. 2017 (`On human motion prediction using
recurrent neural networks`) and those after them use it. The motion is that of Ionescu et al. 2014 (`Human3.6M`). A row
is three numbers for where the root is, and three, an exponential map, for each of 32 joints.

**The first six columns are steps, not places.** Columns 1 to 3 are how far the root moved since the row before, in
millimetres, columns 4 to 6 how it turned, both in the root's own frame of the row before; the first row is zero. The
code that came with the archive sums them up first (`revertCoordinateSpace`). So the first pose is only known relative
to its pelvis: which way is up, where the room is and how high the pelvis is are not in the file.

**An exponential map turns the other way than usual.** That code multiplies row vectors by the matrices, so to us, who
multiply matrices by columns, a joint turns by minus its numbers. With all rotations zero the body looks along +Z, Y up,
its left at +X; the legs hang along -Y, and all bones of the torso and the arms lie along +Y.

Up is found in two steps. The takes begin upright, so it is near the first pelvis' Y axis; people who stand stretched
have their neck above their ankles (within 3 degrees or so); and toes that stand still lie on the floor, which tells it
the better, the farther the take walks (:func:`up`). The clip starts at the origin, and its first pose looks along +Z.
Height and the performer's size come from `interpose.io.grounding`.
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
from interpose.io.layout import UnitLayout
from interpose.motion import Motion, from_global, velocities
from interpose.skeleton import Skeleton

RATE = 50.0
COLUMNS = 99

_MILLIMETRE = 0.001
_LONGEST_STEP = 0.3  # metres in a fiftieth of a second
_WIDEST_STEP = 1.0  # radians in a fiftieth of a second
_WIDEST = 1e3  # radians
_TALLEST = 0.03  # of the stretch from ankles to neck: nearer to the clip's longest is standing
_UPRIGHT = 0.8  # radians between the stretch of a body and the Y axis of the first pose, that of an upright pelvis
_BANDS = (0.25, 0.15, 0.08)  # metres above the lowest still toes that are still the floor, in turn
_FLAT = 0.01  # metres: how flat the floor looks to the toes
_LEAN = 0.05  # radians: how far from the vertical people stand


def _turn(x: float = 0.0, z: float = 0.0) -> Float[ndarray, "4"]:
    return rotation.from_rotation_vector(np.array([x, 0.0, z]))


_QUARTER = np.pi / 2.0
_JOINTS: list[tuple[str, int, str | None, tuple[float, float, float], Float[ndarray, "4"]]] = [
    # name, index of the 32, parent, offset in the T-pose, and how the joint of the file is turned in that T-pose
    ("Hips", 0, None, (0.0, 0.0, 0.0), rotation.IDENTITY),
    ("RightUpLeg", 1, "Hips", (-0.11, 0.0, 0.0), rotation.IDENTITY),
    ("RightLeg", 2, "RightUpLeg", (0.0, -0.44, 0.0), rotation.IDENTITY),
    ("RightFoot", 3, "RightLeg", (0.0, -0.43, 0.0), _turn(x=0.1)),
    ("RightToeBase", 4, "RightFoot", (0.0, -0.065, 0.14), _turn(x=-0.25)),
    ("LeftUpLeg", 6, "Hips", (0.11, 0.0, 0.0), rotation.IDENTITY),
    ("LeftLeg", 7, "LeftUpLeg", (0.0, -0.44, 0.0), rotation.IDENTITY),
    ("LeftFoot", 8, "LeftLeg", (0.0, -0.43, 0.0), _turn(x=0.1)),
    ("LeftToeBase", 9, "LeftFoot", (0.0, -0.065, 0.14), _turn(x=-0.25)),
    ("Spine", 11, "Hips", (0.0, 0.0, 0.0), rotation.IDENTITY),
    ("Spine1", 12, "Spine", (0.0, 0.24, 0.0), rotation.IDENTITY),
    ("Neck", 13, "Spine1", (0.0, 0.25, 0.0), _turn(x=0.7)),
    ("Head", 14, "Neck", (0.0, 0.09, 0.07), _turn(x=-0.6)),
    ("LeftShoulder", 16, "Spine1", (0.02, 0.23, 0.0), _turn(z=-_QUARTER)),
    ("LeftArm", 17, "LeftShoulder", (0.15, 0.0, 0.0), _turn(z=-_QUARTER)),
    ("LeftForeArm", 18, "LeftArm", (0.28, 0.0, 0.0), _turn(z=-_QUARTER)),
    ("LeftHand", 19, "LeftForeArm", (0.25, 0.0, 0.0), _turn(z=-_QUARTER)),
    ("RightShoulder", 24, "Spine1", (-0.02, 0.23, 0.0), _turn(z=_QUARTER)),
    ("RightArm", 25, "RightShoulder", (-0.15, 0.0, 0.0), _turn(z=_QUARTER)),
    ("RightForeArm", 26, "RightArm", (-0.28, 0.0, 0.0), _turn(z=_QUARTER)),
    ("RightHand", 27, "RightForeArm", (-0.25, 0.0, 0.0), _turn(z=_QUARTER)),
]

SKELETON = Skeleton(
    tuple(name for name, *_ in _JOINTS),
    tuple(-1 if parent is None else [name for name, *_ in _JOINTS].index(parent) for _, _, parent, _, _ in _JOINTS),
    np.array([offset for _, _, _, offset, _ in _JOINTS]),
)
"""The joints of Human3.6M that move and matter, by its names, with offsets of our own in a T-pose that looks along +Z.

Left out are the ends of bones, the thumbs and the doubles. In a T-pose the file's legs, collars and arms are square to
the body. Its soles, toes, neck (the bone to the nose) and head are not; how they stand in upright people was estimated
from a few frames of four subjects, and differs between them by about 0.2 radians.
"""

TOES = (SKELETON.index("LeftToeBase"), SKELETON.index("RightToeBase"))

_INDICES = [index for _, index, _, _, _ in _JOINTS]
_REST = np.array([turned for _, _, _, _, turned in _JOINTS])
_NECK = SKELETON.index("Neck")
_ANKLES = [SKELETON.index("LeftFoot"), SKELETON.index("RightFoot")]


def recognises(data: bytes) -> bool:
    """Whether the first line that is not blank holds 99 numbers."""
    head = data.removeprefix(b"\xef\xbb\xbf").lstrip()[:10_000]
    fields = re.split(rb"[\r\n]", head, maxsplit=1)[0].decode(errors="replace").split(",")
    return len(fields) == COLUMNS and all(map(_is_number, fields))


def parse(data: bytes, name: str) -> Motion:
    """The motion in a file of exponential maps, on :data:`SKELETON` in the performer's size: metres, Y up, floor at 0.

    ``name`` stands for the path in messages. Raises InputError, with the line where there is one, for a file that holds
    no whole motion.
    """
    rows = _rows(data, name)
    steps, turns = rows[:, :3] * _MILLIMETRE, rotation.from_rotation_vector(-rows[:, 3:].reshape(-1, 32, 3))
    place, facing = _path(steps, turns[:, 0])
    local = turns[:, _INDICES]
    local[:, 0] = facing
    posed = Motion(SKELETON, place, local, RATE)
    world = rotation.multiply(posed.global_rotations(), rotation.inverse(_REST))
    motion = from_global(SKELETON, place, world, RATE)
    motion = _stood_up(motion, _stretched(motion))
    grounded = grounding.grounded(_stood_up(motion, up(motion)), TOES)
    return replace(grounded, layout=UnitLayout(_MILLIMETRE))


def up(motion: Motion) -> Float[ndarray, "3"]:
    """The direction away from the floor, a unit vector, for a motion whose Y axis is nearly that.

    Least squares for a plane through the toes that stand still, held towards Y as much as they lie in one place; toes
    that rest on something higher are left out, fewer the better the plane is known.
    """
    toes = motion.global_positions()[:, list(TOES)]
    normal = np.array([0.0, 1.0, 0.0])
    rows = toes[np.linalg.norm(velocities(toes, motion.rate), axis=-1) < grounding.STILL]
    if not len(rows):
        return normal
    for band in _BANDS:
        heights = rows @ normal
        floor = rows[heights <= np.percentile(heights, 10.0) + band]
        floor = floor - floor.mean(axis=0)
        ground = floor[:, [0, 2]]
        held = (_FLAT / _LEAN) ** 2 * np.eye(2)
        slope = np.linalg.solve(ground.T @ ground / len(floor) + held, -ground.T @ floor[:, 1] / len(floor))
        normal = np.array([slope[0], 1.0, slope[1]])
        normal /= np.linalg.norm(normal)
    return normal


def _stretched(motion: Motion) -> Float[ndarray, "3"]:
    """The mean direction from the ankles to the neck, a unit vector, over the frames in which a body that is upright
    like the first pose is longest; Y, the first pose's own, where there is none."""
    points = motion.global_positions()
    body = points[:, _NECK] - points[:, _ANKLES].mean(axis=1)
    length = np.linalg.norm(body, axis=-1)
    upright = body[:, 1] > np.cos(_UPRIGHT) * length
    if not upright.any():
        return np.array([0.0, 1.0, 0.0])
    tall = upright & (length >= (1.0 - _TALLEST) * length[upright].max())
    mean = (body[tall] / length[tall, None]).mean(axis=0)
    return mean / np.linalg.norm(mean)


def _stood_up(motion: Motion, direction: Float[ndarray, "3"]) -> Motion:
    """The motion turned about the origin by the smallest rotation that brings ``direction`` to Y."""
    turn = rotation.between(direction, np.array([0.0, 1.0, 0.0]))
    local = motion.local_rotations.copy()
    local[:, 0] = rotation.multiply(turn, local[:, 0])
    return replace(motion, root_positions=rotation.rotate(turn, motion.root_positions), local_rotations=local)


def _path(
    steps: Float[ndarray, "frame 3"], turns: Float[ndarray, "frame 4"]
) -> tuple[Float[ndarray, "frame 3"], Float[ndarray, "frame 4"]]:
    """Where the root is and how it is turned, from its steps and turns in its own frame of the row before."""
    facing = np.empty_like(turns)
    before = facing[0] = turns[0]
    for frame in range(1, len(turns)):
        before = facing[frame] = rotation.multiply(before, turns[frame])
    ahead = np.concatenate([rotation.IDENTITY[None], facing[:-1]])
    place = np.cumsum(rotation.rotate(ahead, steps), axis=0)
    return place, facing / np.linalg.norm(facing, axis=-1, keepdims=True)


def _rows(data: bytes, name: str) -> Float[ndarray, "frame 99"]:
    """The numbers of the file, checked."""
    text = data.decode("utf-8-sig", errors="replace")
    lines = [(number, line) for number, line in enumerate(text.splitlines(), start=1) if line.strip()]
    if not lines:
        raise InputError(f"{name}: the file is empty")
    fields = [line.split(",") for _, line in lines]
    for (number, _), row in zip(lines, fields, strict=True):
        if len(row) != COLUMNS:
            raise InputError(
                f"{name} line {number}: {len(row)} fields with commas between them, expected the {COLUMNS} numbers of "
                "a Human3.6M exponential map"
            )
    try:
        rows = np.array(fields, dtype=float)
    except ValueError:
        bad = ((n, f) for (n, _), row in zip(lines, fields, strict=True) for f in row if not _is_number(f))
        number, field = next(bad, (lines[0][0], lines[0][1]))
        raise InputError(f"{name} line {number}: {field.strip()[:40]!r} is not a number") from None
    numbers = np.array([number for number, _ in lines])
    for bad, said in (
        (~np.isfinite(rows).all(axis=1), "holds nan or infinity, no number that a motion can have"),
        (np.abs(rows[:, 3:]).max(axis=1) > _WIDEST, "holds an angle of more than a thousand radians"),
        (
            np.linalg.norm(rows[:, :3], axis=1) * _MILLIMETRE > _LONGEST_STEP,
            f"moves the root by more than {_LONGEST_STEP:g} m",
        ),
        (np.linalg.norm(rows[:, 3:6], axis=1) > _WIDEST_STEP, f"turns the root by more than {_WIDEST_STEP:g} rad"),
    ):
        if bad.any():
            steps = "; columns 1 to 6 must be steps from row to row, as in h3.6m.zip" if "root" in said else ""
            raise InputError(f"{name} line {numbers[bad][0]}: {said}{steps}")
    return rows


def _is_number(field: str) -> bool:
    try:
        float(field)
    except ValueError:
        return False
    return True
