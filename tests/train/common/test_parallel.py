"""A training on two processes: that it is the training on one, stopped and resumed together, and what it refuses."""

import json
import os
import socket
import subprocess
import sys
from dataclasses import replace
from functools import partial

import pytest
import torch

from interpose.errors import InputError
from interpose.train.common import checkpoint, loop
from interpose.train.common.parallel import ALONE, Group, processes
from interpose.train.dcmoe import recipe
from interpose.train.dcmoe.recipe import PRESETS, Stage

WORKER = """
import os, signal, sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from interpose.train import dcmoe, loop
import test_parallel

unroll, calls = dcmoe.unroll, []

def interrupted(*args):
    calls.append(None)
    if len(calls) == 4 and os.environ["RANK"] == "1":
        os.kill(os.getpid(), signal.SIGTERM)
    return unroll(*args)

dcmoe.unroll = interrupted
for port in sys.argv[3:]:
    os.environ["MASTER_PORT"] = port
    print(test_parallel.trained(Path(sys.argv[1]), Path(sys.argv[2])))
"""


def trained(data, out):
    """A few updates of the planner, of steps by themselves and of roll-outs that go on; every loss is logged."""
    tiny = PRESETS["tiny"]
    config = replace(
        tiny,
        planner=replace(tiny.planner, dropout=0.0),
        planning=replace(tiny.planning, steps=3, rows=8),
        stages=(Stage(2, 1, 8), Stage(4, 3, 8)),
        sampling=replace(tiny.sampling, longest=20),  # gaps that end on the way, more in one half than in the other
    )
    torch.set_num_threads(1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop, "run", partial(loop.run, log_every=1))
        patch.setattr(recipe, "set_statistics", partial(recipe.set_statistics, count=512))
        return recipe.train([data], out, config=config)


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
def two(database, tmp_path):
    """Two processes that train into a folder `two`, stopped once on the way."""
    arguments = [sys.executable, "-c", WORKER, str(database.path), str(tmp_path / "two"), *ports(2)]
    environment = os.environ | {"WORLD_SIZE": "2", "MASTER_ADDR": "127.0.0.1", "OMP_NUM_THREADS": "1"}
    environment["PYTHONPATH"] = os.pathsep.join([os.path.dirname(__file__), *sys.path])
    running = [
        subprocess.Popen(
            arguments,
            env=environment | {"RANK": str(rank)},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for rank in range(2)
    ]
    yield running
    for process in running:
        process.kill()
        process.communicate()


def test_two_processes_train_as_one_does(two, database, tmp_path):
    assert trained(database.path, tmp_path / "one") == "finished"
    said = [each.communicate(timeout=300) for each in two]
    assert [out.split() for out, _ in said] == [["interrupted", "finished"]] * 2, said
    assert "interrupted at step 7 of 9" in said[0][1]
    assert said[1][1] == ""  # the second process says nothing
    one, two = (
        [json.loads(line) for line in (tmp_path / name / "metrics.jsonl").read_text().splitlines()]
        for name in ("one", "two")
    )
    assert [line["step"] for line in two] == list(range(1, 10))
    for wanted, got in zip(one, two, strict=True):
        assert got == pytest.approx(wanted, rel=1e-5, abs=1e-6)
    one, two = checkpoint.load(tmp_path / "one"), checkpoint.load(tmp_path / "two")
    for name, value in one["extra"]["rows"].items():
        torch.testing.assert_close(two["extra"]["rows"][name], value, atol=1e-4, rtol=1e-4, msg=name)
    for part in ("model", "ema"):
        for name, value in one[part].items():
            torch.testing.assert_close(two[part][name], value, atol=1e-4, rtol=1e-4, msg=name)
    assert torch.equal(one["random"]["generators"]["rows"], two["random"]["generators"]["rows"])


def test_rows_are_shared_out_evenly_or_not_at_all():
    shares = [Group(rank, 3).share(12) for rank in range(3)]
    assert [list(range(12))[share] for share in shares] == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9, 10, 11]]
    with pytest.raises(InputError, match="batches of 8 rows cannot be shared by 3 processes"):
        Group(0, 3).share(8)


def test_one_process_alone_asks_nobody(monkeypatch):
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
