"""Prints the JSON schema of the studio's protocol, from which `protocol.sh` makes TypeScript types."""

from __future__ import annotations

import json
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from interpose.studio.protocol import ClientMessage, Export, Opened, Refusal, Rig, ServerMessage


def schema() -> dict[str, Any]:
    """The JSON schema of all types of the protocol. Fields with a default count as required."""
    bodies = (Rig, Export, Refusal, Opened)
    unions = {"ClientMessage": _members(ClientMessage), "ServerMessage": _members(ServerMessage)}
    models = [model for group in (*unions.values(), bodies) for model in group]
    _, made = models_json_schema([(model, "serialization") for model in models], ref_template="#/$defs/{model}")
    definitions = _plain(made["$defs"])
    for name, members in unions.items():
        definitions[name] = {"anyOf": [{"$ref": f"#/$defs/{model.__name__}"} for model in members]}
    roots = (*unions, *(model.__name__ for model in bodies))
    return {
        "title": "Protocol",
        "description": "Everything that the studio's server and its browser send to each other.",
        "type": "object",
        "properties": {name: {"$ref": f"#/$defs/{name}"} for name in roots},
        "required": list(roots),
        "$defs": definitions,
    }


def _members(union: Any) -> tuple[type[BaseModel], ...]:
    """The models of an annotated union."""
    return get_args(get_args(union)[0])


def _plain(held: Any) -> Any:
    """A schema that json2ts understands: tuples as lists of items, no titles, no list lengths."""
    if isinstance(held, list):
        return [_plain(each) for each in held]
    if not isinstance(held, dict):
        return held
    tuple_ = held.get("prefixItems")
    dropped = {"prefixItems", *(() if tuple_ else ("minItems", "maxItems"))}
    if not isinstance(held.get("title"), dict):
        dropped.add("title")
    plain = {key: _plain(value) for key, value in held.items() if key not in dropped}
    if isinstance(held.get("properties"), dict):
        plain["required"] = list(held["properties"])
    return plain | ({"items": _plain(tuple_)} if tuple_ else {})


if __name__ == "__main__":
    print(json.dumps(schema(), indent=1))
