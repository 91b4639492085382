"""BVH files of synthetic motion, for the tests of `interpose prepare`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from interpose.skeleton import HUMANOID

BvhText = Callable[..., str]


def bvh_text(frames: int = 90, rate: float = 30.0, speed: float = 1.0, turn: float = 0.0, lift: float = 0.0) -> str:
    """The humanoid in centimetres, gliding forward at ``speed`` m/s, turning by ``turn`` rad/s, arms swinging."""
    lines = ["HIERARCHY"]

    def add(joint: int, depth: int) -> None:
        pad = "\t" * depth
        lines.append(f"{pad}{'ROOT' if joint == 0 else 'JOINT'} {HUMANOID.names[joint]}")
        lines.append(f"{pad}{{")
        lines.append(f"{pad}\tOFFSET " + " ".join(f"{100.0 * v:.6f}" for v in HUMANOID.offsets[joint]))
        position = "6 Xposition Yposition Zposition" if joint == 0 else "3"
        lines.append(f"{pad}\tCHANNELS {position} Zrotation Yrotation Xrotation")
        children = [child for child, parent in enumerate(HUMANOID.parents) if parent == joint]
        for child in children:
            add(child, depth + 1)
        if not children:
            lines.extend([f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET 0.0 5.0 0.0", f"{pad}\t}}"])
        lines.append(f"{pad}}}")

    add(0, 0)
    time = np.arange(frames) / rate
    yaw = turn * time
    angles = np.zeros((frames, len(HUMANOID), 3))
    angles[:, 0] = Rotation.from_rotvec(yaw[:, None] * [0.0, 1.0, 0.0]).as_euler("ZYX", degrees=True)
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        angles[:, HUMANOID.index(f"{side}Arm"), 0] = -sign * 70.0
        angles[:, HUMANOID.index(f"{side}ForeArm"), 1] = -sign * (20.0 + 10.0 * np.sin(4.0 * time))
    step = 100.0 * speed / rate * np.stack([np.sin(yaw), 0.0 * yaw, np.cos(yaw)], axis=-1)
    place = np.cumsum(step, axis=0) - step[0]
    place[:, 1] = 100.0 * (0.435 + 0.4237 + 0.0745 + 0.02 - 0.001 + lift)
    rows = np.concatenate([place, angles.reshape(frames, -1)], axis=-1)
    lines += ["MOTION", f"Frames: {frames}", f"Frame Time: {1.0 / rate:.6f}"]
    lines += [" ".join(f"{v:.6f}" for v in row) for row in rows]
    return "\n".join(lines) + "\n"


@pytest.fixture
def bvh() -> BvhText:
    return bvh_text


@pytest.fixture
def hundred_style(tmp_path: Path) -> Path:
    """Two styles of 100STYLE at 60 Hz, in a folder each; Angry_BW has no range."""
    folder = tmp_path / "100STYLE"
    for name in ("Angry_FW", "Angry_BW", "Neutral_FW"):
        file = folder / name.split("_")[0] / f"{name}.bvh"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(bvh_text(frames=200, rate=60.0))
    (folder / "Frame_Cuts.csv").write_text(
        "STYLE_NAME,BW_START,BW_STOP,FW_START,FW_STOP,TR1_START,TR1_STOP\n"
        "Angry,N/A,N/A,41,160,N/A,N/A\n"
        "Neutral,10,20,20,9999,N/A,N/A\n"
    )
    (folder / "Dataset_List.csv").write_text("Style Name,Description\nAngry,x\n")
    return folder
