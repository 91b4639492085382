"""Fills real clips with keys every 45 frames and measures the result.

    python benchmarks/fill_quality.py DATA [OUT] [MODEL]

DATA is the folder with lafan1/, 100style/ and bandai-namco-1/. For each clip: whether skeleton and rate are kept and
key rows identical to the last digit, the arrival error, the acceleration around the keys beside the clip's own, foot
slide beside the clip's own. OUT gets the filled clips and a contact sheet each.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from fill_measures import fill_quality

from interpose import Motion, io, load_model
from interpose.render import SheetRow, contact_sheet
from interpose.runtime.inbetween import fill
from interpose.runtime.request import Request

CLIPS = (
    ("lafan1/obstacles1_subject5.bvh", 1000, 45),
    ("100style/Angry_FW.bvh", 600, 45),
    ("bandai-namco-1/dataset-1_walk_not-confident_001.bvh", 60, 45),
)
"""Clip, first key, frames between keys."""
GAPS = 6


def main(data: Path, out: Path, model: str | None = None) -> None:
    """Prints the table."""
    session = load_model(model).session
    out.mkdir(parents=True, exist_ok=True)
    print("| clip | rate | keys identical | arrival, m | acceleration at keys: mean, max | own: mean, p95, max |")
    print("|---|---|---|---|---|---|")
    slides = []
    for name, first, step in CLIPS:
        clip = io.read(data / name)
        last = min(first + GAPS * step, len(clip) - 1)
        keys = list(range(first, last + 1, step))
        filled = fill(clip, keys, Request(session.method, session))[0]
        target = out / Path(name).name
        io.write(target, filled.motion, unchanged_rows={k: k for k in keys})
        rows, made = _rows(data / name), _rows(target)
        same = all(rows[k] == made[k] for k in keys)
        back = io.read(target)
        assert back.skeleton == clip.skeleton
        assert back.rate == clip.rate
        quality = fill_quality(clip, back, [k for k in range(len(clip)) if k in keys or not keys[0] < k < keys[-1]])
        own = _accelerations(clip)
        arrival = max(g.arrival_position_error_m for g in filled.gaps)
        at = quality.key_accelerations
        print(
            f"| {Path(name).stem} | {clip.rate:g} Hz | {'yes' if same else 'NO'} | {arrival:g} | "
            f"{at.mean():.1f} / {at.max():.1f} | {own.mean():.1f} / {np.quantile(own, 0.95):.1f} / {own.max():.1f} |"
        )
        slides.append((Path(name).stem, quality.foot_slide, quality.clip_foot_slide))
        sheet = []
        for k in keys[:-1][:3]:
            sheet += [SheetRow(clip[k : k + step + 1], f"capture {k}"), SheetRow(back[k : k + step + 1], f"filled {k}")]
        contact_sheet(out / f"{Path(name).stem}.png", sheet, heading=Path(name).stem)
    print("\n| clip | foot slide, cm a frame | the clip's own |\n|---|---|---|")
    for name, made_slide, own_slide in slides:
        print(f"| {name} | {made_slide:.2f} | {own_slide:.2f} |")


def _rows(path: Path) -> list[bytes]:
    """The lines of a BVH file's motion."""
    lines = path.read_bytes().split(b"MOTION", 1)[1].split(b"\n")
    return [line.strip() for line in lines[3:] if line.strip()]


def _accelerations(clip: Motion) -> np.ndarray:
    """Mean over joints of the second difference, m/s^2, for each inner frame."""
    bend = np.diff(clip.global_positions(), n=2, axis=0) * clip.rate**2
    return np.linalg.norm(bend, axis=-1).mean(axis=-1)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2] if len(sys.argv) > 2 else "out/fill"), *sys.argv[3:4])
