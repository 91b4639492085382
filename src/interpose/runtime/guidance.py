"""Where the root shall go in a gap, and how long that takes: a plan for each variant, before any frame is made.

The network follows a path that it is shown (Chu and Yang 2024, section 4): drawn by the user, straight, or matched from
the gallery. Of the trajectories that fit, the first variant takes the one nearest to where the network would lead the
root by itself, so that a real trajectory with real timing stands in for an averaged one; further variants take others.
Where nothing is known of paths, the network is left to itself and the plan says why. A model that foresees whole gaps
has ways of its own, one for each latent, which measure better than the gallery's (docs/gallery.md): its first variant
and every other one take those. One of method stitch is left to itself altogether.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from interpose.drawn_path import following
from interpose.drawn_path.path_file import DrawnPath
from interpose.errors import InputError
from interpose.features import RATE
from interpose.gallery import paths, proposals
from interpose.gallery.matching import Query
from interpose.gallery.proposals import PathRequest, Proposal, Unreachable
from interpose.gallery.speeds import Suggestion, group_of
from interpose.gallery.store import Gallery
from interpose.gallery.tracks import posture_of, track_of
from interpose.gallery.weighing import EndStates
from interpose.gallery.windows import SHORTEST_WINDOW
from interpose.motion import Motion
from interpose.runtime import methods, style_blend
from interpose.runtime.backends import dcmoe
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import Path

CLEARLY = 0.7
"""How many times as far from the network's own way a trajectory of another style may be, to be taken."""


@dataclass(frozen=True, eq=False)
class Plan:
    """How one variant is to be led. path: (steps + 1, 3) on the ground of the 22 joints, or None.

    trajectory: where the path is from: matched, composed, drawn, straight, or model where the network leads. style: for
    the network. fit: of a matched path, 0 to 1. note: what could not be served as asked, and why.
    """

    steps: int
    path: Path | None = None
    trajectory: str = "model"
    style: str | None = None
    fit: float | None = None
    note: str | None = None


@dataclass(frozen=True, eq=False)
class Gap:
    """A gap on the 22 joints at 30 Hz: the known frames up to its start, and from its target on, the key first."""

    context: Motion
    target: Motion

    @property
    def query(self) -> Query:
        """Where it leads."""
        (a, b, c), (d, e, f) = track_of(self.context[-1])[0].tolist(), track_of(self.target[0])[0].tolist()
        return Query((a, b, c), (d, e, f))

    @property
    def ends(self) -> EndStates:
        """The keys' postures, and the root's velocities where the motion around the gap is known."""
        pair = posture_of(self.context[-1])[0], posture_of(self.target[0])[0]
        before = _velocity(self.context[-2:]) if len(self.context) > 1 else None
        after = _velocity(self.target[:2]) if len(self.target) > 1 else None
        return EndStates(pair, (before, after))


def _velocity(two: Motion) -> Float[ndarray, "2"]:
    step = (two.root_positions[1] - two.root_positions[0]) * two.rate
    return step[[0, 2]]


@dataclass(frozen=True)
class Wish:
    """What is asked of the plans of a gap. steps: at 30 Hz, None where they are to be suggested. path: auto, straight,
    none or drawn; with drawn, ``line``. style, speed: as in `interpose.runtime.request.Request`. told: what
    :func:`suggestion` said of it, where steps and line are not given. strength: of the style."""

    steps: int | None
    path: str = "auto"
    line: DrawnPath | None = None
    style: str | None = None
    speed: str | None = None
    seed: int = 0
    told: Suggestion | None = None
    strength: float = 1.0


def suggestion(gallery: Gallery | None, gap: Gap, wish: Wish) -> Suggestion:
    """How long the gap should take. Raises InputError where there is no gallery, and :class:`Unreachable`."""
    if gallery is None:
        raise InputError("how long this takes is not known without a gallery; give a number of frames, or a gallery")
    leading = style_blend.leading(wish.style)
    style = leading if leading in gallery.styles else None
    return proposals.suggestion(gallery, gap.query, gap.ends, style, wish.seed)


def plans(session: Session, gallery: Gallery | None, gap: Gap, wish: Wish, count: int) -> list[Plan]:
    """``count`` plans for a gap, the likeliest first.

    Raises InputError where a wish cannot be served: no time given and none known, a style or a line that cannot be had.
    """
    if wish.path == "drawn":
        assert wish.line is not None
        return _shared([_drawn(gallery, gap, wish)] * count, session, wish)
    steps, note = wish.steps, None
    if steps is None:
        told = wish.told or suggestion(gallery, gap, wish)
        steps = told.steps if wish.speed is None else group_of(told, wish.speed).steps
    if wish.path == "straight":
        line = Plan(steps, paths.straight(gap.query, steps), "straight")
        return _shared([line] * count, session, wish)
    made: list[Plan] = []
    if wish.path == "auto" and gallery is not None and session.foresees(steps):
        made = _foreseen(session, gallery, gap, wish, steps, count)
    elif wish.path == "auto" and gallery is not None and session.follows_gallery:
        try:
            made, note = _matched(session, gallery, gap, wish, steps, count)
        except Unreachable as error:
            note = f"{error}; the path is the model's own"
    made += [Plan(steps, note=note)] * (count - len(made))
    return _shared(made, session, wish)


def _foreseen(session: Session, gallery: Gallery, gap: Gap, wish: Wish, steps: int, count: int) -> list[Plan]:
    """Plans of a model that foresees whole gaps: its own ways first and by turns, trajectories of the gallery between.

    The likeliest of its own measures better than the gallery's (docs/gallery.md), whose ways are further apart.
    """
    note = _too_fast(gallery, gap.query, steps)
    others: list[Plan] = []
    if count > 1 and note is None:
        with suppress(Unreachable):
            others = _matched(session, gallery, gap, wish, steps, count // 2)[0]
    own = Plan(steps, note=note)
    return [others[i // 2] if i % 2 and i // 2 < len(others) else own for i in range(count)]


def _matched(
    session: Session, gallery: Gallery, gap: Gap, wish: Wish, steps: int, count: int
) -> tuple[list[Plan], str | None]:
    """Plans along trajectories of the gallery, and what could not be served as asked; ``steps``: of the likeliest."""
    query, ends, note = gap.query, gap.ends, None
    style = style_blend.leading(wish.style)
    if style is not None and style not in gallery.styles:
        note = f"the gallery has no trajectory in style '{style}'; those of all its styles were matched"
        style = None
    if wish.steps is not None and wish.steps < SHORTEST_WINDOW:
        return [], _too_fast(gallery, query, wish.steps)
    asked = PathRequest(wish.steps, wish.speed, style)
    hint = _own_way(session, gap, steps, wish)
    try:
        found = proposals.propose(gallery, query, asked, ends, count=count, seed=wish.seed, hint=hint)
    except Unreachable:
        if style is None:
            raise
        note = f"no trajectory in style '{style}' leads there in that time; those of all styles were matched"
        style, asked = None, replace(asked, style=None)
        found = proposals.propose(gallery, query, asked, ends, count=count, seed=wish.seed, hint=hint)
    if style is not None:
        found[0] = _of_any_style(gallery, query, ends, found[0], hint, wish.seed)
    found[0] = replace(found[0], path=_out_and_in(found[0].path, hint))
    return [
        Plan(
            one.steps,
            one.path,
            "composed" if one.composed else "matched",
            one.style if i and one.style in session.styles else None,
            one.fit,
            note,
        )
        for i, one in enumerate(found)
    ], note


def _of_any_style(gallery: Gallery, query: Query, ends: EndStates, first: Proposal, hint: Path, seed: int) -> Proposal:
    """The likeliest proposal, or one walked in another style where that is clearly nearer to the network's own way: a
    gallery has few trajectories of each style, and the network brings the style, whichever way it goes."""
    other = proposals.propose(gallery, query, PathRequest(first.steps), ends, seed=seed, hint=hint)[0]
    near, nearer = (paths.apart(one.path, hint) + 0.02 for one in (first, other))
    return other if nearer < CLEARLY * near else first


def _out_and_in(path: Path, own: Path) -> Path:
    """The path, left and reached as the network's own way leaves and reaches the keys: half a second at either end goes
    over from one to the other."""
    own = paths.retime(own, len(path) - 1)
    time = np.arange(len(path))
    share = paths.ease(np.minimum(time, time[::-1]) / paths.FADE_STEPS)[:, None]
    ground = own[:, :2] + share * (path[:, :2] - own[:, :2])
    return np.concatenate([ground, path[:, 2:]], axis=-1)


def _own_way(session: Session, gap: Gap, steps: int, wish: Wish) -> Path:
    """Where the network leads the root by itself: where its planner does, if it has one for gaps of that length."""
    start, goal = gap.context, gap.target
    context = start.root_positions[None], start.local_rotations[None]
    target = goal.root_positions[:1], goal.local_rotations[:1]
    if session.foresees(steps):
        root = dcmoe.foreseen(session, context, target, steps - 1, wish.style, wish.strength)
    else:
        made = methods.generate_batch(session, *context, *target, steps - 1, style=[wish.style], strength=wish.strength)
        root = made[0][0]
    ends = np.array([gap.query.start, gap.query.target])
    turned = np.interp(np.arange(1, steps), [0, steps], ends[:, 2])
    inner = np.concatenate([root[:, [0, 2]], turned[:, None]], axis=-1)
    return np.concatenate([ends[:1], inner, ends[1:]])


def _drawn(gallery: Gallery | None, gap: Gap, wish: Wish) -> Plan:
    assert wish.line is not None
    leading = style_blend.leading(wish.style)
    style = leading if gallery is not None and leading in gallery.styles else None
    path = following.follow(
        gallery, wish.line, gap.query, PathRequest(wish.steps, wish.speed, style), gap.ends, wish.seed
    )
    return Plan(len(path) - 1, path, "drawn")


def _too_fast(gallery: Gallery, query: Query, steps: int) -> str | None:
    """Why a time shorter than any of the gallery's cannot be right; None where the model may well serve it."""
    pace, fastest = query.distance / steps, gallery.fastest
    if pace <= 1.5 * fastest:
        return None
    needs = int(np.ceil(query.distance / fastest))
    return (
        f"{query.distance:.2f} m in {steps} frames at 30 Hz is {pace * RATE:.0f} m/s, and the fastest trajectory of "
        f"the gallery has {fastest * RATE:.1f} m/s; {needs} frames would do; the path is the model's own"
    )


def _shared(made: list[Plan], session: Session, wish: Wish) -> list[Plan]:
    """The plans with their styles: the one asked for; where it was left free, the path's own, or free first and then
    each style in turn, in an order that the seed decides."""
    if wish.style is not None or not session.styles or not session.follows_gallery:
        return [replace(plan, style=wish.style) for plan in made]
    order = np.random.default_rng(wish.seed).permutation(len(session.styles))
    turns = [session.styles[i] for i in order]
    return [
        plan if i == 0 or plan.style is not None else replace(plan, style=turns[(i - 1) % len(turns)])
        for i, plan in enumerate(made)
    ]
