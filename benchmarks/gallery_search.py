"""What a gallery costs: its size, how long it takes to build and to ask, beside the plain full scan.

    python benchmarks/gallery_search.py DB [--queries N] [--scans N]

DB is a prepared database. Queries are random: 0.1 to 10 m, facings anywhere or (every other one) near the way's own,
the 64 best of a threshold of 40 degrees. *Direct* is one search of the index. *Composed* is Algorithm 1 from where the
direct search has found nothing; such queries are drawn at 5 to 14 m, in any style or in one, of any duration or of
twice the longest window's. The full scan answers the first of the same queries; every answer is compared. All of it
for an eighth, a quarter, a half and all of the clips. One thread.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from functools import partial
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "gallery"))

import full_scan
import numpy as np

from interpose.data import database
from interpose.gallery import matching, proposals, store
from interpose.gallery.matching import Query
from interpose.gallery.tracks import Tracks, from_database
from interpose.gallery.windows import LONGEST_WINDOW, SHORTEST_WINDOW

COUNT = 64


def drawn(draw: np.random.Generator, near: bool, low: float = 0.1, high: float = 10.0) -> Query:
    """A random query; with ``near`` both facings are within some twenty degrees of the way's direction."""
    distance, heading = np.exp(draw.uniform(np.log(low), np.log(high))), draw.uniform(-np.pi, np.pi)
    turns = draw.normal(0.0, 0.35, 2) if near else draw.uniform(-np.pi, np.pi, 2)
    end = float(distance * np.sin(heading)), float(distance * np.cos(heading))
    return Query((0.0, 0.0, float(heading + turns[0])), (*end, float(heading + turns[1])))


def timed(call) -> tuple[float, object]:
    """Milliseconds, and the answer."""
    began = time.perf_counter()
    answer = call()
    return 1e3 * (time.perf_counter() - began), answer


def spread(values: list[float]) -> str:
    return f"{np.median(values):.2f} / {np.quantile(values, 0.95):.2f}" if values else "-"


def same(a, b) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("start", "steps", "mirrored", "error"))


def measure(tracks: Tracks, queries: int, scans: int) -> str:
    """A row of the table."""
    began = time.perf_counter()
    gallery = store.of_tracks(tracks)
    built = time.perf_counter() - began
    draw = np.random.default_rng(0)
    asked = [
        matching.window_query(drawn(draw, bool(i % 2)), (SHORTEST_WINDOW, LONGEST_WINDOW), None) for i in range(queries)
    ]
    for wanted in asked[:10]:
        gallery.search(wanted, COUNT)
    direct = [timed(partial(gallery.search, wanted, COUNT)) for wanted in asked]
    plain = [timed(partial(full_scan.best, tracks, wanted, COUNT)) for wanted in asked[:scans]]
    agree = np.mean([same(a, b) for (_, a), (_, b) in zip(direct, plain, strict=False)])
    whole, composed = 0, []
    for i in range(4 * queries):
        query = drawn(draw, True, 5.0, 14.0)
        styles = (int(draw.integers(len(tracks.styles))),) if i % 2 else None
        steps = (2 * LONGEST_WINDOW, 2 * LONGEST_WINDOW) if i % 4 > 1 else (2 * SHORTEST_WINDOW, 6 * LONGEST_WINDOW)
        lengths = min(steps[0], LONGEST_WINDOW), min(steps[1], LONGEST_WINDOW)
        if steps[0] <= LONGEST_WINDOW and matching.direct(gallery.search, query, 1, lengths, styles):
            continue
        whole += 1
        generator = np.random.default_rng(i)
        taken, trace = timed(
            lambda q=query, g=generator, n=steps, s=styles: matching.compose(
                gallery.search, tracks, gallery.distances, q, g, n, s
            )
        )
        if trace is not None:
            composed.append(taken)
    gaps = [drawn(draw, True, 0.5, 5.0) for _ in range(40)]
    one, eight = (
        np.median(
            [timed(partial(proposals.propose, gallery, gap, proposals.PathRequest(), count=n))[0] for gap in gaps]
        )
        for n in (1, 8)
    )
    size = len(gallery.index)
    return (
        f"| {len(tracks):,} | {2 * size:,} | {gallery.index.nbytes / size:.1f} | {built:.1f} | "
        f"{spread([t for t, _ in direct])} | {spread([t for t, _ in plain])} | {agree:.0%} of {len(plain)} | "
        f"{spread(composed)} | {len(composed)} of {whole} | {one:.1f}, {eight:.1f} |"
    )


def part_of(tracks: Tracks, share: int) -> Tracks:
    """Every so many-th clip."""
    clips = np.arange(0, len(tracks.ranges), share)
    frames = np.concatenate([np.arange(*tracks.ranges[clip]) for clip in clips])
    stops = np.cumsum(np.diff(tracks.ranges[clips], axis=1)[:, 0])
    ranges = np.stack([np.concatenate([[0], stops[:-1]]), stops], axis=1)
    return Tracks(tracks.root[frames], tracks.posture[frames], ranges, tracks.clip_styles[clips], tracks.styles)


def main() -> None:
    parser = argparse.ArgumentParser(description="Times a gallery beside the full scan.")
    parser.add_argument("database", help="a folder of 'interpose prepare'")
    parser.add_argument("--queries", type=int, default=200)
    parser.add_argument("--scans", type=int, default=20, help="queries that the full scan answers, too")
    asked = parser.parse_args()
    tracks = from_database(database.load(asked.database))
    print(
        "| frames | windows, mirrored too | bytes a stored window | built, s | direct, ms: median / p95 "
        "| full scan, ms | the same answers | composed, ms: median / p95 | composed | one, eight proposals, ms |"
    )
    print("|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|")
    for share in (8, 4, 2, 1):
        print(measure(part_of(tracks, share), asked.queries, asked.scans), flush=True)


if __name__ == "__main__":
    main()
