"""What the training recipes share: a run folder with checkpoints and curves, and the loop that drives the steps.

A run folder holds ``config.json``, ``checkpoint-<steps done>.pt`` (the last two), ``metrics.jsonl`` (one JSON object a
line) and TensorBoard event files. A run that was stopped or killed resumes from its last checkpoint and gives the same
losses as one that never stopped, as long as a step draws only from the global generators or those of its
`TrainingState`, and keeps everything else that it remembers in ``TrainingState.extra``. On several processes
(`interpose.train.common.parallel`) only the first writes; it logs means over all of them.
"""

from __future__ import annotations

import json
import math
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Literal

import torch
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from interpose.errors import InputError
from interpose.train.common.checkpoint import TrainingState, resume, save, write_atomically
from interpose.train.common.parallel import ALONE, Group

Outcome = Literal["finished", "out of time", "interrupted"]


def cosine(step: int, steps: int, warmup: int = 0, floor: float = 0.0) -> float:
    """The factor of the learning rate: linear up to 1 over ``warmup`` steps, then half a cosine down to ``floor``."""
    if step < warmup:
        return (step + 1) / warmup
    part = min(1.0, (step - warmup) / max(1, steps - warmup))
    return floor + (1.0 - floor) * 0.5 * (1.0 + math.cos(math.pi * part))


def set_learning_rate(optimizer: torch.optim.Optimizer, rate: float) -> None:
    """Sets the rate of all parameter groups."""
    for group in optimizer.param_groups:
        group["lr"] = rate


def moving_average(model: nn.Module, decay: float) -> AveragedModel:
    """A moving average of the weights: call ``update_parameters(model)`` after a step, use ``.module``."""
    return AveragedModel(model, multi_avg_fn=get_ema_multi_avg_fn(decay))


def run(
    run_dir: Path,
    config: object,
    state: TrainingState,
    steps: int,
    step_fn: Callable[[int], Mapping[str, Tensor | float]],
    *,
    samples_per_step: int | Callable[[int], int] = 1,
    log_every: int = 50,
    checkpoint_every: int = 1000,
    max_minutes: float | None = None,
    group: Group = ALONE,
) -> Outcome:
    """Calls ``step_fn(step)`` for the steps that are not yet done, up to ``steps``; see the module for what it keeps.

    ``config`` is a dataclass of plain values. ``step_fn`` takes one optimization step and returns its scalars; a
    ``loss`` among them is shown. Means over ``log_every`` steps are logged. samples_per_step: of all processes
    together, a number or by the step. After ``max_minutes``, or on SIGINT or SIGTERM, a checkpoint is written and the
    loop returns, on all processes after the same step. Raises InputError where the folder's config differs, or where a
    scalar is no longer finite (nothing is saved then).
    """
    if not group.first:
        group.wait()
    done = first = resume(run_dir, state, config)
    if group.first:
        group.wait()
    began, seconds, samples, pending, outcome = time.monotonic(), 0.0, 0, {}, "finished"
    with _curves(run_dir, done, group) as log, _stop_signal() as stop, _progress(done, steps, group) as show:
        while done < steps and outcome == "finished":
            for name, value in step_fn(done).items():
                pending.setdefault(name, []).append(torch.as_tensor(value).detach())
            samples += samples_per_step if isinstance(samples_per_step, int) else samples_per_step(done)
            done += 1
            seconds = time.monotonic() - began
            late = max_minutes is not None and seconds > 60 * max_minutes
            stopped, late = group.anywhere(stop.is_set(), late)
            if (stopped or late) and done < steps:
                outcome = "interrupted" if stopped else "out of time"
            leaving = done == steps or outcome != "finished"
            if leaving or done % log_every == 0 or done % checkpoint_every == 0:
                means = _means(pending, group)
                bad = [name for name, mean in means.items() if not math.isfinite(mean)]
                if bad:
                    raise InputError(f"{run_dir}: {bad[0]} is not finite at step {done}; lower the learning rate.")
                log(done, means)
                pending.clear()
                show(done, means.get("loss", math.nan), samples / max(seconds, 1e-9), leaving)
            if group.first and (leaving or done % checkpoint_every == 0):
                save(run_dir, state, done, config)
    group.wait()
    if group.first and done > first:
        speed = f"{samples / max(seconds, 1e-9):.0f} samples a second"
        print(f"{done - first} updates in {seconds:.0f} s: {samples} samples, {speed}", file=sys.stderr)
    if group.first and outcome != "finished":
        print(f"{outcome} at step {done} of {steps}; run the same command again to go on from there.", file=sys.stderr)
    return outcome


def _means(values: Mapping[str, list[Tensor]], group: Group) -> dict[str, float]:
    """The mean of each over the steps and the processes, all of which have the same names."""
    means = torch.tensor([float(torch.stack(each).float().mean()) for each in values.values()])
    return dict(zip(values, (group.total(means) / group.size).tolist(), strict=True))


@contextmanager
def _curves(run_dir: Path, done: int, group: Group) -> Iterator[Callable[[int, Mapping[str, float]], None]]:
    """What takes a step's scalars: the folder's curves, on the first process."""
    if not group.first:
        yield lambda step, scalars: None
        return
    with _Curves(run_dir, done) as curves:
        yield curves.log


class _Curves:
    """metrics.jsonl and TensorBoard events; what an earlier process logged after step ``done`` is dropped."""

    def __init__(self, run_dir: Path, done: int) -> None:
        path = run_dir / "metrics.jsonl"
        if path.exists():
            # A killed process may leave half a line; it lies after the checkpoint, so it is dropped as well.
            lines = [line for line in path.read_text().splitlines(keepends=True) if line.endswith("}\n")]
            kept = "".join(line for line in lines if json.loads(line)["step"] <= done)
            write_atomically(path, lambda temporary: temporary.write_text(kept))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from torch.utils.tensorboard import SummaryWriter
        self._events = SummaryWriter(str(run_dir), purge_step=done + 1)
        self._lines = path.open("a")

    def log(self, step: int, scalars: Mapping[str, float]) -> None:
        self._lines.write(json.dumps({"step": step, **scalars}) + "\n")
        self._lines.flush()
        for name, value in scalars.items():
            self._events.add_scalar(name, value, step)

    def __enter__(self) -> _Curves:
        return self

    def __exit__(self, *_: object) -> None:
        self._lines.close()
        self._events.close()


@contextmanager
def _stop_signal() -> Iterator[threading.Event]:
    """An event that the first SIGINT or SIGTERM sets; the second one does what it always does."""
    event = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield event
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def restore(*_: object) -> None:
        event.set()
        for number, handler in before.items():
            signal.signal(number, handler)

    for number in before:
        signal.signal(number, restore)
    try:
        yield event
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def _progress(done: int, steps: int, group: Group) -> Iterator[Callable[[int, float, float, bool], None]]:
    """A bar on standard error, or a line every 30 s if that is no terminal: (step, loss, samples a second, last); from
    the first process alone."""
    if not group.first:
        yield lambda step, loss, speed, last: None
        return
    console = Console(stderr=True)
    columns = (
        TextColumn("step {task.completed:.0f}/{task.total:.0f}"),
        BarColumn(),
        TextColumn("loss {task.fields[loss]:.4g} · {task.fields[speed]:.0f} samples/s · left"),
        TimeRemainingColumn(),
    )
    shown, began = -math.inf, time.monotonic()
    with Progress(*columns, console=console) if console.is_terminal else nullcontext() as bar:
        task = None if bar is None else bar.add_task("", total=steps, completed=done, loss=math.nan, speed=0.0)

        def show(step: int, loss: float, speed: float, last: bool) -> None:
            nonlocal shown
            now = time.monotonic()
            if bar is not None and task is not None:
                bar.update(task, completed=step, loss=loss, speed=speed)
            elif last or now - shown > 30:
                shown = now
                left = (now - began) / max(1, step - done) * (steps - step)
                print(f"step {step}/{steps} loss {loss:.4g} {speed:.0f} samples/s {left:.0f} s left", file=sys.stderr)

        yield show
