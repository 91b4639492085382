"""Validation errors of pydantic as one sentence that begins with the place: ``keys[3].frame is missing``."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import ValidationError
from pydantic_core import ErrorDetails

_TAGS = {"generate", "cancel", "suggest", "paths", "mirror", "library", "auto", "waypoints", "straight", "none"}
"""Union tags, which pydantic puts into the location of an error."""


def first_error(error: ValidationError) -> str:
    """The first error; in a union of several types, the one deepest in the data."""
    found = error.errors(include_url=False, include_context=True)
    return _sentence(max(found, key=lambda one: len(_location(one["loc"]))) if _alternatives(found) else found[0])


def _alternatives(found: Sequence[ErrorDetails]) -> bool:
    """Whether the errors are those of the alternatives for one value."""
    return len(found) > 1 and all(one["loc"][:1] == found[0]["loc"][:1] for one in found)


def _sentence(one: ErrorDetails) -> str:
    place, kind, context = _path_text(_location(one["loc"])), one["type"], one.get("ctx", {})
    given = _shown(one["input"])
    match kind:
        case "json_invalid":
            return f"it is not valid JSON ({context.get('error', 'unreadable')})"
        case "missing":
            return f"{place} is missing"
        case "extra_forbidden":
            field = _path_text([*_location(one["loc"][:-1]), one["loc"][-1]])
            return f"{field} is not a known field; remove it"
        case "union_tag_not_found" | "union_tag_invalid":
            tag = str(context.get("discriminator", "type")).strip("'")
            wanted = str(context.get("expected_tags", "")).replace("'", "")
            where = f"{place}.{tag}" if one["loc"] else tag
            return f"{where} must be one of {wanted}" if wanted else f"{where} is missing"
        case "literal_error":
            return f"{place} is {given}; it must be {context.get('expected')}"
        case "greater_than_equal":
            return f"{place} is {given}; it must be {_number(context.get('ge'))} or more"
        case "less_than_equal":
            return f"{place} is {given}; it must be {_number(context.get('le'))} or less"
        case "less_than":
            return f"{place} is {given}; it must be less than {_number(context.get('lt'))}"
        case "too_long" | "string_too_long":
            return f"{place} is too long; the limit is {context.get('max_length')} entries or characters"
        case "too_short" | "string_too_short":
            return f"{place} is too short; it needs at least {context.get('min_length')} entries or characters"
        case "finite_number":
            return f"{place} is not finite; give a finite number"
    wanted = {
        "int_type": "a whole number",
        "int_from_float": "a whole number",
        "float_type": "a number",
        "string_type": "a string",
        "bool_type": "true or false",
        "list_type": "a list",
        "tuple_type": "a list",
        "dict_type": "an object",
        "model_type": "an object",
        "model_attributes_type": "an object",
    }.get(kind)
    if wanted is not None:
        return f"{place} is {given}; it must be {wanted}"
    return f"{place}: {one['msg'][:1].lower()}{one['msg'][1:]}"


def _location(parts: Sequence[int | str]) -> list[int | str]:
    """The place in the data, without union tags."""
    return [part for part in parts if isinstance(part, int) or (part not in _TAGS and part.isidentifier())]


def _path_text(parts: Sequence[int | str]) -> str:
    out = "".join(f"[{part}]" if isinstance(part, int) else f".{part[:60]}" for part in parts)
    return out.removeprefix(".") or "the value"


def _number(value: object) -> str:
    return f"{value:.0f}" if isinstance(value, float) and value.is_integer() else str(value)


def _shown(given: object) -> str:
    """The value, short enough for a sentence."""
    if isinstance(given, dict):
        return "an object"
    if isinstance(given, list | tuple):
        return f"a list of {len(given)}"
    if given is None or isinstance(given, bool):
        return {None: "null", True: "true", False: "false"}[given]
    text = repr(given) if isinstance(given, str) else str(given)
    return text if len(text) <= 40 else f"{text[:39]}…"
