"""The local phases that the phase networks of S-CVAE learn to predict, for frames that lie on the device."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor

from interpose.data.local_phases import local_phases
from interpose.features import RATE
from interpose.train.common.frames import Frames


def phase_targets(data: Frames) -> Float[Tensor, "frame 4"]:
    """The local phases of every frame, each clip by itself."""
    first = torch.unique(data.first).tolist()
    contacts = data.contacts.cpu().numpy().astype(float)
    parts = [local_phases(contacts[a : int(data.last[a]) + 1], RATE) for a in first]
    out = torch.cat([torch.from_numpy(part) for part in parts])
    return out.to(data.hips)
