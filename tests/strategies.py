"""Hypothesis strategies for rotations, skeletons and motions, with the hard cases drawn often.

Rotations near the identity and near half a turn, where axes and logarithms lose digits, come up in most examples.
"""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy import ndarray

from interpose.motion import Motion
from interpose.skeleton import HUMANOID, Skeleton

NEAR = [0.0, 1e-300, 1e-12, 1e-8, 1e-4]
angles = st.one_of(
    st.sampled_from([*NEAR, *(np.pi - np.array(NEAR))]),
    st.floats(0.0, np.pi),
)
coordinates = st.floats(-10.0, 10.0, allow_subnormal=False)


@st.composite
def directions(draw: st.DrawFn) -> ndarray:
    """A unit vector, often along an axis."""
    if draw(st.booleans()):
        sign = draw(st.sampled_from([-1.0, 1.0]))
        return sign * np.eye(3)[draw(st.integers(0, 2))]
    azimuth, height = draw(st.floats(-np.pi, np.pi)), draw(st.floats(-1.0, 1.0))
    ring = np.sqrt(1.0 - height**2)
    return np.array([ring * np.cos(azimuth), height, ring * np.sin(azimuth)])


@st.composite
def quaternions(draw: st.DrawFn) -> ndarray:
    """A unit quaternion of either sign, (4,)."""
    half = draw(angles) / 2.0
    q = np.append(draw(directions()) * np.sin(half), np.cos(half))
    return draw(st.sampled_from([-1.0, 1.0])) * q / np.linalg.norm(q)


def vectors() -> st.SearchStrategy[ndarray]:
    """A vector, (3,), coordinates within ten."""
    return st.tuples(coordinates, coordinates, coordinates).map(np.array)


@st.composite
def batches(draw: st.DrawFn, items: st.SearchStrategy[ndarray]) -> ndarray:
    """A few items as one array of one or two leading axes."""
    shape = draw(st.sampled_from([(1,), (3,), (2, 2)]))
    count = int(np.prod(shape))
    values = draw(st.lists(items, min_size=count, max_size=count))
    return np.stack(values).reshape(*shape, *values[0].shape)


@st.composite
def skeletons(draw: st.DrawFn) -> Skeleton:
    """Any tree of one to six joints."""
    count = draw(st.integers(1, 6))
    parents = (-1, *(draw(st.integers(0, joint - 1)) for joint in range(1, count)))
    offsets = np.stack([draw(vectors()) for _ in range(count)])
    return Skeleton(tuple(f"joint {i}" for i in range(count)), parents, offsets)


@st.composite
def motions(draw: st.DrawFn, skeleton: st.SearchStrategy[Skeleton] | None = None) -> Motion:
    """One to five unrelated poses of ``skeleton``, or of any, then with or without animated joint positions."""
    body = draw(skeletons() if skeleton is None else skeleton)
    count, joints = draw(st.integers(1, 5)), len(body)
    turns = [draw(quaternions()) for _ in range(min(count * joints, 12))]
    order = (draw(st.integers(1, 11)) * np.arange(count * joints) % len(turns)).reshape(count, joints)
    root = np.stack([draw(vectors()) for _ in range(count)])
    moved = None
    if skeleton is None and draw(st.booleans()):
        moved = np.broadcast_to(body.offsets, (count, joints, 3)) + 0.1 * np.arange(count)[:, None, None]
        moved[:, 0] = root
    return Motion(body, root, np.stack(turns)[order], draw(st.sampled_from([24.0, 29.97, 30.0, 120.0])), moved)


def humanoid_motions() -> st.SearchStrategy[Motion]:
    """A motion of the 22 joints."""
    return motions(st.just(HUMANOID))


def spider() -> Skeleton:
    """A body with eight legs."""
    names, parents, offsets = ["body"], [-1], [(0.0, 0.0, 0.0)]
    for leg in range(8):
        angle = leg * np.pi / 4
        names += [f"hip{leg}", f"knee{leg}", f"tip{leg}"]
        parents += [0, len(names) - 3, len(names) - 2]
        out = np.array([np.cos(angle), 0.0, np.sin(angle)])
        offsets += [0.05 * out, 0.2 * out + [0.0, 0.1, 0.0], 0.2 * out - [0.0, 0.3, 0.0]]
    return Skeleton(tuple(names), tuple(parents), np.array(offsets))
