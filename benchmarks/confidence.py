"""Fits how far a model knows a gap on data sets that it never saw, and draws how well that holds on others.

    python benchmarks/confidence.py MODEL --trained DB [DB ...] --fit DB [DB ...] --test DB [DB ...] -o OUT

trained: what the model was trained on; its poses are kept, and gaps are taken from frames that the training held out.
Writes OUT/confidence.npz, which belongs into the model's folder, OUT/reliability.png and prints a table.
With --test alone it prints the table for the model as it is.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import torch
from scipy.cluster.vq import kmeans2
from torch import nn

from interpose.data import database
from interpose.data.split import training_ranges
from interpose.evaluate.case import Windows, database_windows
from interpose.runtime import confidence, model_folder
from interpose.runtime.backends.plan import BACKEND
from interpose.runtime.gap_batch import GapBatch, Generated, batch_of
from interpose.runtime.poses import pose_of

SECONDS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0)
SHARES = np.linspace(0.0, 1.0, 5)
CONTEXT = 10
POSES = 384
"""Poses of the training that are kept, centres of k-means."""


def known_poses(paths: list[Path], seed: int = 0) -> np.ndarray:
    rng, seen = np.random.default_rng(seed), []
    for path in paths:
        data = database.load(path)
        able = np.concatenate([np.arange(a, b) for a, b in training_ranges(data)[0]])
        motion = database_windows(data, rng.choice(able, min(6000, len(able)), replace=False).tolist(), 1)
        seen.append(confidence.described(pose_of(motion.root[:, 0], motion.local[:, 0])))
    return kmeans2(np.concatenate(seen), POSES, 10, minit="points", rng=seed)[0]


def gaps(path: Path, held_out: bool, steps: int, count: int, rng: np.random.Generator) -> Windows:
    data = database.load(path)
    ranges = training_ranges(data)[1] if held_out else data.ranges.tolist()
    room = [(a, b) for a, b in ranges if b - a >= steps + 2 * CONTEXT]
    able = np.concatenate([np.arange(a, b - steps - 2 * CONTEXT + 1) for a, b in room])
    return database_windows(data, rng.choice(able, min(count, len(able)), replace=False).tolist(), steps + 2 * CONTEXT)


def measured(
    model: model_folder.Session, path: Path, held_out: bool, poses: np.ndarray, per_length: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Features of gaps of a database, and the joint error of each, metres: interpolation's, then at :data:`SHARES`."""
    rng = np.random.default_rng(seed)
    numbers, errors = [], []
    for seconds in SECONDS:
        steps = round(30 * seconds)
        found = gaps(path, held_out, steps, per_length, rng)
        for number, rows in enumerate(np.array_split(np.arange(len(found)), max(1, len(found) // 64))):
            some = found.take(rows.tolist())
            first, last = CONTEXT - 1, CONTEXT - 1 + steps
            context = some.frames(slice(0 if number % 3 else first, first + 1)).batch
            speed = (some.positions[:, last + 1] - some.positions[:, last]) * 30.0
            batch = batch_of(context, some.frame(last).batch, steps - 1, arriving=speed if number % 3 else None)
            made = BACKEND.generate(model, batch)
            true = some.positions[:, first + 1 : last]
            numbers.append(confidence.features(model, batch, made, poses))
            stepping, whole = confidence.travel(numbers[-1]), np.ones(len(batch))
            each = [error(batch, made, 0.0 * whole, 0.0 * whole, true)]
            each += [error(batch, made, share * whole, np.maximum(share, stepping), true) for share in SHARES]
            errors.append(np.stack(each, axis=1))
    return np.concatenate(numbers), np.concatenate(errors)


def error(batch: GapBatch, made: Generated, share: np.ndarray, legs: np.ndarray, true: np.ndarray) -> np.ndarray:
    root, local = confidence.kept(batch, made, share, legs)
    return np.linalg.norm(confidence._places(root, local) - true, axis=-1).mean(axis=(1, 2))


def fit(
    poses: np.ndarray, numbers: np.ndarray, errors: np.ndarray, weights: np.ndarray, seed: int = 0
) -> confidence.Calibration:
    torch.manual_seed(seed)
    mean, std = numbers.mean(axis=0), numbers.std(axis=0).clip(1e-3)
    x = torch.tensor(((numbers - mean) / std).clip(-3, 3), dtype=torch.float32)
    e, w = torch.tensor(errors[:, 1:], dtype=torch.float32), torch.tensor(weights, dtype=torch.float32)
    base = torch.tensor(errors[:, 0], dtype=torch.float32)
    better = (e[:, -1] < base).float()
    net = nn.Sequential(nn.Linear(x.shape[1], 16), nn.Tanh(), nn.Dropout(0.1), nn.Linear(16, 2))
    optimizer = torch.optim.AdamW(net.parameters(), lr=1e-2, weight_decay=1e-2)
    for step in range(1500):
        optimizer.param_groups[0]["lr"] = 1e-2 * 0.5 * (1 + np.cos(np.pi * step / 1500))
        logits = net(x + 0.1 * torch.randn_like(x))
        known = nn.functional.binary_cross_entropy_with_logits(logits[:, 0], better, weight=w)
        at = logits[:, 1].sigmoid() * (len(SHARES) - 1)
        low = at.floor().clamp(max=len(SHARES) - 2).long()
        part = at - low
        row = torch.arange(len(x))
        blended = (1 - part) * e[row, low] + part * e[row, low + 1]
        loss = known + (w * blended / base.clamp_min(0.01)).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    first, last = net[0], net[3]
    arrays = (first.weight.T, first.bias, last.weight.T, last.bias)
    return confidence.Calibration(poses, mean, std, *(a.detach().double().numpy() for a in arrays))


def at_share(errors: np.ndarray, share: np.ndarray) -> np.ndarray:
    at = share * (len(SHARES) - 1)
    low = np.minimum(np.floor(at).astype(int), len(SHARES) - 2)
    row = np.arange(len(errors))
    return errors[row, low + 1] + (at - low) * (errors[row, low + 2] - errors[row, low + 1])


def report(name: str, made: confidence.Calibration, numbers: np.ndarray, errors: np.ndarray) -> np.ndarray:
    sure, share = made(numbers)
    blend, plain, base = at_share(errors, share), errors[:, -1], errors[:, 0]
    seconds = np.exp(numbers[:, 0])
    print(f"{name}: {len(numbers)} gaps")
    for each in SECONDS:
        k = np.abs(seconds - each) < 0.05
        if k.any():
            print(
                f"  {each:4.2f} s  error over interpolation's {plain[k].mean() / base[k].mean():.2f} -> "
                f"{blend[k].mean() / base[k].mean():.2f}; worse {np.mean(plain[k] > base[k]):.0%} -> "
                f"{np.mean(blend[k] > 1.02 * base[k]):.0%} (by 2 % or more); confidence {sure[k].mean():.2f}"
            )
    return np.stack([sure, plain < base], axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("--trained", nargs="+", type=Path, default=[])
    parser.add_argument("--fit", nargs="+", type=Path, default=[])
    parser.add_argument("--test", nargs="+", type=Path, required=True)
    parser.add_argument("-o", "--out", type=Path)
    parser.add_argument("--gaps", type=int, default=384, help="of each length and database")
    options = parser.parse_args()
    torch.set_num_threads(1)
    model = model_folder.load(options.model)
    if not options.trained:
        known = confidence.calibration(model.path)
        assert known is not None
        for path in options.test:
            report(f"test {path.name}", known, *measured(model, path, False, known.poses, options.gaps, 1))
        return
    poses = known_poses(options.trained)
    sources = [(path, False) for path in options.fit] + [(path, True) for path in options.trained]
    seen = [measured(model, path, held_out, poses, options.gaps, 0) for path, held_out in sources]
    numbers, errors = (np.concatenate(each) for each in zip(*seen, strict=True))
    weights = np.concatenate([np.full(len(n), len(numbers) / (len(seen) * len(n))) for n, _ in seen])
    made = fit(poses, numbers, errors, weights)
    options.out.mkdir(parents=True, exist_ok=True)
    np.savez(
        options.out / "confidence.npz",
        **{k: v.astype(np.float16 if k == "poses" else np.float32) for k, v in vars(made).items()},
    )
    for (path, _), (n, e) in zip(sources, seen, strict=True):
        report(f"fit {path.name}", made, n, e)
    points = {
        path.name: report(f"test {path.name}", made, *measured(model, path, False, poses, options.gaps, 1))
        for path in options.test
    }
    draw(points, options.out / "reliability.png")


def draw(points: dict[str, np.ndarray], path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure((5.0, 4.5), layout="constrained")
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color="0.7")
    for name, each in points.items():
        bins = np.minimum((each[:, 0] * 8).astype(int), 7)
        rows = [(each[bins == b, 0].mean(), each[bins == b, 1].mean(), np.sum(bins == b)) for b in np.unique(bins)]
        sure, true, count = np.array(rows).T
        axes.plot(sure, true, marker="o", label=f"{name}, {len(each)} gaps")
        gap = np.sum(np.abs(sure - true) * count) / count.sum()
        print(f"{name}: calibration error {gap:.3f}")
    axes.set_xlabel("confidence")
    axes.set_ylabel("share of gaps nearer to the truth than interpolation")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
