"""Figures of phases: the manifold of several clips, and the phases of one clip over time.

A good autoencoder shows rings, one turn a step cycle, and phases that rise steadily where the amplitude is not small.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float16, Float32, Int64
from numpy import ndarray

from interpose.data.database import Database
from interpose.skeleton import MODEL_RATE
from interpose.train.common.checkpoint import write_atomically


def manifold(
    features: Float16[ndarray, "frame channel 3"], data: Database, path: Path, clips: int = 8, frames: int = 240
) -> None:
    """A PNG of the phase vectors of a few clips on their two principal components: coloured by clip, and by phase.

    The clips are spread over the database; of each, the ``frames`` frames around its middle are drawn. The phase shown
    is that of the channel with the greatest amplitude.
    """
    picked = np.unique(np.linspace(0, len(data) - 1, clips).astype(int))
    spans = [_middle(data.ranges[clip], frames) for clip in picked]
    points = [features[start:stop, :, :2].astype(np.float32) for start, stop in spans]
    together = np.concatenate(points)
    flat = together.reshape(len(together), -1)
    centre = flat.mean(axis=0)
    axes = np.linalg.svd(flat - centre, full_matrices=False)[2][:2].T
    strongest = int(np.argmax(np.mean(np.linalg.norm(together, axis=-1), axis=0)))
    turns = _turns(together[:, strongest])

    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 6.5), layout="constrained")
    by_clip, by_phase = figure.subplots(1, 2)
    drawn = by_phase.scatter(*(flat - centre).dot(axes).T, c=turns, cmap="hsv", vmin=-0.5, vmax=0.5, s=5)
    for clip, p in zip(picked, points, strict=True):
        by_clip.plot(*(p.reshape(len(p), -1) - centre).dot(axes).T, linewidth=1, label=data.clips[clip].name)
    by_clip.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3)
    by_clip.set_title("phase vectors, by clip")
    by_phase.set_title(f"by the phase of channel {strongest}")
    figure.colorbar(drawn, ax=by_phase, label="turns")
    for axis in (by_clip, by_phase):
        axis.set(xlabel="first principal component", ylabel="second", aspect="equal")
    write_atomically(path, lambda temporary: figure.savefig(temporary, format="png", dpi=110))


def clip(
    features: Float16[ndarray, "frame channel 3"], data: Database, path: Path, *, index: int | None = None
) -> None:
    """A PNG of six seconds of a clip, a row a channel: the manifold point and the amplitude, the phase, the frequency.

    The clip is that of ``index``, else the one that moves on the ground the farthest a frame.
    """
    if index is None:
        index = int(np.argmax([np.mean(_pace(data, clip)) for clip in range(len(data))]))
    start, stop = _middle(data.ranges[index], frames=180)
    points, frequency = features[start:stop, :, :2].astype(np.float32), features[start:stop, :, 2].astype(np.float32)
    seconds = np.arange(stop - start) / MODEL_RATE
    amplitude = np.linalg.norm(points, axis=-1)

    from matplotlib.figure import Figure

    channels = features.shape[1]
    figure = Figure(figsize=(13, 1.2 * channels + 1), layout="constrained")
    axes = figure.subplots(channels, 3, sharex=True, squeeze=False)
    for channel, (manifold, phase, speed) in enumerate(axes):
        manifold.plot(seconds, points[:, channel, 0], seconds, points[:, channel, 1], linewidth=1)
        manifold.fill_between(seconds, -amplitude[:, channel], amplitude[:, channel], color="0.9")
        manifold.set_ylim(-1.1 * amplitude.max(), 1.1 * amplitude.max())
        manifold.set_ylabel(str(channel), rotation=0)
        phase.plot(seconds, _turns(points[:, channel]), ".", markersize=2)
        phase.set_ylim(-0.55, 0.55)
        speed.plot(seconds, frequency[:, channel], linewidth=1)
        speed.set_ylim(0.0, max(3.5, 1.05 * float(frequency.max())))
    for axis, title in zip(axes[0], ("A sin, A cos, ±A", "phase S, turns", "frequency F, Hz"), strict=True):
        axis.set_title(title)
    for axis in axes[-1]:
        axis.set_xlabel("seconds")
    figure.suptitle(data.clips[index].name)
    write_atomically(path, lambda temporary: figure.savefig(temporary, format="png", dpi=90))


def _middle(span: Int64[ndarray, "2"], frames: int) -> tuple[int, int]:
    """The ``frames`` frames in the middle of a range, or all of it where it is shorter."""
    start, stop = int(span[0]), int(span[1])
    begin = start + max(0, stop - start - frames) // 2
    return begin, min(stop, begin + frames)


def _turns(points: Float32[ndarray, "frame 2"]) -> Float32[ndarray, "frame"]:
    return np.arctan2(points[:, 0], points[:, 1]) / np.float32(2.0 * np.pi)


def _pace(data: Database, clip: int) -> Float32[ndarray, "frame"]:
    start, stop = data.ranges[clip]
    return np.linalg.norm(np.diff(data.root[start:stop, :2], axis=0, prepend=data.root[start : start + 1, :2]), axis=-1)
