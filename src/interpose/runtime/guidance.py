"""How each variant of a gap is guided: how long it takes, the root's path and the style, before any frame is made.

A path is drawn by the user, straight, or matched from the gallery (Chu and Yang 2024, section 4). By default the
likeliest variant is unconstrained, since the planner's own root measures better than matched ones (docs/paths.md).
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
from interpose.features.plan import LONGEST_PLAN_STEPS
from interpose.gallery import paths, proposals
from interpose.gallery.matching import Query
from interpose.gallery.proposals import PathRequest, Proposal, Unreachable
from interpose.gallery.speeds import Suggestion, group_of
from interpose.gallery.store import Gallery
from interpose.gallery.tracks import posture_of, track_of
from interpose.gallery.weighing import EndStates
from interpose.gallery.windows import SHORTEST_WINDOW
from interpose.motion import Motion
from interpose.runtime import planner, style_blend
from interpose.runtime.gap_batch import batch_of
from interpose.runtime.poses import Path
from interpose.runtime.request import Request

CLEARLY_NEARER = 0.7
"""A trajectory of another style is taken where it is nearer than this share of the distance to the unconstrained
root."""


@dataclass(frozen=True, eq=False)
class Guidance:
    """Of one variant. path: (steps + 1, 3) on the ground of the 22 joints, or None for no constraint.

    trajectory: where the path is from: matched, composed, drawn, straight, or model where there is none. style: for the
    network. fit: of a matched path, 0 to 1. note: what could not be served as requested, and why.
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
        """The places of the keys."""
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


def suggest_duration(request: Request, gap: Gap) -> Suggestion:
    """How long the gap should take. Raises InputError where there is no gallery, and :class:`Unreachable`."""
    gallery = request.trajectories
    if gallery is None:
        raise InputError("cannot suggest a duration without a gallery; give a number of frames, or a gallery")
    return proposals.suggestion(gallery, gap.query, gap.ends, request.matched_style, request.seed)


def guide(
    request: Request,
    gap: Gap,
    steps: int | None,
    count: int,
    *,
    drawn: DrawnPath | None = None,
    suggested: Suggestion | None = None,
) -> list[Guidance]:
    """The guidance of ``count`` variants, the likeliest first.

    steps: at 30 Hz; None takes the suggested time, or with ``drawn`` that of the drawn path. suggested: what
    :func:`suggest_duration` gave, where it is known. Raises InputError where the request cannot be served.
    """
    if drawn is not None:
        return _with_styles([_along_drawn(request, gap, steps, drawn)] * count, request)
    gallery, given, note = request.trajectories, steps, None
    path = "auto" if request.drawn is not None else request.path  # a gap without a drawn path of its own
    if steps is None:
        found = suggested or suggest_duration(request, gap)
        steps = found.steps if request.speed is None else group_of(found, request.speed).steps
    if path == "straight":
        straight = Guidance(steps, paths.straight(gap.query, steps), "straight")
        return _with_styles([straight] * count, request)
    made: list[Guidance] = []
    if not request.abilities.paths:
        path = "none"
    if gallery is not None and path == "auto" and _predicts_root(request, steps):
        made = _mixed(request, gallery, gap, steps, given, count)
    elif gallery is not None and (path == "gallery" or (path == "auto" and not request.abilities.latent_variants)):
        try:
            made, note = _matched(request, gallery, gap, steps, given, count)
        except Unreachable as error:
            note = f"{error}; the path is unconstrained"
        if not made and note is None and path == "gallery":
            note = f"the shortest trajectories take {SHORTEST_WINDOW} frames at 30 Hz; the path is unconstrained"
    made += [Guidance(steps, note=note)] * (count - len(made))
    return _with_styles(made, request)


def _predicts_root(request: Request, steps: int) -> bool:
    """Whether the planner predicts the whole root path, and further variants are to differ by more than its latents."""
    model = request.model
    planned = model is not None and model.has_planner and steps <= LONGEST_PLAN_STEPS
    return planned and not request.abilities.latent_variants


def _mixed(request: Request, gallery: Gallery, gap: Gap, steps: int, given: int | None, count: int) -> list[Guidance]:
    """Unconstrained variants and trajectories of the gallery in turn: the former measure better, the latter differ
    more."""
    note = _too_fast(gallery, gap.query, steps)
    others: list[Guidance] = []
    if count > 1 and note is None:
        with suppress(Unreachable):
            others = _matched(request, gallery, gap, steps, given, count // 2)[0]
    free = Guidance(steps, note=note)
    return [others[i // 2] if i % 2 and i // 2 < len(others) else free for i in range(count)]


def _matched(
    request: Request, gallery: Gallery, gap: Gap, steps: int, given: int | None, count: int
) -> tuple[list[Guidance], str | None]:
    """Guidance along trajectories of the gallery, and what could not be served as requested. steps: of the likeliest.
    given: those that the request named.

    The first trajectory is the one nearest to the unconstrained root, so that a real one with real timing stands in for
    a predicted one.
    """
    query, ends, note = gap.query, gap.ends, None
    style = request.matched_style
    if request.style is not None and style is None:
        missing = style_blend.leading(request.style)
        note = f"the gallery has no trajectory in style '{missing}'; those of all its styles were matched"
    if given is not None and given < SHORTEST_WINDOW:
        return [], _too_fast(gallery, query, given)
    wanted = PathRequest(given, request.speed, style)
    hint = _unconstrained_root(request, gap, steps)
    try:
        found = proposals.propose(gallery, query, wanted, ends, count=count, seed=request.seed, hint=hint)
    except Unreachable:
        if style is None:
            raise
        note = f"no trajectory in style '{style}' leads there in that time; those of all styles were matched"
        style, wanted = None, replace(wanted, style=None)
        found = proposals.propose(gallery, query, wanted, ends, count=count, seed=request.seed, hint=hint)
    if style is not None:
        found[0] = _of_any_style(gallery, query, ends, found[0], hint, request.seed)
    found[0] = replace(found[0], path=_blended_ends(found[0].path, hint))
    styles = request.abilities.styles
    return [
        Guidance(
            one.steps,
            one.path,
            "composed" if one.composed else "matched",
            one.style if i and one.style in styles else None,
            one.fit,
            note,
        )
        for i, one in enumerate(found)
    ], note


def _of_any_style(gallery: Gallery, query: Query, ends: EndStates, first: Proposal, hint: Path, seed: int) -> Proposal:
    """The likeliest proposal, or one walked in another style where that is clearly nearer to the unconstrained root: a
    gallery has few trajectories of each style, and the network brings the style on any path."""
    other = proposals.propose(gallery, query, PathRequest(first.steps), ends, seed=seed, hint=hint)[0]
    near, nearer = (paths.apart(one.path, hint) + 0.02 for one in (first, other))
    return other if nearer < CLEARLY_NEARER * near else first


def _blended_ends(path: Path, free: Path) -> Path:
    """The path, left and reached as the unconstrained root leaves and reaches the keys: over half a second at either
    end."""
    free = paths.retime(free, len(path) - 1)
    time = np.arange(len(path))
    share = paths.ease(np.minimum(time, time[::-1]) / paths.FADE_STEPS)[:, None]
    ground = free[:, :2] + share * (path[:, :2] - free[:, :2])
    return np.concatenate([ground, path[:, 2:]], axis=-1)


def _unconstrained_root(request: Request, gap: Gap, steps: int) -> Path:
    """Where the root goes without a path: the planner's for gaps of its lengths, otherwise the method's own."""
    assert request.model is not None
    batch = batch_of(
        (gap.context.root_positions[None], gap.context.local_rotations[None]),
        (gap.target.root_positions[None], gap.target.local_rotations[None]),
        steps - 1,
        styles=request.style,
        style_strength=request.style_strength,
    )
    if request.model.has_planner and steps <= LONGEST_PLAN_STEPS:
        root = planner.base(request.model, batch, np.zeros((1, request.model.plan_latent)))[0][0, 1:-1, :3]
    else:
        root = request.backend.generate(request.model, batch).root[0]
    ends = np.array([gap.query.start, gap.query.target])
    turned = np.interp(np.arange(1, steps), [0, steps], ends[:, 2])
    inner = np.concatenate([root[:, [0, 2]], turned[:, None]], axis=-1)
    return np.concatenate([ends[:1], inner, ends[1:]])


def _along_drawn(request: Request, gap: Gap, steps: int | None, drawn: DrawnPath) -> Guidance:
    wanted = PathRequest(steps, request.speed, request.matched_style)
    path = following.follow(request.trajectories, drawn, gap.query, wanted, gap.ends, request.seed)
    return Guidance(len(path) - 1, path, "drawn")


def _too_fast(gallery: Gallery, query: Query, steps: int) -> str | None:
    """Why a time shorter than any of the gallery's cannot be right; None where the model may well serve it."""
    pace, fastest = query.distance / steps, gallery.fastest
    if pace <= 1.5 * fastest:
        return None
    needs = int(np.ceil(query.distance / fastest))
    return (
        f"{query.distance:.2f} m in {steps} frames at 30 Hz is {pace * RATE:.0f} m/s, and the fastest trajectory of "
        f"the gallery has {fastest * RATE:.1f} m/s; {needs} frames would do; the path is unconstrained"
    )


def _with_styles(made: list[Guidance], request: Request) -> list[Guidance]:
    """The guidance with its styles: the one requested; where it was left free, the path's own, or free first and then
    each style in turn, in an order that the seed decides."""
    styles = request.abilities.styles
    if request.style is not None or not styles or request.abilities.latent_variants:
        return [replace(one, style=request.style) for one in made]
    turns = [styles[i] for i in np.random.default_rng(request.seed).permutation(len(styles))]
    return [
        one if i == 0 or one.style is not None else replace(one, style=turns[(i - 1) % len(turns)])
        for i, one in enumerate(made)
    ]
