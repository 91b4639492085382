"""Feet that come to a key in motion are left free for its first frames; the rest is tested through `inbetween`."""

from pathlib import Path

import numpy as np

from interpose import retarget, rotation
from interpose.motion import Motion
from interpose.runtime import transition
from interpose.runtime.backends.dcmoe import DCMoEBackend
from interpose.runtime.gap_batch import Generated
from interpose.runtime.guidance import Guidance
from interpose.runtime.model_folder import Session
from interpose.runtime.request import Request
from interpose.skeleton import HUMANOID


def test_a_foot_in_motion_at_the_start_key_does_not_stand_there_yet(monkeypatch):
    turns = np.zeros((3, 22, 3))
    turns[0, HUMANOID.index("LeftUpLeg"), 0] = 0.2  # the left leg swings into the key, the right one stands
    local = rotation.from_rotation_vector(turns)
    clip = Motion(HUMANOID, np.tile([0.0, 0.93, 0.0], (3, 1)), local, 30.0)
    asked = []

    def generate(self, model, batch):
        still = (np.repeat(x[:, None], batch.longest, axis=1) for x in (batch.target_root, batch.target_local))
        return Generated(*still, np.ones((len(batch), batch.longest, 4)))

    def plant_batch(root, local, contacts):
        asked.append(contacts.copy())
        return local

    monkeypatch.setattr(DCMoEBackend, "generate", generate)
    monkeypatch.setattr(transition.lock, "plant_batch", plant_batch)
    request = Request("dcmoe", Session(Path("nowhere"), {"name": "stand-in", "method": "dcmoe", "styles": []}))
    for start in (clip[:2], clip[1]):
        transition.generate([start], clip[2], [20], [Guidance(21)], request, retarget.map_skeleton(clip))
    known, lone = asked
    assert not known[0, : transition.LANDING_FRAMES, :2].any()
    assert known[0, : transition.LANDING_FRAMES, 2:].all()
    assert known[0, transition.LANDING_FRAMES :].all()
    assert lone.all()
