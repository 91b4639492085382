"""The methods by name: where the backend of each is. Nothing is imported here, so that help texts come at once."""

from __future__ import annotations

BACKENDS = {
    "dcmoe": "interpose.runtime.backends.dcmoe:BACKEND",
    "stitch": "interpose.runtime.backends.stitch:BACKEND",
    "stitch+detail": "interpose.runtime.backends.stitch:REFINED",
    "plan": "interpose.runtime.backends.plan:BACKEND",
    "interp": "interpose.runtime.backends.interp:BACKEND",
}
"""Name to `module:object`, the default method first. Commands, the studio, `interpose models` and the evaluation take
their lists from here, and what a method can do from :meth:`~interpose.runtime.backends.backend.Backend.abilities`."""
DEFAULT_METHOD = next(iter(BACKENDS))
