"""One training on several processes, as ``torchrun`` starts them.

Every process draws the whole batch from the same generator and computes its share of the rows; `torch` averages the
gradients (``DistributedDataParallel``). What several processes give is what one would give, but for rounding and for
what dropout hides. Sums go over gloo where tensors lie on the CPU, over NCCL where they lie on GPUs.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch import Tensor, distributed

from interpose.errors import InputError


@dataclass(frozen=True)
class Group:
    """The processes of a training, and which of them this is."""

    rank: int
    size: int

    @property
    def first(self) -> bool:
        """Whether this is the one that writes."""
        return self.rank == 0

    def share(self, rows: int) -> slice:
        """This process's part of so many rows. Raises InputError where they cannot be shared out evenly."""
        if rows % self.size:
            raise InputError(f"batches of {rows} rows cannot be shared by {self.size} processes; take a divisor of it")
        each = rows // self.size
        return slice(self.rank * each, (self.rank + 1) * each)

    def total(self, x: Tensor) -> Tensor:
        """The sum over all processes, without its gradient."""
        if self.size == 1:
            return x
        out = x.detach().clone()
        distributed.all_reduce(out)
        return out

    def gathered(self, x: Tensor) -> Tensor:
        """Every process's rows, in the order of :meth:`share`, without their gradient."""
        if self.size == 1:
            return x
        parts = [torch.empty_like(x, memory_format=torch.contiguous_format) for _ in range(self.size)]
        distributed.all_gather(parts, x.detach().contiguous())
        return torch.cat(parts)

    def anywhere(self, *flags: bool) -> list[bool]:
        """For each of the flags whether it is set on any process."""
        return (self.total(torch.tensor([float(x) for x in flags])) > 0.0).tolist()

    def wait(self) -> None:
        """Until all have come here."""
        self.total(torch.zeros(1))


ALONE = Group(0, 1)
"""A training on one process."""


def started() -> int:
    """How many processes ``torchrun`` started; 1 without it."""
    return int(os.environ.get("WORLD_SIZE", "1"))


@contextmanager
def processes(device: str) -> Iterator[Group]:
    """Joins what ``torchrun`` started, :data:`ALONE` where it was not used.

    device: ``cuda`` stands inside for the GPU of this process's own number. Raises InputError where there are not
    enough of them, or where one GPU is named for all.
    """
    if started() == 1:
        yield ALONE
        return
    kind, _, number = device.partition(":")
    if kind == "cuda":
        local = int(os.environ.get("LOCAL_RANK", "0"))
        if number:
            raise InputError(f"{started()} processes cannot share {device}; --device cuda gives each its own")
        if local >= torch.cuda.device_count():
            raise InputError(f"process {local + 1} has no GPU, there are {torch.cuda.device_count()}; start fewer")
        torch.cuda.set_device(local)
    distributed.init_process_group("cpu:gloo,cuda:nccl" if kind == "cuda" else "gloo")
    try:
        yield Group(distributed.get_rank(), distributed.get_world_size())
    finally:
        distributed.destroy_process_group()
