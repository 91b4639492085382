"""Where the built front end is: in the package, or in a source checkout, where it is built when that is needed."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

from interpose.errors import InputError

PACKAGED = Path(__file__).resolve().parent / "page"
BUILDER = Path(__file__).resolve().parents[3] / "web" / "build.py"


def find(packaged: Path = PACKAGED, builder: Path = BUILDER) -> Path:
    """The folder of the built front end. In a source checkout `web/build.py` makes it from what is there now.

    Raises InputError where it cannot be built, or where there is neither it nor its sources.
    """
    if (packaged / "index.html").exists():
        return packaged
    if not builder.exists():
        raise InputError("the studio's front end is missing from this installation; install Interpose again")
    spec = importlib.util.spec_from_file_location("interpose_web_build", builder)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look themselves up there
    spec.loader.exec_module(module)
    try:
        return module.build()
    except module.Failed as error:
        raise InputError(f"the studio's front end could not be built: {error}") from None
    except OSError as error:
        raise InputError(f"the studio's front end could not be built: {error}") from None
