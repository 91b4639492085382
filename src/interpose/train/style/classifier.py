"""Training the style classifier, and what it says of windows; arrays in, arrays out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32, Int
from numpy import ndarray
from torch import Tensor
from torch.nn import functional as F

from interpose.data.style_windows import MIRROR_SIGNS, MIRRORED_CHANNELS
from interpose.models.style_classifier import FRAME_STEP, StyleClassifier

_MIRRORED = torch.tensor(MIRRORED_CHANNELS)
_SIGNS = torch.tensor(MIRROR_SIGNS)


@dataclass(frozen=True)
class Recipe:
    """How a classifier is trained. length: frames of a window. noise: added to its inputs, in deviations. even: draw
    every style as often as every other, not as often as it is there."""

    length: int
    steps: int = 600
    batch: int = 64
    learning_rate: float = 2e-3
    weight_decay: float = 1e-2
    noise: float = 0.2
    even: bool = True


def fit(
    seen: Float32[ndarray, "frame channel"],
    starts: Int[ndarray, "window"],
    labels: Int[ndarray, "window"],
    classes: int,
    recipe: Recipe,
    seed: int = 0,
) -> StyleClassifier:
    """A classifier of ``classes`` labels, trained on the windows that begin at ``starts``, half of them mirrored."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return _fit(torch.from_numpy(seen), torch.from_numpy(starts), torch.from_numpy(labels), classes, recipe)


def _fit(seen: Tensor, starts: Tensor, labels: Tensor, classes: int, recipe: Recipe) -> StyleClassifier:
    model = StyleClassifier(classes, recipe.length)
    frames = seen[(starts[:, None] + torch.arange(0, recipe.length, 6)).flatten()]
    both = torch.cat([frames, frames[:, _MIRRORED] * _SIGNS])
    model.mean.copy_(both.mean(dim=0))
    model.deviation.copy_(both.std(dim=0) + 0.05)
    often = labels.bincount(minlength=classes)[labels].double()
    share = 1.0 / often if recipe.even else torch.ones_like(often)
    optimizer = torch.optim.AdamW(model.parameters(), lr=recipe.learning_rate, weight_decay=recipe.weight_decay)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, recipe.learning_rate, total_steps=recipe.steps)
    for _ in range(recipe.steps):
        rows = torch.multinomial(share, recipe.batch, replacement=True)
        windows = _windows(seen, starts[rows], recipe.length)
        turned = torch.rand(recipe.batch, 1, 1) < 0.5
        windows = torch.where(turned, windows[..., _MIRRORED] * _SIGNS, windows)
        windows = windows + recipe.noise * model.deviation * torch.randn_like(windows)
        loss = F.cross_entropy(model(windows), labels[rows])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    return model.eval().requires_grad_(False)


@torch.inference_mode()
def probabilities(
    model: StyleClassifier, seen: Float32[ndarray, "frame channel"], starts: Int[ndarray, "window"]
) -> Float[ndarray, "window style"]:
    """What the classifier makes of windows: the mean over each and its mirror image."""
    frames, out = torch.from_numpy(seen), []
    for part in torch.from_numpy(starts).split(1024):
        windows = _windows(frames, part, model.length)
        both = model(windows).softmax(dim=1) + model(windows[..., _MIRRORED] * _SIGNS).softmax(dim=1)
        out.append(0.5 * both.double().numpy())
    return np.concatenate(out) if out else np.zeros((0, model.head.out_features))


def _windows(seen: Tensor, starts: Tensor, length: int) -> Tensor:
    return seen[starts[:, None] + torch.arange(0, length, FRAME_STEP)]
