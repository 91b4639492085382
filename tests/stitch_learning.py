"""What the tests of stitching share: small networks of random weights that say a lot, as in `learning`, and gaps.

Like those of `learning` the networks are loud: whatever goes in wrongly shows in what they say.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import torch
from learning import STYLES
from torch import nn

from interpose.models.stitching_cvae import Size, StitchingCVAE
from interpose.train import checkpoint, loop
from interpose.train.frames import Frames
from interpose.train.stitch_config import LETTER, PRESETS, Config
from interpose.train.stitch_gaps import set_statistics

_TINY = PRESETS["tiny"]
CONFIG = replace(
    _TINY,
    size=replace(_TINY.size, plan=replace(_TINY.size.plan, styles=len(STYLES))),
    databases=("synthetic 1234",),
    styles=STYLES,
    licence="CC BY 4.0",
)
"""What a run of preset ``tiny`` on `learning`'s database keeps."""


def letter(size: Size) -> Size:
    """The paper's form and latents at that size."""
    return replace(size, form=LETTER.form, latents=LETTER.latents, planned=LETTER.planned)


PAPER = replace(CONFIG, preset="paper", size=letter(CONFIG.size), course=PRESETS["paper"].course)
"""Preset ``paper`` as small as ``tiny``."""


def loud(model: StitchingCVAE) -> StitchingCVAE:
    """The same model, whose every part is heard: last layers wide awake, gates that choose, biases everywhere."""
    with torch.no_grad():
        for module in model.modules():
            if isinstance(module, nn.Linear) and module.bias is not None:
                module.bias.add_(0.3 * torch.randn_like(module.bias))
        for side in (model.front, model.back):
            side.experts[-1].linear.weight.mul_(8.0)
            side.gate[-1].weight.mul_(4.0)
        if model.plan is not None:
            for network in (model.plan.prior, model.plan.posterior, model.plan.decoder):
                network[-1].weight.mul_(10.0)
            model.plan.prior[-1].bias[model.size.latent :] -= 1.0
    return model


def network_for(data: Frames, config: Config = CONFIG, seed: int = 3) -> StitchingCVAE:
    """A loud model of random weights, its features normalised for ``data``."""
    torch.manual_seed(seed)
    model = loud(StitchingCVAE(config.size))
    set_statistics(model, data, config, torch.Generator().manual_seed(0), count=32)
    return model.eval().requires_grad_(False)


def write_run(folder: Path, model: StitchingCVAE, config: Config = CONFIG, step: int = 20) -> Path:
    """A run folder as a training of ``model`` leaves it."""
    folder.mkdir()
    parts = {"model": model, "ema": loop.moving_average(model, 0.9)}
    checkpoint.save(folder, checkpoint.State(parts), step, config)
    return folder
