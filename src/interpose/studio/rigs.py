"""Stores the BVH files that the browser has opened, as long as there is room, and describes them to it."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
from numpy import ndarray

from interpose import io, retarget
from interpose.data.contacts import CONTACT_JOINTS, REST_HEIGHTS
from interpose.errors import InputError
from interpose.mannequin import mannequin
from interpose.motion import Motion
from interpose.rotation import rotate
from interpose.runtime.inbetween import mapping_of
from interpose.skeleton import HUMANOID
from interpose.studio import pose_rows
from interpose.studio.messages import shapes
from interpose.studio.protocol import FootJoint, Rig

RIG_BYTES = 512 * 1024 * 1024
"""Limit of the opened files in bytes; the newest is always kept."""
MOST_RIGS = 16
"""Most opened files."""

_TOES = -HUMANOID.offsets[HUMANOID.index("LeftToe"), 1]  # height of the ankle above the toe joint of a flat foot
_FLAT_FEET = np.array([_TOES, 0.0, _TOES, 0.0])
_LEG = -HUMANOID.offsets[[HUMANOID.index("LeftLeg"), HUMANOID.index("LeftFoot")], 1].sum()


class UnknownRig(InputError):
    """The rig is not in the store (any more); its file has to be sent again."""


@dataclass(frozen=True, eq=False)
class Clip:
    """An opened file. motion: with the file's layout. mapping: to the 22 joints, or why the rig is not a humanoid."""

    id: str
    motion: Motion
    mapping: retarget.Mapping | str

    @property
    def humanoid(self) -> retarget.Mapping:
        """The mapping. Raises InputError if there is none."""
        if isinstance(self.mapping, str):
            raise InputError(f"this rig is not a humanoid: {self.mapping}")
        return self.mapping

    @property
    def size(self) -> int:
        """Approximate size in bytes."""
        motion = self.motion
        arrays = [motion.root_positions, motion.local_rotations, motion.translations]
        layout = 0 if motion.layout is None else motion.layout.nbytes
        return layout + sum(array.nbytes for array in arrays if array is not None)


@dataclass
class RigStore:
    """Opened files by their id; drops the least recently used. Safe to call from several threads."""

    room: int = RIG_BYTES
    most: int = MOST_RIGS
    _kept: OrderedDict[str, Clip] = field(default_factory=OrderedDict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def open(self, data: bytes, name: str) -> Clip:
        """The file with these bytes, parsed if it is new. Raises InputError if it cannot be parsed."""
        id = identity(data)
        with suppress(UnknownRig):
            return self.get(id)
        motion = io.parse(data, name)
        clip = Clip(id, motion, mapping_of(motion))
        with self._lock:
            self._kept[id] = clip
            while len(self._kept) > self.most or (self._size() > self.room and len(self._kept) > 1):
                self._kept.popitem(last=False)
        return clip

    def get(self, id: str) -> Clip:
        """The file with this id. Raises :class:`UnknownRig` if it is not stored."""
        with self._lock:
            if id not in self._kept:
                raise UnknownRig("the server no longer has this rig; open its file again")
            self._kept.move_to_end(id)
            return self._kept[id]

    def _size(self) -> int:
        return sum(one.size for one in self._kept.values())


def identity(data: bytes) -> str:
    """The id of a file, a hash of its contents."""
    return hashlib.sha256(data).hexdigest()[:32]


def describe(clip: Clip, name: str) -> tuple[Rig, dict[str, ndarray]]:
    """The description of a file for the browser, and its arrays."""
    motion, mapping = clip.motion, clip.mapping
    body = mannequin(motion)
    arrays: dict[str, ndarray] = {
        "offsets": motion.skeleton.offsets,
        "frames": pose_rows.of_motion(motion),
        "vertices": body.vertices,
        "normals": body.normals,
        "carriers": body.joints,
        "triangles": body.triangles,
        "sides": body.sides,
    }
    known = isinstance(mapping, retarget.Mapping)
    joints = mapping.joints if known else ()
    answer = Rig(
        id=clip.id,
        name=name,
        rate=motion.rate,
        joints=list(motion.skeleton.names),
        parents=list(motion.skeleton.parents),
        moved=motion.translations is not None,
        profile=mapping.profile if known else None,
        reason=None if known else mapping,
        humanoid={ours: j for ours, j in zip(HUMANOID.names, joints, strict=bool(joints)) if j is not None},
        feet=feet(mapping) if known else [],
        size=_size(motion, mapping),
        arrays=shapes(arrays),
    )
    return answer, arrays


def feet(mapping: retarget.Mapping) -> list[FootJoint]:
    """The joints of the feet with their heights when the foot is flat: those of the 22 joints, adapted to the
    proportions of the rig's own feet.
    """
    ankle = (_TOES - mapping.lift) / mapping.scale
    out = []
    for name, usual, flat in zip(CONTACT_JOINTS, REST_HEIGHTS, _FLAT_FEET, strict=True):
        joint = mapping.joints[HUMANOID.index(name)]
        if joint is None:
            continue
        height = ankle + (_drop(mapping, name, joint) if name.endswith("Toe") else 0.0)
        out.append(FootJoint(joint=joint, height=max(0.0, float(height + (usual - flat) / mapping.scale))))
    return out


def _drop(mapping: retarget.Mapping, toe: str, joint: int) -> float:
    """Height of the toe joint of a flat foot above its ankle (negative), in metres of the rig."""
    above = HUMANOID.index(toe.replace("Toe", "Foot"))
    bone = np.zeros(3)
    while joint not in (mapping.joints[above], -1):
        bone = bone + mapping.skeleton.offsets[joint]
        joint = mapping.skeleton.parents[joint]
    return float(rotate(mapping.rest_global[above], bone)[1])


def _size(motion: Motion, mapping: retarget.Mapping | str) -> float:
    """Roughly the height of the hips; if the rig is not a humanoid, of its root above the lowest joint."""
    if isinstance(mapping, retarget.Mapping):
        return float((_TOES + _LEG - mapping.lift) / mapping.scale)
    some = motion[:: max(1, len(motion) // 50)].global_positions()
    high = float(np.median(some[:, 0, 1] - some[..., 1].min(axis=1)))
    reach = float(np.median(np.ptp(some, axis=1).max(axis=-1)))
    return max(high, 0.3 * reach, 1e-3)
