"""The methods that the studio offers, each with the model that ships for it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from interpose.demo import poses
from interpose.errors import InputError
from interpose.runtime.inbetween import inbetween, mapping_of, suggest
from interpose.runtime.methods import choose
from interpose.runtime.model_folder import Session
from interpose.runtime.request import Request
from interpose.studio.protocol import MethodInfo

Sessions = Mapping[str, Session]
"""The model of each trained method that there is."""
TRAINED = ("dcmoe", "stitch")


def load() -> Sessions:
    """The installed models; a method whose model is not there is left out."""
    found: dict[str, Session] = {}
    for method in TRAINED:
        try:
            model = choose(method, None)[1]
        except InputError:
            continue
        if model is not None:
            found[method] = model
    return MappingProxyType(found)


def offered(sessions: Sessions) -> list[MethodInfo]:
    """What the browser is told of them; interpolation is always among them."""
    infos = [
        MethodInfo(
            method="dcmoe" if method == "dcmoe" else "stitch",
            model=one.name,
            licence=str(one.info["licence"]),
            styles=list(one.styles),
            paths=True,
        )
        for method, one in sessions.items()
    ]
    return [*infos, MethodInfo(method="interp", model=None, licence=None, styles=[], paths=False)]


def session_of(sessions: Sessions, method: str) -> Session:
    """The model of a method. Raises InputError where there is none."""
    if method not in sessions:
        known = ", ".join([*sessions, "interp"])
        raise InputError(f"no model for method '{method}' is installed; choose one of {known}")
    return sessions[method]


def warm(sessions: Sessions) -> None:
    """Makes a short gap with each, so that the networks and galleries are loaded before somebody waits for them."""
    start, target = poses.pose(poses.WALK_LEFT), poses.pose(poses.WALK_RIGHT, (0.0, 1.5))
    mapping = mapping_of(start)
    for method, one in sessions.items():
        request = Request(method, one)
        inbetween(start, target, 30, request, mapping=mapping)
        if one.gallery is not None:
            suggest(start, target, request, mapping=mapping)
