"""What a frame of many characters costs, and how smoothly a stream takes changes of its target.

    python benchmarks/streams.py [--repeats N] [--model DIR]
    python benchmarks/streams.py --quality 12 [--model NAME]

The first form times 1, 8 and 64 characters on one thread, with a network of random weights of the paper's size (16
experts x 512) or with ``--model``: the network alone, the whole frame on the 22 joints while all go on as they were,
with feet held, on a rig of 31 joints, and where every character's target moves in every frame (the network then runs
for the former courses too). The second form walks a character over so many courses, disturbs it in mid-way, and tells
the largest acceleration of a joint around the change beside that of the undisturbed rest, and how far feet slide.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from step import feed, random_model, seconds

from interpose import rotation
from interpose.demo import poses
from interpose.motion import Motion, concatenate
from interpose.runtime.model_folder import Session, load
from interpose.runtime.streaming.streams import Stream, Streams
from interpose.skeleton import HUMANOID, Skeleton

CROWDS = (1, 8, 64)
CHANGE, AROUND = 25, 4


def rig(spare: bool) -> Callable[[Motion], Motion]:
    """Poses as they are, or on a skeleton with nine joints more that no model knows."""
    if not spare:
        return lambda pose: pose
    hands = [HUMANOID.index(f"{side}Hand") for side in ("Left", "Right")]
    names = (*HUMANOID.names, *(f"Finger{i}" for i in range(9)))
    skeleton = Skeleton(
        names,
        (*HUMANOID.parents, *(hands[i % 2] for i in range(9))),
        np.concatenate([HUMANOID.offsets, np.full((9, 3), 0.02)]),
    )

    def carried(pose: Motion) -> Motion:
        still = np.tile(rotation.IDENTITY, (len(pose), 9, 1))
        return Motion(skeleton, pose.root_positions, np.concatenate([pose.local_rotations, still], axis=1), pose.rate)

    return carried


def crowd(session: Session, count: int, spare: bool = False, plant: bool = False) -> tuple[Streams, list[Motion]]:
    """So many characters, standing, and a target two metres ahead for each."""
    to_rig = rig(spare)
    starts = [to_rig(poses.pose(poses.STAND, (1.5 * (i % 8), 2.0 * (i // 8)))) for i in range(count)]
    goals = [to_rig(poses.pose(poses.WALK_LEFT, (1.5 * (i % 8), 2.0 * (i // 8) + 2.0))) for i in range(count)]
    return Streams(session, starts, plant=plant), goals


def moved(goal: Motion, way: float) -> Motion:
    return replace(goal, root_positions=goal.root_positions + np.array([way, 0.0, 0.0]))


def frame_times(session: Session, count: int, repeats: int, kind: str) -> np.ndarray:
    """Milliseconds of each of so many frames: on a steady course, or with all targets moving ("steered")."""
    streams, goals = crowd(session, count, kind == "spare joints", kind == "feet held")
    left = [3.0 + repeats / 30.0]

    def step() -> None:
        left[0] -= 1.0 / 30.0
        aims = [moved(goal, 0.01 * left[0]) for goal in goals] if kind == "steered" else goals
        streams.step(aims, left[0])

    return 1e3 * seconds(step, repeats)


def timings(session: Session, repeats: int) -> None:
    print(f"{session.name}: ms a frame, best and median of {repeats}")
    print(f"{'characters':14}" + "".join(f"{count:>16}" for count in CROWDS))

    def row(name: str, taken: list[np.ndarray]) -> None:
        print(f"{name:14}" + "".join(f"{t.min():>8.2f}{np.median(t):>8.2f}" for t in taken))

    fed = [feed(session, count) for count in CROWDS]
    row("network alone", [1e3 * seconds(lambda f=f: session.step(f), repeats) for f in fed])
    for kind in ("whole frame", "feet held", "spare joints", "steered"):
        row(kind, [frame_times(session, count, repeats, kind) for count in CROWDS])


def walked(session: Session, course: int, change: str, plant: bool = False) -> tuple[Motion, np.ndarray]:
    """Poses and contacts of a course of 90 frames: undisturbed, changed at frame CHANGE or, steered, in every one."""
    draw = np.random.default_rng(course)
    place, heading = draw.uniform(-1.2, 1.2), draw.uniform(-60.0, 60.0)
    goal = poses.pose(poses.WALK_LEFT if course % 2 else poses.WALK_RIGHT, (place, 2.2), heading=heading)
    other = poses.pose(poses.WALK_RIGHT, (place + 1.2, 1.4), heading=heading + 80.0)
    stream = Stream(session, poses.pose(poses.STAND), plant=plant)
    made, contacts, arrive = [stream.pose], [], 60
    for frame in range(90):
        aim = goal
        if frame >= 60:  # on to the next target without a stop
            aim, arrive = poses.pose(poses.WALK_LEFT, (place, 4.4), heading=heading), 120
        elif frame >= CHANGE:
            if change == "target":
                aim = other
            elif change == "style":
                stream.style = session.styles[1]
            elif change == "time, less":
                arrive = 45 if frame < 45 else 60
            elif change == "time, up and down":
                arrive = 60 + (8 if frame % 4 < 2 else -8) * (frame < 45)
        if change == "steered" and frame < 60:
            aim = moved(goal, 0.04 * frame - 1.2)
        made.append(stream.step(aim, max(1, arrive - frame) / 30.0))
        contacts.append(stream.contacts)
    return concatenate(*made), np.stack(contacts)


def slide(motion: Motion, contacts: np.ndarray) -> float:
    """Centimetres a frame that a toe moves along the ground while the network says that it stands."""
    toes = motion.global_positions()[:, [HUMANOID.index("LeftToe"), HUMANOID.index("RightToe")]]
    way = np.linalg.norm(np.diff(toes[..., ::2], axis=0), axis=-1)
    return 100.0 * float(way[contacts[:, [1, 3]] > 0.5].mean())


def quality(session: Session, courses: int) -> None:
    print(f"{session.name}: the largest acceleration of a joint, m/s2, mean over {courses} courses")
    print(f"{'change':20}{'around it':>12}{'undisturbed':>14}{'toe slide, cm/frame':>22}{'feet held':>12}")
    straight = [walked(session, course, "none") for course in range(courses)]
    for change in ("none", "target", "style", "time, less", "time, up and down", "steered", "arrival"):
        rows = []
        for course in range(courses):
            still = straight[course]
            motion = still if change == "arrival" else walked(session, course, change)
            a, b = (
                np.linalg.norm(np.diff(m.global_positions(), n=2, axis=0), axis=-1).max(axis=1) * 900.0
                for m in (motion[0], still[0])
            )
            at = slice(CHANGE - 1, CHANGE + AROUND)
            if change == "arrival":
                at = slice(58, 58 + AROUND)
            elif change in ("steered", "time, up and down"):
                at = slice(CHANGE - 1, 44)
            held = walked(session, course, change, plant=True)
            rows.append([a[at].max(), b[5:55].max(), slide(*motion), slide(*held)])
        around, rest, loose, held = np.mean(rows, axis=0)
        print(f"{change:20}{around:>12.1f}{rest:>14.1f}{loose:>22.2f}{held:>12.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description="Times streams of many characters.")
    parser.add_argument("--repeats", type=int, default=60)
    parser.add_argument("--model", help="an installed model's name or a folder")
    parser.add_argument("--quality", type=int, metavar="COURSES", help="accelerations and feet instead of times")
    asked = parser.parse_args()
    if asked.quality:
        quality(load(asked.model), asked.quality)
        return
    with tempfile.TemporaryDirectory() as folder:
        timings(load(asked.model or random_model("full", Path(folder))), asked.repeats)


if __name__ == "__main__":
    main()
