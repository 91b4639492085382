from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import nn

from interpose.errors import InputError
from interpose.train.common import checkpoint, loop


@dataclass(frozen=True)
class Config:
    steps: int = 12
    rate: float = 0.05
    sizes: tuple[int, ...] = (3, 1)


class Noisy:
    """A small regression whose steps draw from several generators and carry a tensor from step to step.

    Not from Python's own generator: beartype's checks in these tests draw from it too.
    """

    def __init__(self, config: Config) -> None:
        torch.manual_seed(0)
        np.random.seed(0)  # noqa: NPY002
        self.config = config
        self.model = nn.Linear(config.sizes[0], config.sizes[1])
        self.optimizer = torch.optim.AdamW(self.model.parameters())
        self.ema = loop.moving_average(self.model, 0.9)
        self.numbers, self.draws = np.random.default_rng(1), torch.Generator().manual_seed(2)
        self.state = checkpoint.TrainingState(
            {"model": self.model, "optimizer": self.optimizer, "ema": self.ema},
            {"numbers": self.numbers, "draws": self.draws},
            {"carried": torch.zeros(3)},
        )
        self.losses: dict[int, float] = {}

    def step(self, step: int) -> dict[str, torch.Tensor | float]:
        x = torch.randn(8, 3, generator=self.draws) + torch.randn(3) + float(self.numbers.normal())
        x = x + self.state.extra["carried"] + float(np.random.rand())  # noqa: NPY002
        self.state.extra["carried"] = 0.5 * x.mean(dim=0)
        loss = (self.model(x) - x.sum(dim=1, keepdim=True)).square().mean()
        self.optimizer.zero_grad()
        loss.backward()
        loop.set_learning_rate(self.optimizer, self.config.rate * loop.cosine(step, self.config.steps, 2))
        self.optimizer.step()
        self.ema.update_parameters(self.model)
        self.losses[step] = loss.item()
        return {"loss": loss, "rate": self.optimizer.param_groups[0]["lr"]}

    def run(self, folder: Path, **options: float) -> loop.Outcome:
        options = {"log_every": 1, "checkpoint_every": 5} | options
        return loop.run(folder, self.config, self.state, self.config.steps, self.step, **options)  # type: ignore[arg-type]


def killed_at(last: int, noisy: Noisy, folder: Path, **options: float) -> None:
    original = noisy.step

    def dying(step: int) -> dict[str, torch.Tensor | float]:
        if step == last:
            raise KeyboardInterrupt
        return original(step)

    noisy.step = dying
    with pytest.raises(KeyboardInterrupt):
        noisy.run(folder, **options)


def metrics(folder: Path) -> list[dict[str, float]]:
    return [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Noisy, Path]:
    folder = tmp_path_factory.mktemp("whole")
    noisy = Noisy(Config())
    assert noisy.run(folder) == "finished"
    return noisy, folder


@pytest.mark.parametrize("log_every", [1, 3])
def test_a_killed_run_goes_on_as_if_it_had_never_stopped(
    tmp_path: Path, whole: tuple[Noisy, Path], log_every: int
) -> None:
    killed_at(8, Noisy(Config()), tmp_path, log_every=log_every)
    with (tmp_path / "metrics.jsonl").open("a") as file:
        file.write('{"step": 8, "lo')  # as a killed process leaves it
    torch.manual_seed(99)
    resumed = Noisy(Config())
    assert resumed.run(tmp_path, log_every=log_every) == "finished"
    assert resumed.losses == {step: loss for step, loss in whole[0].losses.items() if step >= 5}
    for name, value in whole[0].ema.state_dict().items():
        torch.testing.assert_close(resumed.ema.state_dict()[name], value, rtol=0, atol=0)
    if log_every == 1:
        assert metrics(tmp_path) == metrics(whole[1])
    assert [line["step"] for line in metrics(tmp_path)] == sorted({line["step"] for line in metrics(tmp_path)})


def test_all_generators_go_on_where_they_were(tmp_path: Path) -> None:
    def draw(noisy: Noisy) -> list[float]:
        own = [noisy.numbers.random(), torch.rand((), generator=noisy.draws).item()]
        return [random.random(), float(np.random.rand()), torch.rand(()).item(), *own]  # noqa: NPY002

    first = Noisy(Config())
    draw(first)
    before = random.getstate()
    checkpoint.save(tmp_path, first.state, 3, first.config)
    random.setstate(before)
    expected = draw(first)
    second = Noisy(Config())
    assert checkpoint.resume(tmp_path, second.state, second.config) == 3
    assert draw(second) == expected


def test_the_last_two_checkpoints_stay_and_hold_what_is_promised(whole: tuple[Noisy, Path]) -> None:
    assert [p.name for p in sorted(whole[1].glob("*.pt"))] == ["checkpoint-000000010.pt", "checkpoint-000000012.pt"]
    saved = checkpoint.load(whole[1])
    assert saved is not None
    assert {"model", "optimizer", "ema", "step", "config", "random", "extra"} == set(saved)
    assert saved["step"] == 12
    assert saved["config"] == {"steps": 12, "rate": 0.05, "sizes": [3, 1]}
    assert list(whole[1].glob("events.out.tfevents.*"))


def test_a_finished_run_takes_no_more_steps(whole: tuple[Noisy, Path]) -> None:
    again = Noisy(Config())
    assert again.run(whole[1]) == "finished"
    assert again.losses == {}


def test_another_config_is_refused_with_the_field_that_differs(whole: tuple[Noisy, Path]) -> None:
    with pytest.raises(InputError, match=r"rate is 0\.1 now and was 0\.05"):
        Noisy(Config(rate=0.1)).run(whole[1])


def test_a_checkpoint_that_fails_to_be_written_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def torn(_: object, path: Path) -> None:
        path.write_bytes(b"half a checkp")
        raise OSError(28, "No space left on device")

    killed_at(6, Noisy(Config()), tmp_path)
    before = {p.name: p.read_bytes() for p in tmp_path.glob("*.pt")}
    monkeypatch.setattr(torch, "save", torn)
    with pytest.raises(OSError, match="No space"):
        Noisy(Config()).run(tmp_path)
    assert {p.name: p.read_bytes() for p in tmp_path.glob("*.pt")} == before
    assert not list(tmp_path.glob("*.tmp"))


def test_a_broken_newest_checkpoint_gives_way_to_the_one_before(tmp_path: Path, whole: tuple[Noisy, Path]) -> None:
    Noisy(Config()).run(tmp_path)
    (tmp_path / "checkpoint-000000012.pt").write_bytes(b"broken")
    resumed = Noisy(Config())
    resumed.run(tmp_path)
    assert resumed.losses == {step: whole[0].losses[step] for step in (10, 11)}
    for path in tmp_path.glob("*.pt"):
        path.write_bytes(b"broken")
    with pytest.raises(InputError, match="no checkpoint can be read"):
        Noisy(Config()).run(tmp_path)


def test_the_time_budget_stops_after_a_checkpoint(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert Noisy(Config()).run(tmp_path, max_minutes=0.0) == "out of time"
    assert "step 1 of 12; run the same command again" in capsys.readouterr().err
    assert (tmp_path / "checkpoint-000000001.pt").exists()


def test_a_loss_that_is_not_finite_stops_without_a_checkpoint(tmp_path: Path) -> None:
    noisy = Noisy(Config())
    noisy.step = lambda step: {"loss": float("nan") if step == 3 else 1.0}
    with pytest.raises(InputError, match="loss is not finite at step 4"):
        noisy.run(tmp_path)
    assert not list(tmp_path.glob("*.pt"))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_writes_a_checkpoint_and_says_how_to_go_on(tmp_path: Path, number: signal.Signals) -> None:
    script = f"""
import os, torch
from dataclasses import dataclass
from pathlib import Path
from interpose.train.common import loop
from interpose.train.common.checkpoint import TrainingState

@dataclass(frozen=True)
class Config:
    steps: int = 10

def step(number):
    if number == 3:
        os.kill(os.getpid(), {int(number)})
    return {{"loss": 1.0}}

print(loop.run(Path({str(tmp_path)!r}), Config(), TrainingState({{}}), 10, step))
"""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "interrupted\n"
    assert "interrupted at step 4 of 10; run the same command again" in done.stderr
    assert (tmp_path / "checkpoint-000000004.pt").exists()


def test_cosine_rises_then_falls_to_its_floor() -> None:
    rates = [loop.cosine(step, 100, warmup=10, floor=0.1) for step in range(101)]
    assert rates[0] == pytest.approx(0.1)
    assert rates[9] == rates[10] == 1.0
    assert rates[55] == pytest.approx(0.55)
    assert rates[100] == pytest.approx(0.1)
    assert np.all(np.diff(rates[10:]) < 0)
