"""Reads AMASS: motion capture as pose parameters of a body model, `.npz` (Mahmood et al. 2019, `AMASS`).

    poses                     (frame, 156) SMPL-H, (frame, 165) SMPL-X or (frame, 72) SMPL: axis-angle, radians; all
                              three start with the same 22 joints, the rest are hands and face
    root_orient, pose_body    (frame, 3), (frame, 63): the same 22 joints, in files that split them
    trans                     (frame, 3) metres, Z up
    mocap_framerate           frames a second; mocap_frame_rate in SMPL-X files
    surface_model_type        smplx, smplh or smpl; optional

The body model, which has its own licence, is not used, so ``betas`` are not read. The poses go on our own skeleton in
the same T-pose (Y up, facing +Z, left at +X, joint frames parallel to the world's); `interpose.io.grounding` scales it.
``trans`` is not the pelvis: the body model adds two or three decimetres, mostly sideways and constant within a clip.
The sideways part does not matter; the height is found from the lowest toe.
"""

from __future__ import annotations

import io
import warnings
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose import rotation
from interpose.errors import InputError
from interpose.io import grounding
from interpose.io.files import MAX_BYTES
from interpose.motion import Motion

_POSE_COLUMNS = {156: "SMPL-H", 165: "SMPL-X", 72: "SMPL"}
_RATE_KEYS = ("mocap_framerate", "mocap_frame_rate")
_BODY_MODELS = ("smpl", "smplh", "smplx")
_LARGEST_DISTANCE = 1e4  # metres from the origin
_LARGEST_ANGLE = 1e3  # radians


SMPL_SKELETON = grounding.skeleton_of(
    [
        ("Pelvis", None, (0.0, 0.0, 0.0)),
        ("L_Hip", "Pelvis", (0.07, -0.09, 0.0)),
        ("R_Hip", "Pelvis", (-0.07, -0.09, 0.0)),
        ("Spine1", "Pelvis", (0.0, 0.11, -0.02)),
        ("L_Knee", "L_Hip", (0.035, -0.39, 0.0)),
        ("R_Knee", "R_Hip", (-0.035, -0.39, 0.0)),
        ("Spine2", "Spine1", (0.0, 0.13, 0.0)),
        ("L_Ankle", "L_Knee", (-0.015, -0.41, -0.03)),
        ("R_Ankle", "R_Knee", (0.015, -0.41, -0.03)),
        ("Spine3", "Spine2", (0.0, 0.06, 0.01)),
        ("L_Foot", "L_Ankle", (0.025, -0.06, 0.12)),
        ("R_Foot", "R_Ankle", (-0.025, -0.06, 0.12)),
        ("Neck", "Spine3", (0.0, 0.21, -0.03)),
        ("L_Collar", "Spine3", (0.08, 0.12, -0.02)),
        ("R_Collar", "Spine3", (-0.08, 0.12, -0.02)),
        ("Head", "Neck", (0.0, 0.09, 0.04)),
        ("L_Shoulder", "L_Collar", (0.1, 0.04, -0.01)),
        ("R_Shoulder", "R_Collar", (-0.1, 0.04, -0.01)),
        ("L_Elbow", "L_Shoulder", (0.26, -0.015, -0.02)),
        ("R_Elbow", "R_Shoulder", (-0.26, -0.015, -0.02)),
        ("L_Wrist", "L_Elbow", (0.25, 0.0, 0.0)),
        ("R_Wrist", "R_Elbow", (-0.25, 0.0, 0.0)),
    ]
)
"""The first 22 joints of SMPL, SMPL-H and SMPL-X, in their order, in their T-pose. The offsets are our own: of an adult
1.7 m tall who stands with the feet apart."""

_TOES = (SMPL_SKELETON.index("L_Foot"), SMPL_SKELETON.index("R_Foot"))
_Y_UP_FROM_Z_UP = rotation.from_rotation_vector(np.array([-np.pi / 2.0, 0.0, 0.0]))


def recognises(data: bytes) -> bool:
    """Whether the bytes are an archive with the pose parameters of a body model."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = {name.removesuffix(".npy") for name in archive.namelist()}
    except Exception:  # zipfile raises anything on damaged bytes
        return False
    return "poses" in names or names >= {"root_orient", "pose_body"}


def parse(data: bytes, name: str) -> Motion:
    """The motion in an AMASS file, on :data:`SMPL_SKELETON` in the performer's size: metres, Y up, floor at y = 0.

    ``name`` stands for the path in messages. Raises InputError for a file without a complete motion of a body. Pickled
    objects are never loaded.
    """
    if not data:
        raise InputError(f"{name}: the file is empty")
    archive = _load(name, lambda: np.load(io.BytesIO(data), allow_pickle=False))
    if not isinstance(archive, np.lib.npyio.NpzFile):
        raise InputError(f"{name}: a single array; give an AMASS .npz archive")
    with archive:
        _check_model(archive, name)
        vectors = _rotation_vectors(archive, name)
        if "trans" not in archive:
            raise InputError(f"{name}: has no 'trans', the root translation; give a complete AMASS file")
        root = _array(archive, "trans", name, _LARGEST_DISTANCE)
        if root.shape != (len(vectors), 3):
            raise InputError(f"{name}: 'trans' is {root.shape}, expected {(len(vectors), 3)}, a row per row of 'poses'")
        rate = _rate(archive, name)
    local = rotation.from_rotation_vector(vectors)
    local[:, 0] = rotation.multiply(_Y_UP_FROM_Z_UP, local[:, 0])
    root = rotation.rotate(_Y_UP_FROM_Z_UP, root)
    motion = Motion(SMPL_SKELETON, root, rotation.continuous(local), rate, layout=grounding.UnitLayout(1.0))
    return grounding.grounded(motion, _TOES)


def _rotation_vectors(archive: np.lib.npyio.NpzFile, name: str) -> Float[ndarray, "frame 22 3"]:
    joints = len(SMPL_SKELETON)
    if "poses" in archive:
        poses = _array(archive, "poses", name, _LARGEST_ANGLE)
        if poses.ndim != 2 or poses.shape[1] not in _POSE_COLUMNS:
            known = ", ".join(f"{columns} ({model})" for columns, model in _POSE_COLUMNS.items())
            raise InputError(f"{name}: 'poses' is {poses.shape}, expected one row per frame with {known} columns")
    elif "root_orient" in archive and "pose_body" in archive:
        parts = [_array(archive, key, name, _LARGEST_ANGLE) for key in ("root_orient", "pose_body")]
        rows = parts[0].shape[:1]
        if [part.shape for part in parts] != [(*rows, 3), (*rows, 3 * (joints - 1))]:
            shapes = " and ".join(str(part.shape) for part in parts)
            raise InputError(f"{name}: 'root_orient' and 'pose_body' are {shapes}, expected 3 and 63 columns per frame")
        poses = np.concatenate(parts, axis=1)
    else:
        raise InputError(f"{name}: has no 'poses', so no motion (perhaps a body shape file); leave it out")
    if not len(poses):
        raise InputError(f"{name}: 'poses' has no rows; leave it out")
    return poses[:, : 3 * joints].reshape(-1, joints, 3)


def _rate(archive: np.lib.npyio.NpzFile, name: str) -> float:
    key = next((key for key in _RATE_KEYS if key in archive), None)
    if key is None:
        raise InputError(f"{name}: has no frame rate; expected {' or '.join(_RATE_KEYS)}")
    value = _array(archive, key, name, np.inf)
    rate = float(value.reshape(-1)[0]) if value.size == 1 else np.nan
    if not 1.0 <= rate <= 1000.0:
        found = f"{rate:g}" if value.size == 1 else f"{value.size} numbers"
        raise InputError(f"{name}: its frame rate '{key}' is {found}, expected one number from 1 to 1000")
    return rate


def _check_model(archive: np.lib.npyio.NpzFile, name: str) -> None:
    """Raises InputError for a file that names something else than a body model: a hand, an animal, an object."""
    if "surface_model_type" not in archive:
        return
    try:
        model = _member(archive, "surface_model_type", name).item()
    except (InputError, AttributeError, ValueError):  # pickled, or not one string: the columns of the poses decide
        return
    model = model.decode(errors="replace") if isinstance(model, bytes) else str(model)
    if model.lower() not in _BODY_MODELS:
        raise InputError(
            f"{name}: is of the model {model[:40]!r}, expected a body model ({', '.join(_BODY_MODELS)}); leave it out"
        )


def _load(what: str, load: Callable[[], Any]) -> Any:
    """The result of ``load``. NumPy raises anything on damaged bytes, and a ValueError for pickled objects."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return load()
    except Exception as error:
        if "allow_pickle=False" in str(error) and "Object arrays" in str(error):
            raise InputError(
                f"{what} holds pickled Python objects, which are never loaded; save it as an array of numbers"
            ) from None
        raise InputError(f"{what}: not an AMASS .npz file, or damaged; download it again") from None


def _member(archive: np.lib.npyio.NpzFile, key: str, name: str) -> Any:
    assert archive.zip is not None
    sizes = {entry.filename.removesuffix(".npy"): entry.file_size for entry in archive.zip.infolist()}
    if sizes.get(key, 0) > MAX_BYTES:
        raise InputError(f"{name}: '{key}' is larger than {MAX_BYTES / 2**20:.0f} MB; cut it into shorter clips")
    return _load(f"{name}: '{key}'", lambda: archive[key])


def _array(archive: np.lib.npyio.NpzFile, key: str, name: str, largest: float) -> Float[ndarray, "*shape"]:
    """An array of finite numbers up to ``largest``, in double precision."""
    values = _member(archive, key, name)
    if not isinstance(values, ndarray) or not np.issubdtype(values.dtype, np.number) or np.iscomplexobj(values):
        raise InputError(f"{name}: '{key}' holds {getattr(values, 'dtype', 'bytes')}, expected real numbers")
    values = values.astype(float)
    bad = ~(np.abs(values) <= largest) | ~np.isfinite(values)
    if bad.any():
        where = f" row {np.argwhere(bad)[0][0] + 1}" if values.ndim else ""
        raise InputError(f"{name}: '{key}'{where} holds {values[bad][0]:g}, not a possible value")
    return values
