"""Configs of trainings: frozen dataclasses of plain values, their presets, and the same from and to JSON."""

from __future__ import annotations

import json
import sys
import types
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

from interpose.errors import InputError

C = TypeVar("C")
FROM_DATA = ("databases", "styles", "licence")
"""Fields that a training takes from its databases, whatever a file says."""


@dataclass(frozen=True)
class TrainingConfig:
    """What every training decides, saved beside its weights; a recipe's own config adds its settings."""

    preset: str = "full"
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    warmup: int = 500
    average: float = 0.999
    """decay of the moving average of the weights"""
    clip: float = 1.0
    half: bool = True
    """bfloat16 products: faster on a GPU, slower on a CPU without AMX"""
    seed: int = 0
    databases: tuple[str, ...] = ()
    styles: tuple[str, ...] = ()
    licence: str = ""


def to_plain(config: Any) -> dict[str, Any]:
    """A config as JSON would give it back."""
    return json.loads(json.dumps(asdict(config)))


def from_plain(kind: type[C], values: Mapping[str, Any], base: C | None = None, place: str = "") -> C:
    """A config of that kind from plain values; fields that are left out are those of ``base`` or the defaults.

    Raises InputError for a field that the kind does not have, or a value of another type.
    """
    hints = get_type_hints(kind)
    unknown = sorted(set(values) - {f.name for f in fields(kind)})  # type: ignore[arg-type]
    if unknown:
        raise InputError(f"the config has no field '{place}{unknown[0]}'; it has {', '.join(hints)}")
    own = {} if base is None else {f.name: getattr(base, f.name) for f in fields(kind)}  # type: ignore[arg-type]
    given = {name: _value(hints[name], value, own.get(name), f"{place}{name}") for name, value in values.items()}
    return kind(**own | given)


def _value(hint: Any, value: Any, base: Any, place: str) -> Any:
    if get_origin(hint) in (Union, types.UnionType):
        if value is None and type(None) in get_args(hint):
            return None
        (hint,) = (arg for arg in get_args(hint) if arg is not type(None))
    if is_dataclass(hint):
        if isinstance(value, Mapping):
            return from_plain(hint, value, base, f"{place}.")  # type: ignore[type-var]
    elif get_origin(hint) is tuple:
        inner = get_args(hint)
        if isinstance(value, list | tuple) and (inner[-1] is Ellipsis or len(inner) == len(value)):
            each = inner[:1] * len(value) if inner[-1] is Ellipsis else inner
            parts = enumerate(zip(each, value, strict=True))
            return tuple(_value(kind, part, None, f"{place}[{i}]") for i, (kind, part) in parts)
    elif get_origin(hint) is dict:
        if isinstance(value, Mapping):
            return dict(value)
    elif hint is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    elif isinstance(value, hint) and isinstance(value, bool) is (hint is bool):
        return value
    raise InputError(f"the config's '{place}' cannot be {value!r}")


def preset_of(presets: Mapping[str, C], name: str) -> C:
    """A preset by its name. Raises InputError where there is none."""
    if name not in presets:
        raise InputError(f"no preset {name!r}; there are {', '.join(presets)}")
    return presets[name]


def read(path: Path, base: C, part: str | None = None) -> C:
    """The config in a JSON file over ``base``: a run's `config.json`, a model's `model.json`, or some fields alone.

    part: where a file of another training holds this one's config: ``plan`` for the planner of a later training,
    ``detail``, ``target`` or ``backward`` for what completes a model. Raises InputError where it cannot be read or has
    a field that this training does not have.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as JSON ({error})") from None
    if not isinstance(values, dict):
        raise InputError(f"{path}: holds no JSON object; give config.json, model.json or an object of settings")
    own = values.get(part) if part is not None else None
    if isinstance(own, dict) and "training" in own:
        values = own["training"]
    elif "former_training" in values:
        raise InputError(f"{path}: this model was trained by an older recipe, which cannot be repeated")
    else:
        values = values.get("training", values)
        if part is not None and isinstance(values.get(part), dict):
            values = values[part]
    try:
        return from_plain(type(base), {k: v for k, v in values.items() if k not in FROM_DATA}, base)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def check_data(path: Path, run_dir: Path) -> None:
    """Prints a warning where a config file names other databases, or a planner of other settings, than the run has."""
    named, given = (json.loads(file.read_text(encoding="utf-8")) for file in (path, run_dir / "config.json"))
    named = named.get("training", named)
    if named.get("databases") and set(named["databases"]) != set(given["databases"]):
        was, now = ", ".join(named["databases"]), ", ".join(given["databases"])
        print(f"warning: {path} was made from other data: {was}; this run has {now}", file=sys.stderr)
    plans = named.get("plan"), given.get("plan")
    if all(isinstance(plan, dict) for plan in plans) and (
        other := [k for k in plans[1] if plans[0].get(k) != plans[1][k]]
    ):
        print(f"warning: {path} was made along a planner of other settings ({', '.join(other)})", file=sys.stderr)
