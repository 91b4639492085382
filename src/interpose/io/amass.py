"""Reading AMASS: motion capture as the pose parameters of a body model, `.npz` (Mahmood et al. 2019, `AMASS`).

    poses                     (frame, 156) SMPL-H, (frame, 165) SMPL-X or (frame, 72) SMPL: axis-angle, radians; the
                              first 22 joints are the same in all three, the others are hands and face
    root_orient, pose_body    (frame, 3), (frame, 63): the same 22 joints, where a file has them instead
    trans                     (frame, 3) metres, Z up
    mocap_framerate           frames a second; mocap_frame_rate in SMPL-X files
    surface_model_type        smplx, smplh or smpl, where a file says it

The bone lengths are in the body model, which has a licence of its own and is not used here; ``betas``, which mean
something to it alone, are not read. The poses go on a skeleton of our own in the same T-pose (all rotations zero: Y up,
facing +Z, left at +X, every joint's frame the body's), made as large as the performer by `interpose.io.grounding`.

The pelvis is not at ``trans``: it is off by a vector that the body model knows, two or three decimetres, mostly
sideways, the same in all frames of a clip. Sideways it does not matter, since a clip may be anywhere in the room; the
height comes from the lowest toe.
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
from interpose.io.layout import UnitLayout
from interpose.motion import Motion
from interpose.skeleton import Skeleton

WIDTHS = {156: "SMPL-H", 165: "SMPL-X", 72: "SMPL"}
"""Columns of ``poses`` of each body model."""

RATES = ("mocap_framerate", "mocap_frame_rate")

_MODELS = ("smpl", "smplh", "smplx")
_ORDER = """
    Pelvis L_Hip R_Hip Spine1 L_Knee R_Knee Spine2 L_Ankle R_Ankle Spine3 L_Foot R_Foot Neck L_Collar R_Collar Head
    L_Shoulder R_Shoulder L_Elbow R_Elbow L_Wrist R_Wrist
"""
_FARTHEST = 1e4  # metres from the origin
_WIDEST = 1e3  # radians


def _skeleton() -> Skeleton:
    # The order and the parents are SMPL's; the offsets are ours, of an adult of 1.7 m who stands with the feet apart.
    middle = [
        ("Pelvis", None, (0.0, 0.0, 0.0)),
        ("Spine1", "Pelvis", (0.0, 0.11, -0.02)),
        ("Spine2", "Spine1", (0.0, 0.13, 0.0)),
        ("Spine3", "Spine2", (0.0, 0.06, 0.01)),
        ("Neck", "Spine3", (0.0, 0.21, -0.03)),
        ("Head", "Neck", (0.0, 0.09, 0.04)),
    ]
    left = [
        ("L_Hip", "Pelvis", (0.07, -0.09, 0.0)),
        ("L_Knee", "L_Hip", (0.035, -0.39, 0.0)),
        ("L_Ankle", "L_Knee", (-0.015, -0.41, -0.03)),
        ("L_Foot", "L_Ankle", (0.025, -0.06, 0.12)),
        ("L_Collar", "Spine3", (0.08, 0.12, -0.02)),
        ("L_Shoulder", "L_Collar", (0.1, 0.04, -0.01)),
        ("L_Elbow", "L_Shoulder", (0.26, -0.015, -0.02)),
        ("L_Wrist", "L_Elbow", (0.25, 0.0, 0.0)),
    ]
    joints = {name: (parent, offset) for name, parent, offset in [*middle, *left]}
    for name, parent, (x, y, z) in left:
        joints["R" + name[1:]] = ("R" + parent[1:] if parent.startswith("L_") else parent, (-x, y, z))
    order = _ORDER.split()
    parents = [joints[name][0] for name in order]
    return Skeleton(
        tuple(order),
        tuple(-1 if parent is None else order.index(parent) for parent in parents),
        np.array([joints[name][1] for name in order]),
    )


SKELETON = _skeleton()
"""The first 22 joints of SMPL, SMPL-H and SMPL-X, in their order, with offsets of our own in their T-pose."""

TOES = (SKELETON.index("L_Foot"), SKELETON.index("R_Foot"))

_JOINTS = len(SKELETON)
_Z_UP = rotation.from_rotation_vector(np.array([-np.pi / 2.0, 0.0, 0.0]))  # turns AMASS's world into ours


def recognises(data: bytes) -> bool:
    """Whether the bytes are an archive with the pose parameters of a body model."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = {name.removesuffix(".npy") for name in archive.namelist()}
    except Exception:  # zipfile raises anything on damaged bytes
        return False
    return "poses" in names or names >= {"root_orient", "pose_body"}


def parse(data: bytes, name: str) -> Motion:
    """The motion in an AMASS file, on :data:`SKELETON` in the performer's size: metres, Y up, the floor at y = 0.

    ``name`` stands for the path in messages. Raises InputError for a file that holds no whole motion of a body. Pickled
    objects are never loaded.
    """
    if not data:
        raise InputError(f"{name}: the file is empty")
    turns, place, rate = _contents(data, name)
    turned = rotation.from_rotation_vector(turns)
    turned[:, 0] = rotation.multiply(_Z_UP, turned[:, 0])
    motion = Motion(SKELETON, rotation.rotate(_Z_UP, place), rotation.continuous(turned), rate, layout=UnitLayout(1.0))
    return grounding.grounded(motion, TOES)


def _contents(data: bytes, name: str) -> tuple[Float[ndarray, "frame 22 3"], Float[ndarray, "frame 3"], float]:
    """Axis times angle of the joints, ``trans``, and the frame rate."""
    content = _undamaged(name, lambda: np.load(io.BytesIO(data), allow_pickle=False))
    if not isinstance(content, np.lib.npyio.NpzFile):
        raise InputError(f"{name}: one array and no archive of several; give an .npz file of AMASS")
    with content:
        _check_model(content, name)
        turns = _turns(content, name)
        if "trans" not in content:
            raise InputError(f"{name}: holds no 'trans', the way of the root; it is not a whole file of AMASS")
        place = _array(content, "trans", name, _FARTHEST)
        if place.shape != (len(turns), 3):
            raise InputError(f"{name}: 'trans' is {place.shape}, expected {(len(turns), 3)}, a row for each of 'poses'")
        return turns, place, _rate(content, name)


def _turns(content: np.lib.npyio.NpzFile, name: str) -> Float[ndarray, "frame 22 3"]:
    """Axis times angle of the 22 joints."""
    if "poses" in content:
        poses = _array(content, "poses", name, _WIDEST)
        if poses.ndim != 2 or poses.shape[1] not in WIDTHS:
            known = ", ".join(f"{width} of {model}" for width, model in WIDTHS.items())
            raise InputError(
                f"{name}: 'poses' is {poses.shape}, expected a row a frame with the columns of a body: {known}"
            )
    elif "root_orient" in content and "pose_body" in content:
        parts = [_array(content, key, name, _WIDEST) for key in ("root_orient", "pose_body")]
        rows = parts[0].shape[:1]
        if [part.shape for part in parts] != [(*rows, 3), (*rows, 3 * (_JOINTS - 1))]:
            shapes = " and ".join(str(part.shape) for part in parts)
            raise InputError(
                f"{name}: 'root_orient' and 'pose_body' are {shapes}, expected 3 and 63 columns, a row a frame"
            )
        poses = np.concatenate(parts, axis=1)
    else:
        raise InputError(f"{name}: holds no 'poses', so no motion (a file of a body's shape, perhaps); leave it out")
    if not len(poses):
        raise InputError(f"{name}: 'poses' has no rows; leave it out")
    return poses[:, : 3 * _JOINTS].reshape(-1, _JOINTS, 3)


def _rate(content: np.lib.npyio.NpzFile, name: str) -> float:
    found = next((key for key in RATES if key in content), None)
    if found is None:
        raise InputError(f"{name}: says no frame rate; expected {' or '.join(RATES)}")
    value = _array(content, found, name, np.inf)
    rate = float(value.reshape(-1)[0]) if value.size == 1 else np.nan
    if not 1.0 <= rate <= 1000.0:
        said = f"{rate:g}" if value.size == 1 else f"{value.size} numbers"
        raise InputError(f"{name}: its frame rate '{found}' is {said}, expected one number from 1 to 1000")
    return rate


def _check_model(content: np.lib.npyio.NpzFile, name: str) -> None:
    """Raises InputError where the file says that it is of something else than a body: a hand, an animal, a thing."""
    if "surface_model_type" not in content:
        return
    try:
        said = _member(content, "surface_model_type", name).item()
    except (InputError, AttributeError, ValueError):  # pickled, or not one word: then the columns of the poses decide
        return
    said = said.decode(errors="replace") if isinstance(said, bytes) else str(said)
    if said.lower() not in _MODELS:
        raise InputError(
            f"{name}: is of the model {said[:40]!r}, expected a body's, {', '.join(_MODELS)}; leave it out"
        )


def _undamaged(what: str, load: Callable[[], Any]) -> Any:
    """What ``load`` gives. NumPy's readers raise anything on damaged bytes, and for pickled objects a ValueError."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return load()
    except Exception as error:
        if "allow_pickle=False" in str(error) and "Object arrays" in str(error):
            raise InputError(
                f"{what} holds pickled Python objects, which are never loaded; save it as an array of numbers"
            ) from None
        raise InputError(f"{what}: not an .npz file of AMASS, or damaged; download it again") from None


def _member(content: np.lib.npyio.NpzFile, key: str, name: str) -> Any:
    assert content.zip is not None
    stored = {entry.filename.removesuffix(".npy"): entry.file_size for entry in content.zip.infolist()}
    if stored.get(key, 0) > MAX_BYTES:
        raise InputError(f"{name}: '{key}' is larger than {MAX_BYTES / 2**20:.0f} MB, cut it into shorter clips")
    return _undamaged(f"{name}: '{key}'", lambda: content[key])


def _array(content: np.lib.npyio.NpzFile, key: str, name: str, most: float) -> Float[ndarray, "*shape"]:
    """An array of finite numbers of at most ``most``, in double precision."""
    values = _member(content, key, name)
    if not isinstance(values, ndarray) or not np.issubdtype(values.dtype, np.number) or np.iscomplexobj(values):
        raise InputError(f"{name}: '{key}' holds {getattr(values, 'dtype', 'bytes')}, expected real numbers")
    values = values.astype(float)
    bad = ~(np.abs(values) <= most) | ~np.isfinite(values)
    if bad.any():
        where = f" row {np.argwhere(bad)[0][0] + 1}" if values.ndim else ""
        raise InputError(f"{name}: '{key}'{where} holds {values[bad][0]:g}, no number that a motion can have")
    return values
