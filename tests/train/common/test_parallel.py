"""A training on two processes: that it is the training on one, stopped and resumed together, and what it refuses."""

import json
import os
import socket
import subprocess
import sys
from dataclasses import replace
from functools import partial

import learning
import pytest
import torch

from interpose.errors import InputError
from interpose.train.common import checkpoint, loop
from interpose.train.common.parallel import ALONE, Group, processes
from interpose.train.dcmoe import recipe
from interpose.train.dcmoe.config import PRESETS, Stage
from interpose.train.planner import objective
from interpose.train.planner import recipe as planner_recipe
from interpose.train.planner.config import PRESETS as PLAN_PRESETS

WORKER = """
import os, signal, sys
from pathlib import Path
from interpose.train.common import loop
import test_parallel

kind, data, plan, out = sys.argv[1:5]
cosine, calls = loop.cosine, []

def interrupted(*args, **more):
    calls.append(None)
    if len(calls) == 4 and os.environ["RANK"] == "1":
        os.kill(os.getpid(), signal.SIGTERM)
    return cosine(*args, **more)

loop.cosine = interrupted
for port in sys.argv[5:]:
    os.environ["MASTER_PORT"] = port
    print(test_parallel.trained(kind, Path(data), Path(plan), Path(out)))
"""
UPDATES = 6


def trained(kind, data, plan, out):
    """A few updates of the planner, or of steps and of roll-outs that go on along one; every loss is logged."""
    torch.set_num_threads(1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "run", partial(loop.run, log_every=1))
        patch.setattr(recipe, "set_statistics", partial(recipe.set_statistics, count=512))
        patch.setattr(objective, "set_statistics", partial(objective.set_statistics, count=512))
        if kind == "plan":
            tiny = PLAN_PRESETS["tiny"]
            config = replace(tiny, size=replace(tiny.size, dropout=0.0), steps=UPDATES, rows=8)
            return planner_recipe.train([data], out, config=config)
        tiny = PRESETS["tiny"]
        # Gaps that end on the way, more in one half than in the other.
        rule = replace(tiny.sampling, gaps=replace(tiny.sampling.gaps, longest=20))
        config = replace(tiny, stages=(Stage(2, 1, 8), Stage(4, 3, 8)), sampling=rule)
        return recipe.train([data], out, plan=plan, config=config)


def ports(count):
    """Some that are free."""
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    found = [str(each.getsockname()[1]) for each in sockets]
    for each in sockets:
        each.close()
    return found


@pytest.fixture
def two(database, plan, tmp_path):
    """Starts two processes that train into a folder `two`, stopped once on the way; what each printed."""
    running = []

    def start(kind):
        places = [str(database.path), str(plan), str(tmp_path / "two")]
        environment = os.environ | {"WORLD_SIZE": "2", "MASTER_ADDR": "127.0.0.1", "OMP_NUM_THREADS": "1"}
        environment["PYTHONPATH"] = os.pathsep.join([os.path.dirname(__file__), *sys.path])
        arguments = [sys.executable, "-c", WORKER, kind, *places, *ports(2)]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        running.extend(subprocess.Popen(arguments, env=environment | {"RANK": str(rank)}, **pipes) for rank in range(2))
        return [each.communicate(timeout=300) for each in running]

    yield start
    for process in running:
        process.kill()
        process.communicate()


@pytest.fixture
def plan(frames, tmp_path):
    """A run of `interpose train plan`."""
    return learning.write_run(tmp_path / "plan", learning.planner_for(frames), learning.PLANNER)


@pytest.mark.parametrize("kind", ["plan", "dcmoe"])
def test_two_processes_train_as_one_does(kind, two, database, plan, tmp_path):
    assert trained(kind, database.path, plan, tmp_path / "one") == "finished"
    printed = two(kind)
    assert [out.split() for out, _ in printed] == [["interrupted", "finished"]] * 2, printed
    assert f"interrupted at step 4 of {UPDATES}" in printed[0][1]
    assert printed[1][1] == ""  # the second process prints nothing
    one, other = (
        [json.loads(line) for line in (tmp_path / name / "metrics.jsonl").read_text().splitlines()]
        for name in ("one", "two")
    )
    assert [line["step"] for line in other] == list(range(1, UPDATES + 1))
    for wanted, got in zip(one, other, strict=True):
        assert got == pytest.approx(wanted, rel=1e-5, abs=1e-6)
    one, other = checkpoint.load(tmp_path / "one"), checkpoint.load(tmp_path / "two")
    for name, value in one["extra"].get("rows", {}).items():
        torch.testing.assert_close(other["extra"]["rows"][name], value, atol=1e-4, rtol=1e-4, msg=name)
    for part in ("model", "ema"):
        for name, value in one[part].items():
            torch.testing.assert_close(other[part][name], value, atol=1e-4, rtol=1e-4, msg=name)
    assert torch.equal(one["random"]["generators"]["rows"], other["random"]["generators"]["rows"])


def test_rows_are_shared_out_evenly_or_not_at_all():
    shares = [Group(rank, 3).share(12) for rank in range(3)]
    assert [list(range(12))[share] for share in shares] == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]]
    with pytest.raises(InputError, match="batches of 8 rows cannot be shared by 3 processes"):
        Group(0, 3).share(8)


def test_one_process_alone_communicates_with_none(monkeypatch):
    monkeypatch.delenv("WORLD_SIZE", raising=False)
    with processes("cpu") as group:
        assert group is ALONE
        assert not torch.distributed.is_initialized()
        x = torch.ones(3, requires_grad=True)
        assert group.total(x) is x
        assert group.gathered(x) is x
        assert group.anywhere(True, False) == [True, False]


def test_gpus_that_cannot_be_shared(monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "2")
    monkeypatch.setenv("LOCAL_RANK", "1")
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    with pytest.raises(InputError, match="2 processes cannot share cuda:0"), processes("cuda:0"):
        pass
    with pytest.raises(InputError, match="process 2 has no GPU, there are 1"), processes("cuda"):
        pass
