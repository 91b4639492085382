"""The phases of a database: what the periodic autoencoder sees of each clip, and what it makes of it.

Its input is the velocity of each joint in the character's root frame, V_i = (P_i in R_i - P_(i-1) in R_(i-1)) / dt,
low-passed over the whole clip at 3.25 Hz by a Butterworth filter of second order run forth and back (Starke et al.
2022, section 4.1). A window of two seconds is centred at each frame; beyond the ends of a clip the
end repeats.

Phases are training data only: a model that starts from a lone pose starts with unknown phases, so the autoencoder is
neither exported nor needed at run time.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, Float16, Int
from numpy import ndarray
from scipy.signal import butter, sosfiltfilt
from torch import Tensor

from interpose.data.database import Database
from interpose.models.periodic_autoencoder import PeriodicAutoencoder, Phase
from interpose.motion import velocities
from interpose.skeleton import MIRROR, MODEL_RATE
from interpose.train.common.checkpoint import write_atomically

CUT_OFF = 3.25
"""Hz: half the 13 keys in the 2 seconds around a frame, the fastest that those keys can hold."""

_MIRRORED = torch.tensor([3 * joint + axis for joint in MIRROR for axis in range(3)])
_SIGNS = torch.tensor([-1.0, 1.0, 1.0]).repeat(len(MIRROR))


@dataclass(frozen=True, eq=False)
class Curves:
    """The velocity curves of all clips, m/s, and for each frame the first and the last frame of its clip."""

    values: Float[Tensor, "frame 66"]
    first: Int[Tensor, "frame"]
    last: Int[Tensor, "frame"]

    def __len__(self) -> int:
        return len(self.values)


def velocity_curves(*databases: Database) -> Curves:
    """The low-passed velocities of one or more databases, one after the other."""
    values, first, last, count = [], [], [], 0
    for data in databases:
        for clip, (start, stop) in enumerate(data.ranges):
            placed = in_root_frame(data.clip(clip).global_positions(), data.root[start:stop].astype(float))
            passed = low_pass(velocities(placed, MODEL_RATE), MODEL_RATE)
            values.append(passed.reshape(stop - start, -1).astype(np.float32))
            first.append(np.full(stop - start, count))
            last.append(np.full(stop - start, count + stop - start - 1))
            count += stop - start
    return Curves(
        torch.from_numpy(np.concatenate(values)),
        torch.from_numpy(np.concatenate(first)),
        torch.from_numpy(np.concatenate(last)),
    )


def in_root_frame(
    positions: Float[ndarray, "frame joint 3"], root: Float[ndarray, "frame 4"]
) -> Float[ndarray, "frame joint 3"]:
    """World positions as seen from the root (x, z, facing x, facing z): its facing is +Z, its left +X."""
    x, z = (positions[..., 0] - root[:, None, 0], positions[..., 2] - root[:, None, 1])
    sine, cosine = root[:, None, 2], root[:, None, 3]
    return np.stack([x * cosine - z * sine, positions[..., 1], x * sine + z * cosine], axis=-1)


def low_pass(curves: Float[ndarray, "frame *rest"], rate: float) -> Float[ndarray, "frame *rest"]:
    """The curves without what is faster than :data:`CUT_OFF`, not shifted in time."""
    sections = butter(2, CUT_OFF, fs=rate, output="sos")
    return sosfiltfilt(sections, curves, axis=0, padlen=min(15, len(curves) - 1))


def windows(
    curves: Curves, middle: Int[Tensor, "batch"], mirrored: Bool[Tensor, "batch"], frames: int
) -> Float[Tensor, "batch 66 time"]:
    """The ``frames`` frames centred at each of ``middle``, seen in a mirror where ``mirrored``."""
    reach = torch.arange(frames, device=middle.device) - frames // 2
    index = torch.clamp(middle[:, None] + reach, curves.first[middle][:, None], curves.last[middle][:, None])
    plain = curves.values[index]
    seen = plain[..., _MIRRORED.to(middle.device)] * _SIGNS.to(middle.device)
    return torch.where(mirrored[:, None, None], seen, plain).transpose(1, 2).contiguous()


def phase_features(
    curves: Curves, model: PeriodicAutoencoder, batch: int = 1024
) -> Float16[ndarray, "mirrored frame channel 3"]:
    """For the clips as they are [0] and mirrored [1]: (amplitude sin, amplitude cos, frequency in Hz) of every frame.

    The amplitude is the length of the first two; the phase in turns is ``arctan2(sin, cos) / (2 pi)``.
    """
    features = np.empty((2, len(curves), model.channels, 3), dtype=np.float16)
    for mirrored in (0, 1):
        for start in range(0, len(curves), batch):
            middle = torch.arange(start, min(start + batch, len(curves)), device=curves.values.device)
            phase = encode(curves, model, middle, torch.full_like(middle, mirrored, dtype=torch.bool))
            rows = torch.cat([phase.point(), phase.frequency[..., None]], dim=-1)
            features[mirrored, start : start + batch] = rows.half().cpu().numpy()
    return features


@torch.inference_mode()
def encode(
    curves: Curves, model: PeriodicAutoencoder, middle: Int[Tensor, "batch"], mirrored: Bool[Tensor, "batch"]
) -> Phase:
    """The phase parameters at the given frames."""
    return model.encode(windows(curves, middle, mirrored, model.frames))


def save(features: Float16[ndarray, "mirrored frame channel 3"], path: Path) -> None:
    """Writes phase features as one ``.npy`` array, whole or not at all."""

    def write(temporary: Path) -> None:
        with temporary.open("wb") as file:
            np.save(file, features)

    write_atomically(path, write)
