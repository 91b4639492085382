"""A model driven by ONNX Runtime alone, as an engine would: docs/model-format.md in code, without this package.

    python examples/04_onnx_alone.py src/interpose/assets/models/default -o made.npz

From the T-pose to a T-pose two metres ahead, a quarter turned to the left. made.npz holds hips (frame, 3), global
rotations (frame, 22, 6) and contact probabilities (frame, 4).
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
import onnxruntime
from scipy.spatial.transform import Rotation, Slerp

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("folder", type=Path, help="a model's folder")
parser.add_argument("--frames", type=int, default=59, help="frames to make")
parser.add_argument("--style", help="one of the model's styles")
parser.add_argument("-o", "--out", default="made.npz")
given = parser.parse_args()

info = json.loads((given.folder / "model.json").read_text())
step = onnxruntime.InferenceSession(given.folder / "step.onnx", providers=["CPUExecutionProvider"])
parents, offsets = info["skeleton"]["parents"], np.array(info["skeleton"]["offsets"])


def pose(hips: np.ndarray, local: list[Rotation]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Hips, global rotations (22, 6), joint positions (22, 3) and facing (2,) of local rotations."""
    turned, places = [local[0]], [hips]
    for joint, parent in enumerate(parents[1:], start=1):
        turned.append(turned[parent] * local[joint])
        places.append(places[parent] + turned[parent].apply(offsets[joint]))
    m = np.stack([one.as_matrix() for one in turned])
    facing = np.array([m[0, 0, 2] - m[0, 2, 0], m[0, 0, 0] + m[0, 2, 2]])
    return hips, np.concatenate([m[:, :, 0], m[:, :, 1]], axis=1), np.stack(places), facing / np.linalg.norm(facing)


still = [Rotation.identity()] * len(parents)
ends = [np.array([0.0, 0.93, 0.0]), np.array([0.0, 0.93, 2.0])]
locals_ = [still, [Rotation.from_rotvec([0.0, np.pi / 2.0, 0.0]), *still[1:]]]
arcs = [Slerp([0.0, 1.0], Rotation.concatenate(pair)) for pair in zip(*locals_, strict=True)]
base = []
for part in np.linspace(0.0, 1.0, given.frames + 2):
    hips, rotations, _, _ = pose((1.0 - part) * ends[0] + part * ends[1], [arc(part) for arc in arcs])
    base.append(np.concatenate([hips, rotations.ravel()]))

hips, rotations, positions, facing = pose(ends[0], locals_[0])
target = pose(ends[1], locals_[1])
style = 0 if given.style is None else 1 + info["styles"].index(given.style)
style_weights = np.eye(len(info["styles"]) + 1)[style]
if "planner" in info and given.frames < 92:  # its prediction of the gap, added to interpolation at every frame
    plan = onnxruntime.InferenceSession(given.folder / "plan.onnx", providers=["CPUExecutionProvider"])
    known = {"steps": np.full(1, given.frames + 1), "style": style_weights, "path": np.zeros((8, 4))}
    known |= {"path_known": np.zeros(1), "noise": np.zeros(info["planner"]["latent"])}
    known |= {"frames": np.arange(given.frames + 2)}
    for end, key in (("start", (hips, rotations, positions)), ("target", target[:3])):
        known |= {f"{end}_{name}": value for name, value in zip(("hips", "rotations", "positions"), key, strict=True)}
        known |= {f"{end}_velocities": np.zeros((22, 3)), f"{end}_known": np.zeros(1)}
    added = plan.run(["added"], {name: np.float32(value)[None] for name, value in known.items()})[0][0]
    base = list(np.array(base) + added)

state = {
    "hips": hips,
    "rotations": rotations,
    "positions": positions,
    "velocities": np.zeros((22, 3)),
    "velocity_known": np.zeros(1),
    "track": np.tile([hips[0], hips[2], *facing], (32, 1)),
    "phase_past": np.zeros((31, 10, 2)),
    "phase_future": np.zeros((6, 10, 2)),
}
control = {
    "target_hips": target[0],
    "target_rotations": target[1],
    "target_positions": target[2],
    "style": style_weights,
    "path": np.tile([hips[0], hips[2], *facing, 0.0, 0.0], (6, 1)) if info.get("absolute") else np.zeros((6, 6)),
    "path_known": np.full(1, float(bool(info.get("absolute")))),
}
made: dict[str, list[np.ndarray]] = {"hips": [], "rotations": [], "contacts": []}
outputs = [output.name for output in step.get_outputs()]
for c in range(given.frames):
    moving = {"base": base[c], "base_next": base[c + 1], "frames_left": np.full(1, given.frames + 1 - c)}
    feed = {name: np.float32(value)[None] for name, value in (state | control | moving).items()}
    said = {name: value[0] for name, value in zip(outputs, step.run(None, feed), strict=True)}
    state = {name: said[f"next_{name}"] for name in state if name != "velocity_known"} | {"velocity_known": np.ones(1)}
    if info.get("absolute"):
        control["path"] = said["next_path"]
    for name, frames in made.items():
        frames.append(said["contacts"] if name == "contacts" else state[name])

np.savez(given.out, **{name: np.stack(frames) for name, frames in made.items()})
print(f"{given.out}: {given.frames} frames, from {ends[0]} to {made['hips'][-1].round(3)}, the target being {ends[1]}")
