"""A gallery that can be bundled with a model: root tracks of motion that the model generated, not of recordings.

The keys, half a second to three apart, are those of a database's clips; the result is sampled half-way between its
frames, so that no frame of it is recorded. `interpose gallery generate` runs this.
"""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np

from interpose.data.database import Database
from interpose.errors import InputError
from interpose.gallery import store
from interpose.gallery.tracks import Tracks, from_motions
from interpose.io.files import write_whole
from interpose.motion import Motion, concatenate, sample
from interpose.runtime.backends.backend import backend_of
from interpose.runtime.gap_batch import batch_of
from interpose.runtime.model_folder import Session
from interpose.runtime.resampling import CONTEXT, MODEL_RATE
from interpose.skeleton import HUMANOID

GALLERY_FRAMES = 18_000
"""Frames of a bundled gallery; its index is ready in a quarter of a second."""
GAP_STEPS = (15, 90)
"""Steps between keys, at least and at most."""
CHAIN_STEPS = 600
"""Steps of a chain at most."""
SHORTEST_CLIP = 2 * GAP_STEPS[1]
"""Frames that a clip must have to carry one."""


def add_gallery(
    session: Session,
    database: Database,
    frames: int = GALLERY_FRAMES,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> store.Gallery:
    """Writes `gallery.npz` into the model's folder and its origin into `model.json`.

    Raises InputError where ``frames`` is too few, no clip is long enough, or the folder cannot be written to.
    """
    if frames < CHAIN_STEPS:
        raise InputError(f"a gallery of {frames} frames is too small; ask for {CHAIN_STEPS} or more")
    made = tracks(session, database, frames, seed, progress)
    keys = f"key poses of {database.dataset} {database.fingerprint[:12]}".strip()
    info = {
        "made_from": f"motion that the model '{session.name}' generated between {keys}; no recorded frame is in it",
        "licence": session.info["licence"],
        "frames": len(made),
        "seed": seed,
    }
    store.save_small(made, info, session.path / "gallery.npz")
    info_with = session.info | {"gallery": {**info, "styles": list(made.styles)}}
    write_whole(session.path / "model.json", (json.dumps(info_with, indent=2) + "\n").encode())
    return store.load(session.path / "gallery.npz")


def tracks(
    session: Session,
    database: Database,
    frames: int,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Tracks:
    """About ``frames`` frames of the model's motion along the clips of a database, evenly over its styles.

    Raises InputError where no clip is long enough.
    """
    draw = np.random.default_rng(seed)
    chains = _chains(database, frames, draw)
    if not chains:
        raise InputError(
            f"{database.path}: no clip is longer than {SHORTEST_CLIP} frames; chains of gaps need longer ones"
        )
    labels = [database.clips[clip].style for clip, _ in chains]
    styles = [label if label in session.styles else None for label in labels]
    keys = [keys for _, keys in chains]
    made = [database.motion(k[0], k[0] + 1) for k in keys]
    rounds = max(map(len, keys)) - 1
    for turn in range(rounds):
        progress(turn, rounds)
        rows = [row for row, k in enumerate(keys) if len(k) > turn + 1]
        context = [made[row][-CONTEXT if turn else -1 :] for row in rows]
        target = [database.motion(keys[row][turn + 1], keys[row][turn + 1] + 1) for row in rows]
        gaps = [keys[row][turn + 1] - keys[row][turn] - 1 for row in rows]
        new = backend_of(session.method).generate(
            session,
            batch_of(
                (np.stack([c.root_positions for c in context]), np.stack([c.local_rotations for c in context])),
                (np.stack([t.root_positions for t in target]), np.stack([t.local_rotations for t in target])),
                gaps,
                styles=[styles[row] for row in rows],
            ),
        )
        for i, row in enumerate(rows):
            gap = Motion(HUMANOID, new.root[i, : gaps[i]], new.local[i, : gaps[i]], MODEL_RATE)
            made[row] = concatenate(made[row], gap, target[i])
    progress(rounds, rounds)
    return from_motions([sample(motion, np.arange(len(motion) - 1) + 0.5) for motion in made], labels)


def _chains(database: Database, frames: int, draw: np.random.Generator) -> list[tuple[int, list[int]]]:
    """A clip and its key frames for each chain, until every style has its share or its clips are used up."""
    labels, out = database.style_indices(), []
    styles = np.unique(labels)
    for style in styles:
        clips = [c for c in np.nonzero(labels == style)[0].tolist() if np.diff(database.ranges[c])[0] >= SHORTEST_CLIP]
        wanted, order = frames // len(styles), draw.permutation(clips).tolist()
        lasts = {clip: int(database.ranges[clip, 0]) for clip in clips}
        while wanted > 0 and order:
            clip = order.pop(0)
            stop = int(database.ranges[clip, 1])
            keys = [lasts[clip]]
            while keys[-1] - keys[0] < min(CHAIN_STEPS, wanted + GAP_STEPS[1]):
                following = keys[-1] + int(draw.integers(GAP_STEPS[0], GAP_STEPS[1] + 1))
                if following >= stop:
                    break
                keys.append(following)
            if keys[-1] - keys[0] < GAP_STEPS[1]:
                continue
            out.append((clip, keys))
            wanted -= keys[-1] - keys[0]
            lasts[clip] = keys[-1] + 1
            order.append(clip)
    return out
