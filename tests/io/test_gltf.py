from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pygltflib
import pytest
from strategies import spider

from interpose import InputError, Motion, Skeleton, io, rotation
from interpose.io import gltf
from interpose.mannequin import mannequin
from interpose.skeleton import HUMANOID

TYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def some_motion(skeleton: Skeleton, frames: int, seed: int, moving: bool = False) -> Motion:
    rng = np.random.default_rng(seed)
    turned = rotation.from_rotation_vector(0.4 * rng.normal(size=(frames, len(skeleton), 3)))
    root = rng.normal(size=(frames, 3)) + np.array([0.0, 1.0, 0.0])
    translations = None
    if moving:
        translations = skeleton.offsets + 0.05 * rng.normal(size=(frames, len(skeleton), 3))
        translations[:, 0] = root
    return Motion(skeleton, root, turned, 30.0, translations)


def values(document: pygltflib.GLTF2, index: int) -> np.ndarray:
    accessor = document.accessors[index]
    view = document.bufferViews[accessor.bufferView]
    width = WIDTHS[accessor.type]
    blob = document.binary_blob()
    flat = np.frombuffer(blob, TYPES[accessor.componentType], accessor.count * width, view.byteOffset)
    return flat.reshape(accessor.count, width)


def node_matrices(document: pygltflib.GLTF2, frame: int) -> np.ndarray:
    """World matrices of all nodes in a frame of the animation, worked out from the file alone."""
    animation = document.animations[0]
    local = np.tile(np.eye(4), (len(document.nodes), 1, 1))
    for node, matrix in zip(document.nodes, local, strict=True):
        if node.rotation:
            matrix[:3, :3] = rotation.to_matrix(np.array(node.rotation))
            matrix[:3, 3] = node.translation
    for channel in animation.channels:
        value = values(document, animation.samplers[channel.sampler].output)[frame].astype(float)
        if channel.target.path == "rotation":
            local[channel.target.node, :3, :3] = rotation.to_matrix(value)
        else:
            local[channel.target.node, :3, 3] = value
    world = local.copy()
    for index, node in enumerate(document.nodes):  # parents come first in these files
        for child in node.children or []:
            world[child] = world[index] @ local[child]
    return world


def skinned(document: pygltflib.GLTF2, frame: int) -> np.ndarray:
    world = node_matrices(document, frame)
    binds = values(document, document.skins[0].inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    out = []
    for primitive in document.meshes[0].primitives:
        points = values(document, primitive.attributes.POSITION)
        bones = values(document, primitive.attributes.JOINTS_0)
        weights = values(document, primitive.attributes.WEIGHTS_0)
        np.testing.assert_allclose(weights.sum(axis=1), 1.0)
        matrices = np.einsum("vk,vkij->vij", weights, (world[document.skins[0].joints] @ binds)[bones])
        homogeneous = np.concatenate([points, np.ones((len(points), 1))], axis=1)
        out.append(np.einsum("vij,vj->vi", matrices, homogeneous)[:, :3])
    return np.concatenate(out)


@pytest.mark.parametrize("skeleton", [HUMANOID, spider()], ids=["humanoid", "spider"])
@pytest.mark.parametrize("moving", [False, True])
def test_a_viewer_shows_each_frame_as_the_package_poses_it(tmp_path: Path, skeleton: Skeleton, moving: bool) -> None:
    motion = some_motion(skeleton, 5, 1, moving)
    io.write(tmp_path / "out.glb", motion, name="walk")
    document = pygltflib.GLTF2().load(str(tmp_path / "out.glb"))
    assert document is not None
    assert [a.name for a in document.animations] == ["walk"]
    shape = mannequin(motion, 4)
    for frame in range(len(motion)):
        vertices, _ = shape.posed(motion.global_positions()[frame], motion.global_rotations()[frame])
        used = [np.unique(shape.triangles[shape.sides == side]) for side in gltf.MATERIALS]
        expected = vertices[np.concatenate(used)]
        np.testing.assert_allclose(skinned(document, frame), expected, atol=2e-5)


def test_times_and_quaternions_are_those_of_the_motion(tmp_path: Path) -> None:
    motion = some_motion(HUMANOID, 7, 3)
    io.write(tmp_path / "out.glb", motion)
    document = pygltflib.GLTF2().load(str(tmp_path / "out.glb"))
    assert document is not None
    animation = document.animations[0]
    sampler = animation.samplers[0]
    np.testing.assert_allclose(values(document, sampler.input)[:, 0], np.arange(7) / 30.0, rtol=1e-6)
    clock = document.accessors[sampler.input]
    np.testing.assert_allclose([*clock.min, *clock.max], [0.0, 6 / 30.0], rtol=1e-6)
    turned = np.stack([values(document, animation.samplers[0].output)])[0]
    np.testing.assert_allclose(
        rotation.angle(rotation.multiply(rotation.inverse(turned.astype(float)), motion.local_rotations[:, 0])),
        0.0,
        atol=1e-3,
    )
    assert np.all(np.sum(turned[1:] * turned[:-1], axis=1) >= 0)


def test_positions_lie_within_their_stated_bounds(tmp_path: Path) -> None:
    io.write(tmp_path / "out.glb", some_motion(spider(), 1, 4))
    document = pygltflib.GLTF2().load(str(tmp_path / "out.glb"))
    assert document is not None
    for primitive in document.meshes[0].primitives:
        accessor = document.accessors[primitive.attributes.POSITION]
        points = values(document, primitive.attributes.POSITION)
        np.testing.assert_array_equal(points.min(axis=0), np.float32(accessor.min))
        np.testing.assert_array_equal(points.max(axis=0), np.float32(accessor.max))


def test_what_cannot_be_written_is_refused_and_leaves_no_file(tmp_path: Path) -> None:
    motion = some_motion(HUMANOID, 2, 5)
    out = tmp_path / "out.glb"
    with pytest.raises(InputError, match="no frames"):
        io.write(out, motion[0:0])
    broken = some_motion(HUMANOID, 2, 5)
    broken.root_positions[1, 1] = np.nan
    with pytest.raises(InputError, match="not finite"):
        io.write(out, broken)
    with pytest.raises(InputError, match="does not exist"):
        io.write(tmp_path / "nowhere" / "out.glb", motion)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="session")
def validator(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with Khronos' gltf-validator and a script that prints a report a file."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("node and npm are not installed, so the Khronos glTF validator cannot run")
    folder = tmp_path_factory.mktemp("gltf-validator")
    command = ["npm", "install", "--no-audit", "--no-fund", "gltf-validator@2.0.0-dev.3.10"]
    try:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    except subprocess.TimeoutExpired:
        pytest.skip("npm could not fetch gltf-validator within two minutes")
    if done.returncode != 0:
        pytest.skip(f"npm could not fetch gltf-validator: {done.stderr.strip().splitlines()[-1:]}")
    (folder / "check.js").write_text(
        "const validator = require('gltf-validator'), fs = require('fs');\n"
        "validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])))\n"
        "  .then(report => console.log(JSON.stringify(report.issues)));\n"
    )
    return folder


@pytest.mark.parametrize(("frames", "moving"), [(1, False), (9, False), (9, True)])
@pytest.mark.parametrize("skeleton", [HUMANOID, spider()], ids=["humanoid", "spider"])
def test_the_khronos_validator_reports_nothing(
    validator: Path, tmp_path: Path, skeleton: Skeleton, frames: int, moving: bool
) -> None:
    io.write(tmp_path / "out.glb", some_motion(skeleton, frames, 6, moving))
    done = subprocess.run(
        ["node", "check.js", str(tmp_path / "out.glb")], cwd=validator, capture_output=True, text=True, check=True
    )
    issues = json.loads(done.stdout)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]
