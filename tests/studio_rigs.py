"""What the studio's tests share: rigs as BVH files, envelopes, questions."""

from __future__ import annotations

import json
import struct
from functools import cache
from typing import Any

import numpy as np
from numpy import ndarray

from interpose import io
from interpose.demo import poses
from interpose.motion import Motion, concatenate
from interpose.skeleton import HUMANOID, Skeleton
from interpose.studio.messages import shapes
from interpose.studio.rigs import Clip, RigStore

PORT = 8360
HOST = {"host": f"127.0.0.1:{PORT}"}
OWN = {**HOST, "origin": f"http://127.0.0.1:{PORT}"}


def envelope(header: Any, *arrays: ndarray) -> bytes:
    """An envelope whose header is whatever is given: text, or what JSON makes of it."""
    text = (header if isinstance(header, str) else json.dumps(header)).encode()
    text += b" " * (-len(text) % 4)
    return b"".join([struct.pack("<I", len(text)), text, *(np.asarray(a, "<f4").tobytes() for a in arrays)])


def question(kind: str, rig: str, arrays: dict[str, ndarray] | None = None, **fields: Any) -> bytes:
    """A question of the websocket."""
    given = {} if arrays is None else arrays
    return envelope({"type": kind, "id": 1, "rig": rig, "arrays": shapes(given), **fields}, *given.values())


@cache
def walk() -> Motion:
    """Four poses of the 22 joints: standing, two steps, standing elsewhere; not to be changed."""
    return concatenate(
        poses.pose(poses.STAND),
        poses.pose(poses.WALK_LEFT, (0.0, 0.5)),
        poses.pose(poses.WALK_RIGHT, (0.1, 1.2), 10.0),
        poses.pose(poses.STAND, (0.2, 2.0), 20.0),
    )


def moved(motion: Motion) -> Motion:
    """The same with the places of joints animated: bones that grow a little, frame by frame."""
    frames, joints = len(motion), len(motion.skeleton)
    places = np.broadcast_to(motion.skeleton.offsets, (frames, joints, 3)).copy()
    places[:, 1:] *= 1.0 + 0.01 * np.arange(frames)[:, None, None]
    places[:, 0] = motion.root_positions
    return Motion(motion.skeleton, motion.root_positions, motion.local_rotations, motion.rate, places)


def no_humanoid() -> Motion:
    """A chain of three joints that swings."""
    skeleton = Skeleton(("a", "b", "c"), (-1, 0, 1), np.array([[0.0, 0, 0], [0.0, 1, 0], [0.0, 1, 0]]))
    turns = np.zeros((3, 3, 4))
    turns[..., 3] = 1.0
    turns[1, 1] = [0.6, 0.0, 0.0, 0.8]
    root = np.array([[0.0, 0.5, 0.0], [0.5, 0.5, 0.0], [1.0, 0.5, 0.0]])
    return Motion(skeleton, root, turns, 30.0)


def opened(motion: Motion, store: RigStore | None = None) -> Clip:
    """The clip that a browser gets by sending the motion as a BVH file."""
    return (RigStore() if store is None else store).open(io.serialize(motion, "clip.bvh"), "clip.bvh")


STAND = poses.pose(poses.STAND)
JOINTS = HUMANOID.names
