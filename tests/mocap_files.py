"""Files of AMASS and Human3.6M that the tests write themselves; Human3.6M with row vectors, as its own code does."""

from __future__ import annotations

from io import BytesIO
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.spatial.transform import Rotation

from interpose import rotation
from interpose.io import h36m
from interpose.motion import Motion

UPRIGHT = np.array([np.pi / 2.0, 0.0, 0.0])
"""The turn that stands the body models' T-pose, Y up, in AMASS's world, Z up; it then looks along AMASS's -Y."""


def amass_arrays(frames: int = 3, width: int = 156, **more: Any) -> dict[str, Any]:
    """What a file of SMPL-H holds: the T-pose, upright."""
    poses = np.zeros((frames, width))
    poses[:, :3] = UPRIGHT
    trans = np.tile([0.3, -0.2, 0.95], (frames, 1))
    rest = {"gender": np.array("female"), "betas": np.ones(16), "dmpls": np.zeros((frames, 8))}
    return {"poses": poses, "trans": trans, "mocap_framerate": np.array(120.0), **rest, **more}


def npz(content: dict[str, Any]) -> bytes:
    """The arrays that are not None as an archive."""
    out = BytesIO()
    np.savez(out, **{name: value for name, value in content.items() if value is not None})
    return out.getvalue()


PARENTS = [
    *(-1, 0, 1, 2, 3, 4, 0, 6, 7, 8, 9, 0, 11, 12, 13, 14),
    *(12, 16, 17, 18, 19, 20, 19, 22, 12, 24, 25, 26, 27, 28, 27, 30),
]
"""Of the 32 joints, as published."""

BODY = {
    "Hips": 0, "RightUpLeg": 1, "RightLeg": 2, "RightFoot": 3, "RightToeBase": 4, "LeftUpLeg": 6, "LeftLeg": 7,
    "LeftFoot": 8, "LeftToeBase": 9, "Spine": 11, "Spine1": 12, "Neck": 13, "Head": 14, "LeftShoulder": 16,
    "LeftArm": 17, "LeftForeArm": 18, "LeftHand": 19, "RightShoulder": 24, "RightArm": 25, "RightForeArm": 26,
    "RightHand": 27,
}  # fmt: skip
"""The joints that are used, among the 32."""

RESTS = {
    **{f"{side}Foot": ("x", 0.1) for side in ("Left", "Right")},
    **{f"{side}ToeBase": ("x", -0.25) for side in ("Left", "Right")},
    **{f"Left{part}": ("z", -np.pi / 2) for part in ("Shoulder", "Arm", "ForeArm", "Hand")},
    **{f"Right{part}": ("z", np.pi / 2) for part in ("Shoulder", "Arm", "ForeArm", "Hand")},
    "Neck": ("x", 0.7),
    "Head": ("x", -0.6),
}
"""How the joints of the file are turned, in the world, when the body stands in a T-pose."""


def rest(name: str) -> ndarray:
    """The matrix, for columns."""
    return Rotation.from_euler(*RESTS.get(name, ("x", 0.0))).as_matrix()


def exponential_maps(motion: Motion) -> ndarray:
    """A motion on the reader's skeleton as the 99 columns of a file; matrices multiply rows from the right here."""
    world = Rotation.from_quat(motion.global_rotations().reshape(-1, 4)).as_matrix()
    world = world.reshape(len(motion), len(BODY), 3, 3)
    of_file = {BODY[name]: np.swapaxes(world[:, j] @ rest(name), 1, 2) for j, name in enumerate(motion.skeleton.names)}
    rows = np.zeros((len(motion), 99))
    for joint, turned in of_file.items():
        before = np.swapaxes(of_file[PARENTS[joint]] if joint else np.concatenate([turned[:1], turned[:-1]]), 1, 2)
        rows[:, 3 + 3 * joint : 6 + 3 * joint] = Rotation.from_matrix(turned @ before).as_rotvec()
    step = np.diff(motion.root_positions, axis=0, prepend=motion.root_positions[:1])
    facing = np.concatenate([of_file[0][:1], of_file[0][:-1]])
    rows[:, :3] = 1000.0 * np.einsum("fi,fji->fj", step, facing)
    return rows


def h36m_text(rows: ndarray) -> bytes:
    """A file of those rows."""
    return "".join(",".join(f"{value:.7f}" for value in row) + "\n" for row in rows).encode()


def t_pose(frames: int = 5, **turned: tuple[str, float]) -> ndarray:
    """Rows of a body that stands in a T-pose, but in the last of them with joints of the file turned further: an axis
    of the joint's own, and an angle."""
    rows = exponential_maps(standing(frames))
    for name, (axis, angle) in turned.items():
        columns = slice(3 + 3 * BODY[name], 6 + 3 * BODY[name])
        before = Rotation.from_rotvec(-rows[-1, columns])
        rows[-1, columns] = -(before * Rotation.from_euler(axis, angle, degrees=True)).as_rotvec()
    return rows


def standing(frames: int) -> Motion:
    """A T-pose at the origin, 50 frames a second."""
    return Motion(h36m.H36M_SKELETON, np.zeros((frames, 3)), np.tile(rotation.IDENTITY, (frames, 21, 1)), 50.0)
