"""The recipe of the periodic autoencoder: ``interpose train pae --data DB -o RUN``.

Mean squared error between a window of velocities and its reconstruction, AdamW, one cosine cycle (Starke et al.
2022, section 4.3), with larger batches and a higher rate. The run folder is that of
`interpose.train.common.loop`; when the training is finished it also has ``phases.npy``
(`interpose.train.phases.extract`; for several databases ``phases-1.npy``, ``phases-2.npy``, ... in their order),
``report.json``, ``manifold.png`` and ``clip.png``.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import torch
from torch import Tensor
from torch.nn.functional import mse_loss

from interpose.data.database import Database
from interpose.errors import InputError
from interpose.models.periodic_autoencoder import PeriodicAutoencoder
from interpose.skeleton import MODEL_RATE
from interpose.train.common import checkpoint, loop, setup
from interpose.train.common.config import preset_of
from interpose.train.phases import plots
from interpose.train.phases.extract import Curves, phase_features, save, velocity_curves, windows


@dataclass(frozen=True)
class PhasesConfig:
    """Everything that decides a training, saved beside its weights."""

    preset: str = "full"
    channels: int = 10
    frames: int = 61
    normalised: bool = False
    """layer normalisation over time, as the authors' code has it; see the model"""
    steps: int = 30_000
    batch: int = 128
    learning_rate: float = 3e-3
    weight_decay: float = 1e-4
    warmup: int = 100
    seed: int = 0
    databases: tuple[str, ...] = ()
    styles: tuple[str, ...] = ()
    licence: str = ""


PRESETS: dict[str, PhasesConfig] = {
    "full": PhasesConfig(),
    "small": PhasesConfig(preset="small", steps=3_000),
    "tiny": PhasesConfig(preset="tiny", channels=3, steps=40, batch=32, warmup=4),
}
"""``full`` sees four million windows, ``small`` is useful after five minutes on one CPU core, ``tiny`` is for tests."""


def train(
    data: list[Path],
    run_dir: Path,
    preset: str = "small",
    *,
    max_minutes: float | None = None,
    device: str = "cpu",
    seed: int = 0,
    config: PhasesConfig | None = None,
) -> loop.Outcome:
    """Trains on prepared databases, or resumes in ``run_dir``, and writes their phases when it is finished.

    config: in place of the preset's. Raises InputError for an unknown preset, databases that do not load, and a run
    folder of another config.
    """
    loaded, kept = setup.load(data)
    config = replace(config or preset_of(PRESETS, preset), seed=seed, **kept)
    torch.manual_seed(config.seed)
    model = PeriodicAutoencoder(
        channels=config.channels, frames=config.frames, rate=MODEL_RATE, normalised=config.normalised
    ).to(device)
    optimizer = torch.optim.AdamW(model.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay)
    draws = torch.Generator().manual_seed(config.seed)
    curves = velocity_curves(*loaded)
    curves = Curves(curves.values.to(device), curves.first.to(device), curves.last.to(device))

    def step(number: int) -> dict[str, Tensor | float]:
        rate = config.learning_rate * loop.cosine(number, config.steps, config.warmup)
        loop.set_learning_rate(optimizer, rate)
        truth = draw(curves, config, draws)
        loss = mse_loss(model(truth), truth)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        return {"loss": loss, "rate": rate}

    outcome = loop.run(
        run_dir,
        config,
        checkpoint.TrainingState({"model": model, "optimizer": optimizer}, {"draws": draws}),
        config.steps,
        step,
        samples_per_step=config.batch,
        checkpoint_every=250,
        max_minutes=max_minutes,
    )
    if outcome == "finished":
        write_results(loaded, run_dir)
    return outcome


def draw(curves: Curves, config: PhasesConfig, generator: torch.Generator) -> Tensor:
    """A batch of windows, (batch, 66, time), each mirrored or not, from anywhere in the data."""
    picked = torch.randint(2 * len(curves), (config.batch,), generator=generator).to(curves.values.device)
    return windows(curves, picked % len(curves), picked >= len(curves), config.frames)


def load_model(run_dir: Path) -> PeriodicAutoencoder:
    """The autoencoder of a run, as last saved; raises InputError where there is none."""
    saved = checkpoint.load(run_dir)
    if saved is None:
        raise InputError(f"{run_dir} holds no trained autoencoder; make one with 'interpose train pae'")
    settings = {name: saved["config"][name] for name in ("channels", "frames", "normalised")}
    model = PeriodicAutoencoder(rate=MODEL_RATE, **settings)
    model.load_state_dict(saved["model"])
    return model.eval()


def write_results(databases: list[Database], run_dir: Path) -> None:
    """Writes the phases of each database, with the model of the run, a report on the reconstruction and two figures."""
    model = load_model(run_dir)
    report = []
    for number, data in enumerate(databases, start=1):
        curves = velocity_curves(data)
        features = phase_features(curves, model)
        save(features, run_dir / ("phases.npy" if len(databases) == 1 else f"phases-{number}.npy"))
        report.append({"dataset": data.dataset, "frames": data.frames, "unexplained": unexplained(curves, model)})
        if number == 1:
            plots.manifold(features[0], data, run_dir / "manifold.png")
            plots.clip(features[0], data, run_dir / "clip.png")
    text = json.dumps(report, indent=2) + "\n"
    checkpoint.write_atomically(run_dir / "report.json", lambda temporary: temporary.write_text(text))


@torch.inference_mode()
def unexplained(curves: Curves, model: PeriodicAutoencoder, count: int = 4096) -> float:
    """Mean squared error of the reconstruction over the variance of the velocities, on windows drawn at random."""
    picked = torch.randint(2 * len(curves), (count,), generator=torch.Generator().manual_seed(0))
    truth = windows(curves, picked % len(curves), picked >= len(curves), model.frames)
    pred = torch.cat([model(part) for part in truth.split(512)])
    variance = (truth - truth.mean(dim=(0, 2), keepdim=True)).square().mean()
    return float(mse_loss(pred, truth) / variance)
