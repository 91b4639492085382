"""Local phases: each foot's phase in its cycle of stance and swing (Starke et al. 2020, `Local Motion Phases`)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.signal import fftconvolve

PHASE_WINDOW_SECONDS = 0.5
"""Standard deviation of the Gaussian window."""
PHASE_FREQUENCIES = np.geomspace(0.4, 3.0, 24)
"""Hertz."""


def local_phases(contacts: Float[ndarray, "frame 4"], rate: float) -> Float[ndarray, "frame 4"]:
    """(sine, cosine) of the left and of the right foot, times the amplitude, 0 to about 0.6.

    A sinusoid is fitted to each foot's contacts in a window around every frame, in closed form: the windowed Fourier
    component of the best frequency. The cosine is 1 in the middle of a contact. The amplitude is 0 for a foot that only
    stands or only swings.

    contacts: LeftFoot, LeftToe, RightFoot, RightToe, 0 to 1; a foot is in contact when either of its joints is.
    """
    down = contacts.reshape(len(contacts), 2, 2).max(axis=-1)
    reach = int(np.ceil(3.0 * PHASE_WINDOW_SECONDS * rate))
    time = np.arange(-reach, reach + 1) / rate
    window = np.exp(-0.5 * (time / PHASE_WINDOW_SECONDS) ** 2)
    padded = np.pad(down, ((reach, reach), (0, 0)), mode="edge")
    mean = fftconvolve(padded, (window / window.sum())[:, None], mode="valid", axes=0)
    turns = window * np.exp(2j * np.pi * PHASE_FREQUENCIES[:, None] * time)  # convolution runs backwards in time
    found = np.stack([fftconvolve(padded, turn[:, None], mode="valid", axes=0) for turn in turns])
    # Remove the mean from every component: the window's transform is not zero at low frequencies.
    found = (found - mean * turns.sum(axis=-1)[:, None, None]) * (2.0 / window.sum())
    best = np.take_along_axis(found, np.abs(found).argmax(axis=0)[None], axis=0)[0]
    return np.stack([best.imag, best.real], axis=-1).reshape(len(contacts), 4)
