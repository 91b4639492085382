"""Interpose: motion in-betweening. Key poses in, finished motion out, exact at the keys, on your own rig.

>>> import interpose as ip
>>> clip = ip.read("walk.bvh")
>>> candidates = ip.load_model().inbetween(clip[0], clip[60], frames=59, variants=4, seed=1)
>>> ip.write("out.bvh", candidates[0].motion)
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING

from interpose.errors import InputError as InputError

# Before ONNX Runtime is imported: otherwise it writes a device id under the home folder and looks up a collector.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")

if TYPE_CHECKING:
    from interpose.io import read as read
    from interpose.io import write as write
    from interpose.motion import Motion as Motion
    from interpose.runtime.inbetween import Candidate as Candidate
    from interpose.runtime.model import Model as Model
    from interpose.runtime.model import load_model as load_model
    from interpose.skeleton import Skeleton as Skeleton

# Imported at first use, so that `interpose --help` and `import interpose` need not wait for SciPy and ONNX Runtime.
_HOMES = {
    "Candidate": "interpose.runtime.inbetween",
    "Model": "interpose.runtime.model",
    "Motion": "interpose.motion",
    "Skeleton": "interpose.skeleton",
    "load_model": "interpose.runtime.model",
    "read": "interpose.io",
    "write": "interpose.io",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'interpose' has no attribute '{name}'")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
