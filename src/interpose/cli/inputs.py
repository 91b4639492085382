"""What commands take by name: poses of files, and galleries."""

from __future__ import annotations

from pathlib import Path

from interpose import io
from interpose import keys as key_text
from interpose.errors import InputError
from interpose.gallery import store
from interpose.gallery.store import Gallery
from interpose.motion import Motion


def pose(text: str, default: int) -> tuple[Motion, str, int]:
    """FILE or FILE:FRAME: the pose, its file and its frame. ``default`` is the frame where none is named."""
    name, frame = named_pose(text)
    clip = io.read(name)
    number = key_text.frame_in_clip(default if frame is None else frame, len(clip), name)
    return clip[number], name, number


def named_pose(text: str) -> tuple[str, int | None]:
    """The file and the frame, where one is named."""
    return (text, None) if Path(text).is_file() else key_text.parse_pose(text)


def gallery_of(name: str) -> Gallery:
    """A gallery's folder, a gallery.npz, or the gallery of a model by the model's name or folder."""
    from interpose.runtime import model_folder  # ONNX Runtime takes a while to import

    path = Path(name)
    if path.suffix == ".npz" or (path / store.META_FILE).exists():
        return store.load(path)
    try:
        found = model_folder.load(name).gallery
    except InputError:
        known = ", ".join(folder.name for folder in model_folder.installed()) or "none"
        raise InputError(
            f"{name} is no gallery and no model with one; give a folder of 'interpose gallery build', or one of {known}"
        ) from None
    if found is None:
        raise InputError(f"the model '{name}' has no gallery; make one with 'interpose gallery build'")
    return found
