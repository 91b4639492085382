"""The protocol's one file, and what is made from it."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
import typing
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from interpose.studio import protocol
from interpose.studio.project_format import ProtocolModel

SCHEMA = Path(__file__).resolve().parents[2] / "web" / "protocol_schema.py"


schema = runpy.run_path(str(SCHEMA))["schema"]


def members(union: Any) -> set[str]:
    """The names of a union's models."""
    return {one.__name__ for one in typing.get_args(typing.get_args(union)[0])}


def models() -> list[type[BaseModel]]:
    return [
        one
        for one in vars(protocol).values()
        if isinstance(one, type) and issubclass(one, ProtocolModel) and one is not ProtocolModel
    ]


def test_the_schema_lists_all_messages() -> None:
    made = schema()
    for root, union in (("ClientMessage", protocol.ClientMessage), ("ServerMessage", protocol.ServerMessage)):
        listed = {one["$ref"].removeprefix("#/$defs/") for one in made["$defs"][root]["anyOf"]}
        assert listed == members(union)
        assert len(listed) >= 6
    assert set(made["required"]) == {"ClientMessage", "ServerMessage", "Rig", "Export", "Refusal", "Opened"}
    for name in made["properties"].values():
        assert name["$ref"].removeprefix("#/$defs/") in made["$defs"]


def test_every_part_is_in_the_schema_with_all_its_fields() -> None:
    made = schema()["$defs"]
    inner = {"ProtocolModel", "GapMessage"}  # what others are made from
    for one in models():
        if one.__name__ not in inner:
            assert set(made[one.__name__]["required"]) == set(one.model_fields), one.__name__
            assert made[one.__name__]["additionalProperties"] is False


def test_every_message_says_its_type_and_its_arrays() -> None:
    for union in (protocol.ClientMessage, protocol.ServerMessage):
        kinds = []
        for one in typing.get_args(typing.get_args(union)[0]):
            (kind,) = typing.get_args(typing.get_type_hints(one)["type"])
            kinds.append(kind)
            assert "arrays" in one.model_fields
        assert len(set(kinds)) == len(kinds)


def test_every_part_is_closed_and_does_not_change() -> None:
    for one in models():
        assert one.model_config["extra"] == "forbid"
        assert one.model_config["frozen"] is True


def test_the_schema_is_printed() -> None:
    done = subprocess.run([sys.executable, str(SCHEMA)], capture_output=True, text=True, check=True, timeout=60)
    assert json.loads(done.stdout) == schema()
