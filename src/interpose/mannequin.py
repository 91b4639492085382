"""A mannequin for any skeleton: closed surfaces, each fixed to one joint, for pictures and for glTF.

A humanoid gets limbs, a torso, a head, hands and flat-soled feet, sized by its own bones; any other skeleton gets one
tapered capsule per bone, thicker where it carries more of the body. Surfaces are lofts: elliptical (or, for feet,
squarish) cross-sections along an axis, closed by a pole at each end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from interpose import rotation
from interpose.errors import InputError
from interpose.motion import Motion
from interpose.retarget import mapping
from interpose.skeleton import HUMANOID, Skeleton

MIDDLE, LEFT, RIGHT = 0, 1, 2
Radii = tuple[float, float] | float
"""Of a limb's end, across and in depth, metres; one number for both."""
_X, _Y, _Z = np.eye(3)


@dataclass(frozen=True)
class Mannequin:
    """Triangles fixed to the joints of a skeleton.

    vertices, normals: (vertex, 3) in the frame of their joint, metres and unit vectors. joints: (vertex,) that joint.
    triangles: (triangle, 3) vertex indices, counter-clockwise from outside.
    sides: (triangle,) MIDDLE, LEFT or RIGHT.
    """

    vertices: Float[ndarray, "vertex 3"]
    normals: Float[ndarray, "vertex 3"]
    joints: Int[ndarray, "vertex"]
    triangles: Int[ndarray, "triangle 3"]
    sides: Int[ndarray, "triangle"]

    def posed(
        self, positions: Float[ndarray, "joint 3"], rotations: Float[ndarray, "joint 4"]
    ) -> tuple[Float[ndarray, "vertex 3"], Float[ndarray, "vertex 3"]]:
        """Vertices and normals in the world, from global joint positions and global rotations."""
        turn = rotation.to_matrix(rotations)[self.joints]
        turned = np.einsum("vij,vj->vi", turn, self.vertices)
        return positions[self.joints] + turned, np.einsum("vij,vj->vi", turn, self.normals)


@dataclass(frozen=True)
class _Piece:
    joint: int
    side: int
    vertices: Float[ndarray, "vertex 3"]
    triangles: Int[ndarray, "triangle 3"]


def loft(
    centres: Float[ndarray, "ring 3"],
    across: Float[ndarray, "3"],
    up: Float[ndarray, "3"],
    half: Float[ndarray, "ring 2"],
    segments: int,
    roundness: float = 1.0,
) -> tuple[Float[ndarray, "vertex 3"], Int[ndarray, "triangle 3"]]:
    """A closed surface through cross-sections; the first and the last ring shrink to a point at their centres.

    ``half`` holds each ring's half-extents along ``across`` and ``up``; ``across x up`` must point from the first ring
    to the last. ``roundness`` 1 gives ellipses, towards 0 rectangles (superellipses).
    """
    angle = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    cos, sin = (np.sign(c) * np.abs(c) ** roundness for c in (np.cos(angle), np.sin(angle)))
    body = centres[1:-1]
    rings = (
        body[:, None]
        + (half[1:-1, :1, None] * cos[None, :, None]) * across
        + (half[1:-1, 1:, None] * sin[None, :, None]) * up
    )
    vertices = np.concatenate([rings.reshape(-1, 3), centres[:1], centres[-1:]])
    here = np.arange(rings[..., 0].size).reshape(-1, segments)
    after = np.roll(here, -1, axis=1)
    poles = np.broadcast_to([[here.size], [here.size + 1]], (2, segments))
    bottom, top = (poles[0], after[0], here[0]), (here[-1], after[-1], poles[1])
    lower, upper = (here[:-1], after[:-1], after[1:]), (here[:-1], after[1:], here[1:])
    sides = np.stack([np.stack(half, axis=-1) for half in (lower, upper)], axis=1)
    return vertices, np.concatenate([np.stack(bottom, axis=1), sides.reshape(-1, 3), np.stack(top, axis=1)])


def _capsule(
    a: ndarray, b: ndarray, ra: Sequence[float], rb: Sequence[float], across: ndarray, detail: int
) -> tuple[ndarray, ndarray]:
    """A tapered capsule from ``a`` to ``b``: radii (across, depth) at each end; the caps follow the depth."""
    axis, length = b - a, float(np.linalg.norm(b - a))
    axis = axis / length if length > 1e-9 else np.array([0.0, 1.0, 0.0])
    across = across - (across @ axis) * axis
    if np.linalg.norm(across) < 1e-3:
        other = _Z if abs(axis[2]) < 0.9 else _X
        across = other - (other @ axis) * axis
    across = across / np.linalg.norm(across)
    # Where the cone touches both end spheres, the surface normal is at this angle to the cross-section.
    lean = np.arcsin(np.clip((ra[1] - rb[1]) / max(length, 1e-9), -0.95, 0.95))
    first = np.linspace(-np.pi / 2, lean, detail + 1)
    last = np.linspace(lean, np.pi / 2, detail + 1)
    around = 2.0 * np.pi * max(max(ra), max(rb)) / (4 * detail)
    part = np.linspace(0.0, 1.0, int(length / (3.0 * around)) + 2)[1:-1]
    angles = np.concatenate([first, np.full(len(part), lean), last])
    share = np.concatenate([np.zeros(detail + 1), part, np.ones(detail + 1)])
    wide, depth = (ra[k] + (rb[k] - ra[k]) * share for k in range(2))
    along = length * share + depth * np.sin(angles)
    half = np.stack([wide, depth], axis=1) * np.cos(angles)[:, None]
    return loft(a + along[:, None] * axis, across, np.cross(axis, across), half, segments=4 * detail)


def mannequin(source: Skeleton | Motion, detail: int = 5) -> Mannequin:
    """The mannequin of a skeleton; ``detail`` is a quarter of the number of vertices around a limb.

    The frames of a motion help to recognise a humanoid whose rest pose is ambiguous.
    """
    skeleton = source.skeleton if isinstance(source, Motion) else source
    body = _humanoid(source)
    pieces = _creature(skeleton, detail) if body is None else _human(body, detail)
    starts = np.cumsum([0, *(len(p.vertices) for p in pieces)])
    vertices = np.concatenate([p.vertices for p in pieces])
    triangles = np.concatenate([p.triangles + start for p, start in zip(pieces, starts, strict=False)])
    corner = vertices[triangles]
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normals = np.zeros_like(vertices)  # of each vertex the mean over the triangles around it, by area
    for k in range(3):
        np.add.at(normals, triangles[:, k], area)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mannequin(
        vertices,
        normals,
        np.concatenate([np.full(len(p.vertices), p.joint) for p in pieces]),
        triangles,
        np.concatenate([np.full(len(p.triangles), p.side) for p in pieces]),
    )


def _side(name: str) -> int:
    low = name.lower().split(":")[-1]
    if low.startswith(("left", "l_")) or low.endswith(("_l", ".l", "-l", "left")):
        return LEFT
    if low.startswith(("right", "r_")) or low.endswith(("_r", ".r", "-r", "right")):
        return RIGHT
    return MIDDLE


def _creature(skeleton: Skeleton, detail: int) -> list[_Piece]:
    """One tapered capsule per bone, as thick as its own length and the total length of its descendants allow."""
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    lengths[0] = 0.0
    carried = lengths.copy()
    for joint in range(len(skeleton) - 1, 0, -1):
        carried[skeleton.parents[joint]] += carried[joint]
    total = max(float(carried[0]), 1e-6)
    radius = 0.035 * np.sqrt(total * carried) + 0.004 * total
    pieces = []
    for joint, parent in enumerate(skeleton.parents):
        if parent < 0 or lengths[joint] < 1e-4 * total:
            continue
        thick = min(radius[joint], 0.35 * lengths[joint])
        thin = 0.7 * thick
        shape = _capsule(np.zeros(3), skeleton.offsets[joint], (thick, thick), (thin, thin), _X, detail)
        pieces.append(_Piece(parent, _side(skeleton.names[joint]), *shape))
    if not pieces:
        r = 0.1
        pieces.append(_Piece(0, MIDDLE, *_capsule(np.zeros(3), np.zeros(3), (r, r), (r, r), _X, detail)))
    return pieces


@dataclass(frozen=True)
class _Humanoid:
    """The humanoid's joints on a skeleton, and the rotation from the T-pose's axes to the frame of each."""

    joints: dict[str, int]
    frames: dict[str, Float[ndarray, "4"]]
    rest: Float[ndarray, "joint 3"]

    def has(self, *names: str) -> bool:
        return all(name in self.joints for name in names)

    def reach(self, name: str, other: str) -> Float[ndarray, "3"]:
        """From joint ``name`` to joint ``other`` in the T-pose's axes (left X, up Y, forward Z)."""
        bone = self.rest[self.joints[other]] - self.rest[self.joints[name]]
        return rotation.rotate(rotation.inverse(self.frames[name]), bone)


def _humanoid(source: Skeleton | Motion) -> _Humanoid | None:
    """None where the skeleton is not a humanoid, or where much of it (more legs, a tail) has no counterpart in one."""
    try:
        found = mapping.map_skeleton(source)
    except InputError:
        return None
    if found.spare > mapping.MOST_SPARE:
        return None
    joints = {n: j for n, j in zip(HUMANOID.names, found.joints, strict=True) if j is not None}
    frames = dict(zip(HUMANOID.names, rotation.inverse(found.rest_global), strict=True))
    return _Humanoid(joints, frames, found.skeleton.rest_positions()) if "Head" in joints else None


def _human(body: _Humanoid, detail: int) -> list[_Piece]:
    """The sizes of an adult whose leg (hip to ankle) measures 0.86 m, scaled to this skeleton's leg."""
    leg = np.linalg.norm(body.reach("LeftUpLeg", "LeftLeg")) + np.linalg.norm(body.reach("LeftLeg", "LeftFoot"))
    s = float(leg) / 0.86
    pieces: list[_Piece] = []

    def add(name: str, side: int, shape: tuple[ndarray, ndarray]) -> None:
        turned = rotation.rotate(body.frames[name], shape[0])
        pieces.append(_Piece(body.joints[name], side, turned, shape[1]))

    def limb(name: str, side: int, a: ndarray, b: ndarray, ra: Radii, rb: Radii, across: ndarray = _X) -> None:
        first, last = (np.array(r if isinstance(r, tuple) else (r, r)) * s for r in (ra, rb))
        add(name, side, _capsule(a, b, first.tolist(), last.tolist(), across, detail))

    o = np.zeros(3)
    limb("Hips", MIDDLE, -0.030 * s * _Y, 0.055 * s * _Y, (0.166, 0.098), (0.140, 0.088))

    spine = [n for n in ("Hips", "Spine", "Spine1", "Spine2") if body.has(n)]
    stations = np.linspace(0.0, 1.0, len(spine))
    wide = np.interp(stations, [0.0, 0.4, 1.0], [0.142, 0.130, 0.152])
    deep = np.interp(stations, [0.0, 0.4, 1.0], [0.089, 0.085, 0.100])
    for k in range(len(spine) - 1):
        ends = (float(wide[k]), float(deep[k])), (float(wide[k + 1]), float(deep[k + 1]))
        limb(spine[k], MIDDLE, o, body.reach(spine[k], spine[k + 1]), *ends)
    chest, neck = spine[-1], "Neck" if body.has("Neck") else "Head"
    base = body.reach(chest, neck)
    limb(chest, MIDDLE, o, 0.52 * base, (0.152, 0.100), (0.168, 0.098))
    limb(chest, MIDDLE, 0.58 * base, 0.90 * base, (0.140, 0.078), (0.052, 0.050))
    if neck == "Neck":
        limb("Neck", MIDDLE, o, body.reach("Neck", "Head"), 0.046, 0.046)
    limb("Head", MIDDLE, s * (0.070 * _Y + 0.004 * _Z), s * (0.002 * _Y + 0.036 * _Z), (0.083, 0.102), (0.056, 0.058))
    limb("Head", MIDDLE, s * (0.050 * _Y + 0.093 * _Z), s * (0.026 * _Y + 0.106 * _Z), 0.009, 0.013)

    for side, prefix, sign in ((LEFT, "Left", 1.0), (RIGHT, "Right", -1.0)):
        up, knee, ankle, toe = (prefix + n for n in ("UpLeg", "Leg", "Foot", "Toe"))
        limb(up, side, o, body.reach(up, knee), 0.079, 0.054)
        shin = body.reach(knee, ankle)
        limb(knee, side, o, shin, 0.054, 0.036)
        limb(knee, side, 0.14 * shin - 0.014 * s * _Z, 0.46 * shin - 0.010 * s * _Z, 0.047, 0.038)
        ball = body.reach(ankle, toe) if body.has(toe) else s * np.array([0.0, -0.075, 0.155])
        add(ankle, side, _foot(ball, s, detail))
        if body.has(toe):
            add(toe, side, _toes(s, detail))
        shoulder, arm, fore, hand = (prefix + n for n in ("Shoulder", "Arm", "ForeArm", "Hand"))
        if not body.has(arm, fore, hand):
            continue
        limb(chest, side, 0.80 * base + 0.015 * s * _Z, body.reach(chest, arm) + 0.012 * s * _Y, 0.040, 0.034)
        if body.has(shoulder):
            limb(shoulder, side, o, body.reach(shoulder, arm), 0.050, 0.058)
        limb(arm, side, o, body.reach(arm, fore), 0.053, 0.040)
        limb(fore, side, o, body.reach(fore, hand), 0.041, 0.027)
        out = sign * s * _X
        limb(hand, side, 0.025 * out, 0.075 * out, (0.036, 0.019), (0.040, 0.017), _Z)
        limb(hand, side, 0.085 * out, 0.155 * out - 0.012 * s * _Y, (0.037, 0.014), (0.024, 0.009), _Z)
        limb(hand, side, 0.03 * out + 0.018 * s * _Z, 0.082 * out + s * (0.052 * _Z - 0.010 * _Y), 0.015, 0.011)
    return pieces


SOLE = 0.020
"""Metres from an adult's toe joint down to the sole."""


def _foot(ball: ndarray, s: float, detail: int) -> tuple[ndarray, ndarray]:
    """Heel to ball, with a flat sole; ``ball`` is the toe joint relative to the ankle."""
    sole, back, front = ball[1] - SOLE * s, -0.062 * s, ball[2] + 0.022 * s
    at = np.array([0.0, 0.0, 0.05, 0.16, 0.34, 0.62, 0.85, 0.96, 1.0, 1.0])
    wide = s * np.array([0.0, 0.018, 0.028, 0.034, 0.036, 0.042, 0.045, 0.043, 0.036, 0.0])
    ankle = 0.030 * s - sole
    tall = np.interp(at, [0.0, 0.05, 0.2, 0.36, 0.62, 1.0], [0.45, 0.66, 0.92, 0.96, 0.66, 0.40]) * ankle
    tall = np.where((wide == 0.0), 0.3 * tall, tall)
    return _sole(ball[0] * at, sole, back + (front - back) * at, wide, tall, detail)


def _toes(s: float, detail: int) -> tuple[ndarray, ndarray]:
    at = np.array([0.0, 0.0, 0.2, 0.5, 0.78, 0.94, 1.0, 1.0])
    wide = s * np.array([0.0, 0.040, 0.0445, 0.044, 0.038, 0.027, 0.015, 0.0])
    tall = s * np.array([0.02, 0.040, 0.042, 0.038, 0.031, 0.025, 0.018, 0.010])
    return _sole(np.zeros_like(at), -SOLE * s, s * (-0.012 + 0.088 * at), wide, tall, detail)


def _sole(x: ndarray, sole: float, z: ndarray, wide: ndarray, tall: ndarray, detail: int) -> tuple[ndarray, ndarray]:
    """A loft along Z on the plane y = ``sole``."""
    centres = np.stack([np.broadcast_to(x, z.shape), sole + tall / 2, z], axis=1)
    return loft(centres, _X, _Y, np.stack([wide, tall / 2], axis=1), 4 * detail, roundness=0.62)
