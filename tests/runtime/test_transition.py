"""Feet that come to a key in motion are left free for its first frames; the rest is tested through `inbetween`."""

from pathlib import Path

import numpy as np

from interpose import retarget, rotation
from interpose.motion import Motion
from interpose.runtime import transition
from interpose.runtime.guidance import Plan
from interpose.runtime.model_folder import Session
from interpose.skeleton import HUMANOID


def test_a_foot_in_motion_at_the_start_key_does_not_stand_there_yet(monkeypatch):
    turns = np.zeros((3, 22, 3))
    turns[0, HUMANOID.index("LeftUpLeg"), 0] = 0.2  # the left leg swings into the key, the right one stands
    local = rotation.from_rotation_vector(turns)
    clip = Motion(HUMANOID, np.tile([0.0, 0.93, 0.0], (3, 1)), local, 30.0)
    asked = []

    def generate_batch(session, start_root, start_local, target_root, target_local, each, **_):
        (frames,) = each
        still = np.repeat(target_root[:, None], frames, axis=1), np.repeat(target_local[:, None], frames, axis=1)
        return *still, np.ones((len(start_root), frames, 4))

    def plant_batch(root, local, contacts):
        asked.append(contacts.copy())
        return local

    monkeypatch.setattr(transition.dcmoe, "generate_batch", generate_batch)
    monkeypatch.setattr(transition.lock, "plant_batch", plant_batch)
    session = Session(Path("nowhere"), {"name": "stand-in", "method": "dcmoe", "styles": [], "absolute": False})
    for start in (clip[:2], clip[1]):
        transition.generate([start], clip[2], [20], [Plan(21)], session, retarget.map_skeleton(clip))
    known, lone = asked
    assert not known[0, : transition.LANDING, :2].any()
    assert known[0, : transition.LANDING, 2:].all()
    assert known[0, transition.LANDING :].all()
    assert lone.all()
