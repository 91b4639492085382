"""The local phases of training: each clip's own."""

from dataclasses import replace

import numpy as np
import torch

from interpose.data.local_phases import local_phases
from interpose.features import RATE
from interpose.train.stitch.phase_targets import phase_targets


def test_each_clip_has_the_phases_of_its_own_contacts(database, frames):
    phases = phase_targets(frames)
    assert phases.shape == (len(frames), 4)
    assert phases.dtype == frames.hips.dtype
    for start, stop in database.ranges:
        wanted = local_phases(np.asarray(database.contacts[start:stop]).astype(float), RATE)
        np.testing.assert_allclose(phases[start:stop], wanted, atol=1e-6)
    mirrored = phases[database.frames :]
    np.testing.assert_allclose(mirrored, phases[: database.frames][:, [2, 3, 0, 1]], atol=1e-6)


def test_what_happens_in_one_clip_is_nothing_to_the_next(database, frames):
    contacts = frames.contacts.clone()
    start, stop = database.ranges[1].tolist()
    contacts[start:stop] = 1.0
    phases = phase_targets(replace(frames, contacts=contacts))
    before = phase_targets(frames)
    torch.testing.assert_close(phases[start:stop], torch.zeros(stop - start, 4), atol=1e-6, rtol=0)
    assert torch.equal(phases[:start], before[:start])
    assert torch.equal(phases[stop:], before[stop:])
    assert float(before.abs().max()) > 0.3
