"""Checkpoints of training runs, written whole or not at all, from which a run goes on exactly where it was."""

from __future__ import annotations

import json
import os
import random
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
import torch

from interpose.errors import InputError

KEPT_CHECKPOINTS = 2


@runtime_checkable
class Stateful(Protocol):
    """A module, an optimizer, an average of weights: all that gives and takes its state."""

    def state_dict(self) -> Any: ...
    def load_state_dict(self, state_dict: Any) -> Any: ...


@dataclass(frozen=True)
class TrainingState:
    """All that a step changes.

    parts: named modules and optimizers, by custom ``model``, ``optimizer`` and ``ema``.
    generators: those that steps draw from.
    extra: tensors and plain values that steps put there to find them again after a resume (on the CPU then).
    """

    parts: Mapping[str, Stateful]
    generators: Mapping[str, torch.Generator | np.random.Generator] = field(default_factory=dict)
    extra: dict[str, Any] = field(default_factory=dict)


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Calls ``write`` with a temporary name beside ``path``, syncs the file and puts it in place: whole or absent."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        write(temporary)
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def save(run_dir: Path, state: TrainingState, step: int, config: object) -> Path:
    """Writes the checkpoint after ``step`` steps and drops all but the last :data:`KEPT_CHECKPOINTS`."""
    mersenne = np.random.get_state(legacy=False)  # noqa: NPY002
    mersenne["state"]["key"] = mersenne["state"]["key"].tolist()
    checkpoint = {name: part.state_dict() for name, part in state.parts.items()} | {
        "step": step,
        "config": _plain(config),
        "extra": state.extra,
        "random": {
            "python": random.getstate(),
            "numpy": mersenne,
            "torch": torch.get_rng_state(),
            "cuda": torch.cuda.get_rng_state_all() if torch.cuda.is_available() else [],
            "generators": {
                name: g.get_state() if isinstance(g, torch.Generator) else g.bit_generator.state
                for name, g in state.generators.items()
            },
        },
    }
    path = run_dir / f"checkpoint-{step:09d}.pt"
    write_atomically(path, lambda temporary: torch.save(checkpoint, temporary))
    for old in _checkpoints(run_dir)[:-KEPT_CHECKPOINTS]:
        old.unlink()
    return path


def load(run_dir: Path) -> dict[str, Any] | None:
    """The newest checkpoint that can be read, on the CPU, or None where there is none.

    Raises InputError where there are some and none can be read.
    """
    paths = _checkpoints(run_dir)
    for path in reversed(paths):
        try:
            return torch.load(path, map_location="cpu", weights_only=True)
        except Exception:  # a damaged file can make the unpickler raise anything
            continue
    if paths:
        raise InputError(f"{run_dir}: no checkpoint can be read; delete the folder and train again.")
    return None


def average_into(model: torch.nn.Module, saved: Mapping[str, Any]) -> None:
    """Gives ``model`` the weights of a checkpoint, the moving average, ready to run.

    Raises InputError where they do not fit, as those of an older program may not.
    """
    weights = {k.removeprefix("module."): v for k, v in saved["ema"].items() if k.startswith("module.")}
    try:
        model.load_state_dict(weights)
    except RuntimeError as error:
        reason = str(error).splitlines()[-1].strip()
        raise InputError(f"the run's weights are not those of its config ({reason}); train again") from None
    model.eval()


def resume(run_dir: Path, state: TrainingState, config: object) -> int:
    """Opens the run folder and puts its last checkpoint, if any, into ``state``; the number of steps already done.

    Raises InputError where the folder holds a run with another config, saying which field differs.
    """
    run_dir.mkdir(parents=True, exist_ok=True)
    now, path = _plain(config), run_dir / "config.json"
    if path.exists():
        before = json.loads(path.read_text())
        for name in sorted({*before, *now}):
            if before.get(name) != now.get(name):
                raise InputError(
                    f"{run_dir}: cannot resume, {name} is {now.get(name)!r} now and was {before.get(name)!r} in its "
                    "config.json; give the same settings or another folder."
                )
    else:
        write_atomically(path, lambda temporary: temporary.write_text(json.dumps(now, indent=2) + "\n"))
    checkpoint = load(run_dir)
    if checkpoint is None:
        return 0
    for name, part in state.parts.items():
        part.load_state_dict(checkpoint[name])
    state.extra.clear()
    state.extra.update(checkpoint["extra"])
    drawn = checkpoint["random"]
    random.setstate(drawn["python"])
    drawn["numpy"]["state"]["key"] = np.array(drawn["numpy"]["state"]["key"], dtype=np.uint32)
    np.random.set_state(drawn["numpy"])  # noqa: NPY002
    torch.set_rng_state(drawn["torch"])
    if torch.cuda.is_available() and drawn["cuda"]:
        torch.cuda.set_rng_state_all(drawn["cuda"])
    for name, generator in state.generators.items():
        if isinstance(generator, torch.Generator):
            generator.set_state(drawn["generators"][name])
        else:
            generator.bit_generator.state = drawn["generators"][name]
    return checkpoint["step"]


def _checkpoints(run_dir: Path) -> list[Path]:
    return sorted(run_dir.glob("checkpoint-*.pt"))


def _plain(config: Any) -> dict[str, Any]:
    return json.loads(json.dumps(asdict(config)))
