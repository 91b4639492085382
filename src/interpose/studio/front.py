"""Finds the built front end: in the package, or in a source checkout, where it is built when needed."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from interpose.errors import InputError

PACKAGED = Path(__file__).resolve().parent / "page"
BUILDER = Path(__file__).resolve().parents[3] / "web" / "build.py"


def find(packaged: Path = PACKAGED, builder: Path = BUILDER) -> Path:
    """The folder of the built front end. In a source checkout, `web/build.py` brings it up to date.

    Raises InputError if it cannot be built, or if neither it nor its sources exist.
    """
    if (packaged / "index.html").exists():
        return packaged
    if not builder.exists():
        raise InputError("the studio's front end is missing from this installation; reinstall Interpose")
    spec = importlib.util.spec_from_file_location("interpose_web_build", builder)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look themselves up there
    spec.loader.exec_module(module)
    try:
        return module.build()
    except (module.Failed, OSError) as error:
        raise InputError(f"the studio's front end could not be built: {error}") from None
