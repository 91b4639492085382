"""One update of the weights, the same in every recipe."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel


def adamw(parameters: Iterable[nn.Parameter], rate: float, decay: float) -> torch.optim.AdamW:
    """AdamW (Loshchilov and Hutter 2019) in one kernel: three times as fast on a CPU."""
    return torch.optim.AdamW(parameters, lr=rate, weight_decay=decay, fused=True)


def descend(
    total: Tensor,
    parts: Iterable[nn.Module],
    optimizer: torch.optim.Optimizer,
    average: AveragedModel,
    model: nn.Module,
    clip: float,
) -> None:
    """A step down the gradient of ``total``, clipped in each of ``parts`` by itself, then of the moving average."""
    optimizer.zero_grad(set_to_none=True)
    total.backward()
    for part in parts:
        torch.nn.utils.clip_grad_norm_(part.parameters(), clip)
    optimizer.step()
    average.update_parameters(model)


def scalars(total: Tensor, each: Mapping[str, Tensor]) -> dict[str, Tensor | float]:
    """What an update logs: the loss and its terms."""
    return {"loss": total.detach(), **{name: value.detach() for name, value in each.items()}}
