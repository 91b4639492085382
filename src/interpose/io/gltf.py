"""Writes a motion as binary glTF 2.0 (.glb): a skinned mannequin with one animation.

The specification is Khronos glTF 2.0, sections 3.6 (buffers), 3.7.3 (skins) and 3.11 (animations). Joints are nodes
whose bind pose is the skeleton's rest pose, so an inverse bind matrix is a translation; every vertex belongs to one
joint. glTF's units and axes are those of this package: metres, Y up, quaternions (x, y, z, w).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pygltflib as gltf
from numpy import ndarray

from interpose import rotation
from interpose.errors import InputError
from interpose.mannequin import LEFT, MIDDLE, RIGHT, mannequin
from interpose.motion import Motion

MATERIALS = {
    MIDDLE: ("body", (0.62, 0.52, 0.40)),
    LEFT: ("left", (0.68, 0.50, 0.36)),
    RIGHT: ("right", (0.42, 0.44, 0.42)),
}
"""Name and linear base colour of each side of the mannequin."""

_DETAIL = 4
"""A quarter of the vertices around a limb."""


def serialize(motion: Motion, unchanged_rows: Mapping[int, int] | None = None, name: str = "motion") -> bytes:
    """A motion as the bytes of a .glb file; ``name`` is the animation's, ``unchanged_rows`` has no effect.

    The mannequin rests in the first pose. Raises InputError for a motion without frames or with values that are not
    finite.
    """
    if len(motion) == 0:
        raise InputError(f"motion {name!r} has no frames; glTF needs at least one")
    moved = motion.root_positions if motion.translations is None else motion.translations
    if not all(np.isfinite(x).all() for x in (motion.root_positions, motion.local_rotations, moved)):
        raise InputError(f"motion {name!r} holds values that are not finite; repair or cut them before writing")
    document = _Document()
    document.content.nodes = [*_nodes(motion), gltf.Node(name="Mannequin", mesh=0, skin=0)]
    document.content.scenes = [gltf.Scene(name="Scene", nodes=[0, len(motion.skeleton)])]
    document.content.scene = 0
    _add_mannequin(document, motion)
    _add_animation(document, name, motion)
    return document.finish()


@dataclass
class _Document:
    """A glTF document whose one buffer grows as arrays are added."""

    content: gltf.GLTF2 = field(
        default_factory=lambda: gltf.GLTF2(asset=gltf.Asset(version="2.0", generator="interpose"))
    )
    data: bytearray = field(default_factory=bytearray)

    def add(self, array: ndarray, kind: str, target: int | None = None, limits: bool = False) -> int:
        """Stores float32, uint8, uint16 or uint32 elements (row-major) and returns the accessor's index."""
        start, raw = len(self.data), np.ascontiguousarray(array).tobytes()
        self.data.extend(raw + b"\0" * (-len(raw) % 4))
        self.content.bufferViews.append(gltf.BufferView(buffer=0, byteOffset=start, byteLength=len(raw), target=target))
        rows = array.reshape(len(array), -1)
        self.content.accessors.append(
            gltf.Accessor(
                bufferView=len(self.content.bufferViews) - 1,
                byteOffset=0,
                componentType=_COMPONENTS[array.dtype.name],
                count=len(array),
                type=kind,
                min=rows.min(axis=0).tolist() if limits else None,
                max=rows.max(axis=0).tolist() if limits else None,
            )
        )
        return len(self.content.accessors) - 1

    def finish(self) -> bytes:
        self.content.buffers = [gltf.Buffer(byteLength=len(self.data))]
        self.content.set_binary_blob(bytes(self.data))
        return b"".join(self.content.save_to_bytes())


_COMPONENTS = {
    "float32": gltf.FLOAT,
    "uint8": gltf.UNSIGNED_BYTE,
    "uint16": gltf.UNSIGNED_SHORT,
    "uint32": gltf.UNSIGNED_INT,
}


def _unit(q: ndarray) -> ndarray:
    return (q / np.linalg.norm(q, axis=-1, keepdims=True)).astype(np.float32)


def _nodes(motion: Motion) -> list[gltf.Node]:
    """One node per joint, in the motion's first pose."""
    skeleton = motion.skeleton
    positions = skeleton.offsets.copy() if motion.translations is None else motion.translations[0].copy()
    positions[0] = motion.root_positions[0]
    rotations = _unit(motion.local_rotations[0])
    nodes = [
        gltf.Node(name=name, translation=position.tolist(), rotation=turn.tolist())
        for name, position, turn in zip(skeleton.names, positions.astype(np.float32), rotations, strict=True)
    ]
    for parent, node in enumerate(nodes):
        node.children = [joint for joint, p in enumerate(skeleton.parents) if p == parent]
    return nodes


def _add_mannequin(document: _Document, motion: Motion) -> None:
    """The mesh in the rest pose, one primitive per side of the body, and the skin that binds it to the joints."""
    shape, rest = mannequin(motion, _DETAIL), motion.skeleton.rest_positions()
    index = np.uint8 if len(rest) < 256 else np.uint16
    primitives = []
    for side, (name, colour) in MATERIALS.items():
        triangles = shape.triangles[shape.sides == side]
        if len(triangles) == 0:
            continue
        used, flat = np.unique(triangles, return_inverse=True)
        joints = shape.joints[used]
        bones, weights = np.zeros((len(used), 4), dtype=index), np.zeros((len(used), 4), dtype=np.float32)
        bones[:, 0], weights[:, 0] = joints, 1.0
        positions = (rest[joints] + shape.vertices[used]).astype(np.float32)
        corners = flat.astype(np.uint16 if len(used) < 65535 else np.uint32)
        primitives.append(
            gltf.Primitive(
                attributes=gltf.Attributes(
                    POSITION=document.add(positions, gltf.VEC3, gltf.ARRAY_BUFFER, limits=True),
                    NORMAL=document.add(_unit(shape.normals[used]), gltf.VEC3, gltf.ARRAY_BUFFER),
                    JOINTS_0=document.add(bones, gltf.VEC4, gltf.ARRAY_BUFFER),
                    WEIGHTS_0=document.add(weights, gltf.VEC4, gltf.ARRAY_BUFFER),
                ),
                indices=document.add(corners.reshape(-1), gltf.SCALAR, gltf.ELEMENT_ARRAY_BUFFER),
                material=len(document.content.materials),
            )
        )
        surface = gltf.PbrMetallicRoughness(baseColorFactor=[*colour, 1.0], metallicFactor=0.0, roughnessFactor=0.55)
        document.content.materials.append(gltf.Material(name=name, pbrMetallicRoughness=surface, alphaMode=gltf.OPAQUE))
    document.content.meshes = [gltf.Mesh(name="Mannequin", primitives=primitives)]
    binds = np.tile(np.eye(4, dtype=np.float32), (len(rest), 1, 1))
    binds[:, 3, :3] = -rest  # glTF stores matrices by columns: the last row here is the translation
    document.content.skins = [
        gltf.Skin(
            name="Mannequin",
            skeleton=0,
            joints=list(range(len(rest))),
            inverseBindMatrices=document.add(binds.reshape(-1, 16), gltf.MAT4),
        )
    ]


def _add_animation(document: _Document, name: str, motion: Motion) -> None:
    """Rotations of all joints and the root's translation; other translations where the motion animates them."""
    times = (np.arange(len(motion)) / motion.rate).astype(np.float32)
    clock = document.add(times, gltf.SCALAR, limits=True)
    animation = gltf.Animation(name=name, samplers=[], channels=[])

    def channel(joint: int, what: str, values: ndarray, kind: str) -> None:
        sampler = gltf.AnimationSampler(input=clock, output=document.add(values, kind), interpolation="LINEAR")
        target = gltf.AnimationChannelTarget(node=joint, path=what)
        animation.channels.append(gltf.AnimationChannel(sampler=len(animation.samplers), target=target))
        animation.samplers.append(sampler)

    rotations = _unit(rotation.continuous(motion.local_rotations))
    for joint in range(len(motion.skeleton)):
        channel(joint, "rotation", rotations[:, joint], gltf.VEC4)
        if joint == 0:
            channel(joint, "translation", motion.root_positions.astype(np.float32), gltf.VEC3)
        elif motion.translations is not None:
            channel(joint, "translation", motion.translations[:, joint].astype(np.float32), gltf.VEC3)
    document.content.animations.append(animation)
