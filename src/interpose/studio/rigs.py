"""BVH files that the browser has opened, kept for as long as there is room, and what it is told of them."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from dataclasses import dataclass, field

import numpy as np
from numpy import ndarray

from interpose import io, retarget
from interpose.data.contacts import JOINTS, REST_HEIGHTS
from interpose.errors import InputError
from interpose.mannequin import figure
from interpose.motion import Motion
from interpose.rotation import rotate
from interpose.runtime.inbetween import mapping_of
from interpose.skeleton import HUMANOID
from interpose.studio import pose_rows
from interpose.studio.messages import shapes
from interpose.studio.protocol import Foot, Rig

ROOM = 512 * 1024 * 1024
"""Bytes of opened files that are kept at most, the newest in any case."""
MOST = 16
"""Files that are kept at most."""

_TOES = -HUMANOID.offsets[HUMANOID.index("LeftToe"), 1]  # the ankle's height over the toe joint of a flat foot
_FLAT = np.array([_TOES, 0.0, _TOES, 0.0])
_LEG = -HUMANOID.offsets[[HUMANOID.index("LeftLeg"), HUMANOID.index("LeftFoot")], 1].sum()


class Unknown(InputError):
    """The rig is not kept, or not any more; its file has to be sent again."""


@dataclass(frozen=True, eq=False)
class Clip:
    """An opened file. motion: with the layout to write more in. mapping: or in a phrase why it is no humanoid."""

    id: str
    motion: Motion
    mapping: retarget.Mapping | str

    @property
    def humanoid(self) -> retarget.Mapping:
        """The mapping. Raises InputError where there is none."""
        if isinstance(self.mapping, str):
            raise InputError(f"this rig is no humanoid: {self.mapping}")
        return self.mapping

    @property
    def size(self) -> int:
        """Bytes, about."""
        motion = self.motion
        arrays = [motion.root_positions, motion.local_rotations, motion.translations]
        layout = 0 if motion.layout is None else motion.layout.nbytes
        return layout + sum(array.nbytes for array in arrays if array is not None)


@dataclass
class Shelf:
    """Opened files by their id, those used last kept. Calls may come from several threads."""

    room: int = ROOM
    most: int = MOST
    _kept: OrderedDict[str, Clip] = field(default_factory=OrderedDict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def open(self, data: bytes, name: str) -> Clip:
        """The file with these bytes; parsed where it is not here yet. Raises InputError for a file that cannot be."""
        known = identity(data)
        try:
            return self.get(known)
        except Unknown:
            pass
        motion = io.parse(data, name)
        clip = Clip(known, motion, mapping_of(motion))
        with self._lock:
            self._kept[known] = clip
            while len(self._kept) > self.most or (self._size() > self.room and len(self._kept) > 1):
                self._kept.popitem(last=False)
        return clip

    def get(self, known: str) -> Clip:
        """Raises :class:`Unknown` where it is not here."""
        with self._lock:
            if known not in self._kept:
                raise Unknown("the server does not have this rig any more; open its file again")
            self._kept.move_to_end(known)
            return self._kept[known]

    def _size(self) -> int:
        return sum(one.size for one in self._kept.values())


def identity(data: bytes) -> str:
    """The id of a file's contents."""
    return hashlib.sha256(data).hexdigest()[:32]


def told(clip: Clip, name: str) -> tuple[Rig, dict[str, ndarray]]:
    """What the browser is told of a file, and its arrays."""
    motion, mapping = clip.motion, clip.mapping
    body = figure(motion)
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


def feet(mapping: retarget.Mapping) -> list[Foot]:
    """The joints of the feet, and how high each is when the foot is flat: as contacts are judged on the 22 joints, but
    for how the rig's own feet are built.
    """
    ankle = (_TOES - mapping.lift) / mapping.scale
    out = []
    for name, usual, flat in zip(JOINTS, REST_HEIGHTS, _FLAT, strict=True):
        joint = mapping.joints[HUMANOID.index(name)]
        if joint is None:
            continue
        height = ankle + (_drop(mapping, name, joint) if name.endswith("Toe") else 0.0)
        out.append(Foot(joint=joint, height=max(0.0, float(height + (usual - flat) / mapping.scale))))
    return out


def _drop(mapping: retarget.Mapping, toe: str, joint: int) -> float:
    """How far the toe joint of a flat foot lies above its ankle (it is negative), metres of the rig."""
    above = HUMANOID.index(toe.replace("Toe", "Foot"))
    bone = np.zeros(3)
    while joint not in (mapping.joints[above], -1):
        bone = bone + mapping.skeleton.offsets[joint]
        joint = mapping.skeleton.parents[joint]
    return float(rotate(mapping.rest_global[above], bone)[1])


def _size(motion: Motion, mapping: retarget.Mapping | str) -> float:
    """About the height of the hips; of a rig that is no humanoid, of its root above its lowest joint."""
    if isinstance(mapping, retarget.Mapping):
        return float((_TOES + _LEG - mapping.lift) / mapping.scale)
    some = motion[:: max(1, len(motion) // 50)].global_positions()
    high = float(np.median(some[:, 0, 1] - some[..., 1].min(axis=1)))
    reach = float(np.median(np.ptp(some, axis=1).max(axis=-1)))
    return max(high, 0.3 * reach, 1e-3)
