"""Reads project files and checks them against the source clip that they contain."""

from __future__ import annotations

import base64
import binascii
import re

import numpy as np
from numpy import ndarray
from pydantic import ValidationError

from interpose import parts
from interpose.errors import InputError
from interpose.runtime.backends.backend import backend_of
from interpose.studio import pose_rows
from interpose.studio.project_format import GapSettings, PointPath, Project, ProjectKey
from interpose.studio.rigs import Clip, RigStore
from interpose.studio.validation_messages import first_error

_OLD_KIND = re.compile(rb'("kind"\s*:\s*)"line"')
"""Files of earlier versions call waypoints a line. In text, quotes are escaped, so that it does not match."""


def read(data: bytes, store: RigStore, name: str = "the project") -> Project:
    """The project in a file's bytes; its source is added to the store.

    Raises InputError with the place in the file, as in "keys[3].frame is 10, not after 12 of the previous key".
    """
    try:
        project = Project.model_validate_json(_OLD_KIND.sub(rb'\1"waypoints"', data), strict=True)
    except ValidationError as error:
        raise InputError(f"{name} cannot be opened: {first_error(error)}") from None
    try:
        clip = store.open(project.source.text.encode(), project.source.name)
        _check(project, clip)
    except InputError as error:
        raise InputError(f"{name} cannot be opened: {error}") from None
    return project


def _check(project: Project, clip: Clip) -> None:
    if not project.keys:
        raise InputError("keys is empty; a project needs at least one key")
    seen: dict[str, int] = {}
    for i, key in enumerate(project.keys):
        place = f"keys[{i}]"
        if key.id in seen:
            raise InputError(f"{place}.id is also the id of keys[{seen[key.id]}]; ids must be unique")
        seen[key.id] = i
        before = project.keys[i - 1] if i else None
        if before is not None and key.frame <= before.frame:
            raise InputError(f"{place}.frame is {key.frame}, not after {before.frame} of the previous key")
        after = project.keys[i + 1] if i + 1 < len(project.keys) else None
        _check_key(key, after, clip, place)
        _check_gap(key.after, f"{place}.after")
        if key.after.method == "clip" and after is not None:
            _check_cut(key, after, place)


def _check_key(key: ProjectKey, after: ProjectKey | None, clip: Clip, place: str) -> None:
    count = len(clip.motion)
    if key.source is not None and key.source >= count:
        raise InputError(f"{place}.source is frame {key.source}, but the source has {count} frames, numbered from 0")
    if key.pose is None and key.source is None:
        raise InputError(f"{place} has neither a pose nor a source frame; give one of them")
    if key.pose is not None:
        pose = _decoded(key.pose, f"{place}.pose", clip)
        if len(pose) != 1:
            raise InputError(f"{place}.pose has {len(pose)} poses; a key has one")
        pose_rows.to_motion(pose, clip.motion, f"{place}.pose")
    if key.motion is None:
        return
    if after is None:
        raise InputError(f"{place}.motion has frames, but no gap follows the last key; remove it")
    motion, wanted = _decoded(key.motion, f"{place}.motion", clip), after.frame - key.frame - 1
    if len(motion) != wanted:
        raise InputError(f"{place}.motion has {len(motion)} frames, but the gap to the next key has {wanted}")
    if wanted:
        pose_rows.to_motion(motion, clip.motion, f"{place}.motion")


def _check_cut(key: ProjectKey, after: ProjectKey, place: str) -> None:
    """A gap that keeps the source's own frames must have as many as lie between its keys."""
    if key.source is None or after.source is None or after.source - key.source != after.frame - key.frame:
        raise InputError(
            f"{place}.after.method is clip, but this key and the next are not source frames at the same distance; "
            f"choose another method"
        )


def _check_gap(gap: GapSettings, place: str) -> None:
    for name, value, check in (("method", gap.method, backend_of), ("target_joints", gap.target_joints, parts.parse)):
        try:
            if value not in (None, "clip"):
                check(value)
        except InputError as error:
            raise InputError(f"{place}.{name}: {error}") from None
    if gap.blend is not None and gap.style is None:
        raise InputError(f"{place}.blend needs a style to blend with; give style too")
    if isinstance(gap.path, PointPath):
        for name, each in (("times", gap.path.times), ("facing", gap.path.facing)):
            if each is not None and len(each) != len(gap.path.points):
                raise InputError(f"{place}.path.{name} has {len(each)} entries for {len(gap.path.points)} points")


def _decoded(text: str, place: str, clip: Clip) -> ndarray:
    """Rows of floats from base64."""
    try:
        data = base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise InputError(f"{place} is not base64; save the project again") from None
    wide = pose_rows.width(clip.motion)
    if len(data) % (4 * wide):
        raise InputError(f"{place} has {len(data)} bytes, not a multiple of the {4 * wide} bytes of a pose")
    made = np.frombuffer(data, "<f4").reshape(-1, wide)
    if not np.isfinite(made).all():
        raise InputError(f"{place} contains NaN or infinite numbers")
    return made
