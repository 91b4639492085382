"""What a frame of DC-MoE costs on the CPU, and what a whole gap of candidates, part by part.

    python benchmarks/step.py [--repeats N] [--model DIR ...]

Networks of random weights, of the paper's size (16 experts x 512) and of the preset ``small``, are exported to a
temporary folder and run by ONNX Runtime on one thread. The first table times one step for 1, 8 and 64 characters,
beside the time that reading the weights once takes, which no step of one character can beat; the second says where a
step's time goes, by operator; the third times a gap of 60 frames with eight candidates through
:func:`interpose.runtime.inbetween.inbetween`, along trajectories of the default model's gallery, context and what
follows the target known, at 30 Hz and at 60 Hz. The budgets: 0.5 ms a step for one character, 8 ms for 64, 0.25 s a gap
at 30 Hz. With ``--model`` the folders of exported models are timed in place of the random ones.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from unittest import mock

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import onnxruntime

from interpose import retarget, rotation
from interpose.features import control_shapes, state_shapes
from interpose.motion import Motion
from interpose.runtime import guidance, inbetween, inertia, transition
from interpose.runtime.backends.dcmoe import DCMoEBackend
from interpose.runtime.backends.stitch import StitchBackend
from interpose.runtime.feet import lock
from interpose.runtime.model_folder import Session, load
from interpose.runtime.request import Request
from interpose.skeleton import HUMANOID

FRAMES, VARIANTS, SEED = 60, 8, 1
CHARACTERS = (1, 8, 64)
Call = Callable[[], object]


def random_model(preset: str, folder: Path) -> Path:
    """The folder of a network of random weights, of the size of that preset and 100 styles."""
    from interpose import export
    from interpose.models.dcmoe import DCMoE
    from interpose.train.common import checkpoint, loop
    from interpose.train.dcmoe.config import PRESETS
    from interpose.train.planner import config as planner_config

    styles = tuple(f"Style {i}" for i in range(100))
    planner = planner_config.PRESETS[preset]
    planner = replace(planner, size=replace(planner.size, styles=len(styles)), styles=styles)
    config = replace(PRESETS[preset], styles=styles, plan=planner)
    model = DCMoE(config.size)
    run = folder / f"run-{preset}"
    run.mkdir()
    parts = {"model": model, "ema": loop.moving_average(model, 0.9)}
    checkpoint.save(run, checkpoint.TrainingState(parts), 0, config)
    return export.export(run, folder / preset)


def feed(session: Session, batch: int) -> dict[str, np.ndarray]:
    """Inputs of a step, near enough to poses."""
    draw = np.random.default_rng(0)
    shapes = state_shapes() | control_shapes(len(session.styles))
    out = {name: 0.1 * draw.normal(size=(batch, *shape)) for name, shape in shapes.items()}
    for name in ("rotations", "target_rotations"):
        out[name] += [1.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    for name in ("base", "base_next"):
        out[name][:, 3:] += np.tile([1.0, 0.0, 0.0, 0.0, 1.0, 0.0], 22)
    out["frames_left"][...] = 30.0
    return {name: value.astype(np.float32) for name, value in out.items()}


def walk(frames: int) -> Motion:
    """A smooth motion with its toes near the floor."""
    times = np.arange(frames) / 30.0
    root = np.stack([0.1 * np.sin(times), 0.93 + 0.02 * np.cos(6.0 * times), 1.3 * times], axis=-1)
    axes = np.random.default_rng(3).normal(size=(len(HUMANOID), 3))
    angles = 0.25 * np.sin(5.0 * times[:, None] + np.arange(len(HUMANOID)))
    return Motion(HUMANOID, root, rotation.from_rotation_vector(angles[..., None] * axes), 30.0)


def seconds(call: Call, repeats: int) -> np.ndarray:
    """The wall time of each of ``repeats`` calls, after three to warm up."""
    for _ in range(3):
        call()
    out = np.empty(repeats)
    for i in range(repeats):
        began = time.perf_counter()
        call()
        out[i] = time.perf_counter() - began
    return out


@contextmanager
def parts_timed() -> Iterator[dict[str, float]]:
    """Seconds spent in each part of a gap; a part that another one calls counts for itself alone."""
    spent: dict[str, float] = {}
    running: list[float] = []

    def timed(name: str, function: Callable[..., object]) -> Callable[..., object]:
        def call(*args: object, **kwargs: object) -> object:
            began = time.perf_counter()
            running.append(0.0)
            try:
                return function(*args, **kwargs)
            finally:
                whole = time.perf_counter() - began
                spent[name] = spent.get(name, 0.0) + whole - running.pop()
                if running:
                    running[-1] += whole

        return call

    watched = [
        ("network", Session, "run"),
        ("base, states and rotations", DCMoEBackend, "generate"),
        ("base, states and rotations", StitchBackend, "generate"),
        ("feet", lock, "plant_batch"),
        ("velocities at the keys", inertia, "leave"),
        ("velocities at the keys", inertia, "arrive"),
        ("resampling", transition, "to_user_rate"),
        ("retargeting", retarget, "to_humanoid"),
        ("retargeting", retarget, "from_humanoid"),
        ("judging the candidates", inbetween, "judge"),
        ("paths", guidance, "guide"),
        ("the rest", inbetween, "inbetween"),
    ]
    patches = [mock.patch.object(owner, name, timed(label, getattr(owner, name))) for label, owner, name in watched]
    for patch in patches:
        patch.start()
    try:
        yield spent
    finally:
        for patch in patches:
            patch.stop()


def step_rows(session: Session, repeats: int) -> None:
    """Prints the cost of a step for several numbers of characters, and of reading its weights."""
    size = (session.path / "step.onnx").stat().st_size
    floor = 1e3 * reading(size).min()
    for batch in CHARACTERS:
        inputs = feed(session, batch)
        taken = 1e3 * seconds(lambda inputs=inputs: session.step(inputs), repeats if batch < 64 else repeats // 4)
        told = f"{size / 2**20:>10.1f} {floor:>10.3f}"
        print(f"{session.name:24} {batch:>10} {taken.min():>10.3f} {np.median(taken):>10.3f} {told}")


def reading(size: int, repeats: int = 50) -> np.ndarray:
    """Seconds that one core needs to read so many bytes again and again, as a step does: the sum of an array."""
    numbers = np.ones(size // 4, dtype=np.float32)
    return seconds(lambda: float(numbers @ numbers), repeats)


def operator_rows(session: Session, repeats: int, batch: int = 1) -> None:
    """Prints where a step's time goes, by operator, as ONNX Runtime's own profile has it."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.enable_profiling = True
    with tempfile.TemporaryDirectory() as folder:
        options.profile_file_prefix = str(Path(folder) / "step")
        network = onnxruntime.InferenceSession(str(session.path / "step.onnx"), options)
        inputs = feed(session, batch)
        for _ in range(repeats):
            network.run(None, inputs)
        events = json.loads(Path(network.end_profiling()).read_text())
    spent: dict[str, float] = {}
    for event in events:
        if event.get("cat") == "Node" and event["name"].endswith("_kernel_time"):
            kind = event["args"]["op_name"]
            spent[kind] = spent.get(kind, 0.0) + event["dur"] / 1e3 / repeats
    whole = sum(spent.values())
    print(f"\n{session.name}, one step of {batch} by operator, ms")
    for kind, value in sorted(spent.items(), key=lambda item: -item[1])[:8]:
        print(f"  {kind:26} {value:>10.3f} {value / whole:>9.0%}")


def gap_rows(session: Session, rate: float, repeats: int, frames: int = FRAMES) -> None:
    """Prints the cost of a gap and the share of its parts, at the user's ``rate``."""
    clip = replace(walk(frames + 20), rate=rate)
    mapping = inbetween.mapping_of(clip)
    request = Request(session.method, session, seed=SEED, gallery=session.gallery or load().gallery)

    def gap() -> object:
        return inbetween.inbetween(clip[:10], clip[frames + 10 :], frames, request, variants=VARIANTS, mapping=mapping)

    taken = 1e3 * seconds(gap, repeats)
    print(f"\n{session.name}, {frames} frames at {rate:g} Hz x {VARIANTS} candidates, ms")
    print(f"{'whole gap':28} {taken.min():>10.1f} {np.median(taken):>10.1f}")
    with parts_timed() as spent:
        for _ in range(repeats):
            gap()
    whole = sum(spent.values())
    for name, value in sorted(spent.items(), key=lambda item: -item[1]):
        print(f"  {name:26} {1e3 * value / repeats:>10.1f} {value / whole:>9.0%}")


def main() -> None:
    parser = argparse.ArgumentParser(description="Times a step of DC-MoE and a whole gap.")
    parser.add_argument("--repeats", type=int, default=20, help="of a gap; a step is repeated ten times as often")
    parser.add_argument("--model", type=Path, nargs="+", default=[], help="folders of exported models")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        models = asked.model or [random_model(preset, Path(folder)) for preset in ("full", "small")]
        sessions = [load(path) for path in models]
        heads = ("characters", "min", "median", "MiB", "reading")
        print(f"{'one step, ms':24} " + " ".join(f"{head:>10}" for head in heads))
        for session in sessions:
            step_rows(session, 10 * asked.repeats)
        for session in sessions:
            operator_rows(session, 10 * asked.repeats)
        for session in sessions:
            for rate in (30.0, 60.0):
                gap_rows(session, rate, asked.repeats)


if __name__ == "__main__":
    main()
