"""The pictures of a gallery: that they are written, whole or not at all, and that what they show is true."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from interpose import InputError
from interpose.gallery import paths, store
from interpose.gallery.plots import canvas, distances, match, plot, variants
from interpose.gallery.proposals import Unreachable
from interpose.gallery.store import Gallery
from interpose.gallery.tracks import POSTURE_SIZE, Tracks
from interpose.rotation import wrapped

pytest.importorskip("matplotlib")

NAMES = ["variants.png", "distances.png", "match.png"]


def circle(speed: float, turn: float, frames: int = 300, sway: float = 0.0, spin: float = 0.0) -> np.ndarray:
    """x, z, yaw of somebody whose way of ``speed`` m/s turns by ``turn`` rad/s, and whose facing by ``spin`` more."""
    seconds = np.arange(frames) / 30.0
    ahead = turn * seconds + sway * np.sin(4.0 * seconds)
    step = speed / 30.0 * np.stack([np.sin(ahead), np.cos(ahead)], axis=-1)
    return np.column_stack([np.cumsum(step, axis=0) - step, ahead + spin * seconds])


def gallery_of(clips: list[tuple[str, np.ndarray]]) -> Gallery:
    styles = tuple(sorted({style for style, _ in clips}))
    stops = np.cumsum([len(track) for _, track in clips])
    root = np.concatenate([track for _, track in clips]).astype(np.float32)
    return store.of_tracks(
        Tracks(
            root,
            np.zeros((len(root), POSTURE_SIZE), np.float16),
            np.stack([np.concatenate([[0], stops[:-1]]), stops], axis=-1),
            np.array([styles.index(style) for style, _ in clips]),
            styles,
        )
    )


@pytest.fixture(scope="module")
def gallery() -> Gallery:
    """Walkers on circles of several sizes, faster and slower, and some who stroll; some look elsewhere on their way."""
    walks = [("walk", circle(speed, turn, sway=0.2)) for speed in (0.9, 1.3) for turn in (0.0, 0.3, 0.7)]
    walks += [("walk", circle(1.1, turn, sway=0.2, spin=1.0)) for turn in (-0.3, 0.0, 0.3)]
    return gallery_of([*walks, *(("stroll", circle(0.5, 0.1, spin=spin)) for spin in (0.1, 0.6))])


def opened(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        assert image.format == "PNG"
        return np.asarray(image.convert("RGB"))


def test_the_three_pictures_are_written_in_the_projects_colours(gallery: Gallery, tmp_path: Path) -> None:
    out = tmp_path / "new" / "folder"
    written = plot(gallery, out)
    assert written == [out / name for name in NAMES]
    assert sorted(path.name for path in out.iterdir()) == sorted(NAMES)
    for path in written:
        pixels = opened(path)
        tall, wide, _ = pixels.shape
        assert wide == round(canvas.SHEET_WIDTH * canvas.DPI) == 2400
        assert 0.2 * wide < tall < 1.2 * wide
        colours, counts = np.unique(pixels.astype(int) @ [1 << 16, 1 << 8, 1], return_counts=True)
        shown = {f"#{colour:06x}": count for colour, count in zip(colours.tolist(), counts, strict=True)}
        assert shown[canvas.PAPER] > 0.5 * tall * wide
        assert canvas.INK in shown
        if path.name != "distances.png":
            assert shown[canvas.START] > 200
            assert shown[canvas.TARGET] > 200
        assert (pixels[:8] == pixels[0, 0]).all()
        assert (pixels[-8:] == pixels[0, 0]).all()


def test_equal_seeds_give_equal_pictures_and_others_others(gallery: Gallery, tmp_path: Path) -> None:
    first, again, other = (plot(gallery, tmp_path / str(n), seed=seed) for n, seed in enumerate((3, 3, 4)))
    for a, b in zip(first, again, strict=True):
        assert a.read_bytes() == b.read_bytes()
    assert first[2].read_bytes() != other[2].read_bytes()


def test_a_style_is_shown_alone_and_pointed_out(gallery: Gallery, tmp_path: Path) -> None:
    shown = variants.variants(gallery, 1.0, "stroll")
    assert {p.style for each in shown for p in each.proposals} == {"stroll"}
    assert match.matched(gallery, 1.0, "stroll").style == "stroll"
    _, distant, _ = plot(gallery, tmp_path, style="stroll", distance=1.0)
    target = tuple(int(canvas.TARGET[i : i + 2], 16) for i in (1, 3, 5))
    rows = np.nonzero((opened(distant) == target).all(axis=-1).any(axis=1))[0]
    assert len(rows) > 0
    assert np.ptp(rows) < 40  # one line of words


# figure 3


def test_variants_are_exact_paths_for_each_difference_of_facing(gallery: Gallery) -> None:
    shown = variants.variants(gallery, 2.0, seed=5)
    assert [each.degrees for each in shown] == [0, 45, 90, 135]
    for each in shown:
        assert each.query.start == (0.0, 0.0, 0.0)
        assert each.query.target == pytest.approx((0.0, 2.0, np.radians(each.degrees)))
        assert each.query.distance == 2.0
        assert 1 <= len(each.proposals) <= 7
        for proposal in each.proposals:
            assert proposal.path[0] == pytest.approx(each.query.start)
            assert proposal.path[-1, :2] == pytest.approx(each.query.target[:2])
            off = wrapped(float(proposal.path[-1, 2]) - each.query.target[2])
            assert off == pytest.approx(0.0, abs=1e-9)
    assert min(len(each.proposals) for each in shown[:2]) >= 4  # this small gallery has no more that differ
    again = variants.variants(gallery, 2.0, seed=5)
    for a, b in zip(shown, again, strict=True):
        assert [p.trace for p in a.proposals] == [p.trace for p in b.proposals]


def test_a_difference_that_nothing_serves_has_an_empty_panel() -> None:
    straight = gallery_of([("walk", circle(1.2, 0.0))])
    shown = variants.variants(straight, 2.0)
    assert shown[0].proposals
    assert not shown[-1].proposals
    assert variants.draw(shown, 2.0).startswith(b"\x89PNG")


def test_what_nothing_reaches_is_said(gallery: Gallery, tmp_path: Path) -> None:
    with pytest.raises(Unreachable, match="set a key in between"):
        plot(gallery, tmp_path / "out", distance=500.0)
    assert not (tmp_path / "out").exists()


# figure 4


def test_covered_distances_are_lengths_along_the_track_of_every_segment() -> None:
    there_and_back = np.zeros((61, 3))
    there_and_back[:, 1] = 0.02 * np.concatenate([np.arange(31), np.arange(30)[::-1]])
    clips = [("run", circle(3.0, 1.0, 100)), ("run", circle(2.0, 0.0, 50)), ("pace", there_and_back)]
    clips.append(("brief", circle(1.0, 0.0, 45)))
    lengths = distances.covered(gallery_of(clips).tracks)
    assert list(lengths) == ["pace", "run"]  # by median; a clip of 45 frames has no segment of 45 steps
    assert lengths["pace"] == pytest.approx(np.full(16, 45 * 0.02), rel=1e-5)
    assert lengths["run"] == pytest.approx([4.5] * 55 + [3.0] * 5, rel=1e-5)
    assert distances.covered(gallery_of(clips[:1]).tracks, frames=30)["run"] == pytest.approx(np.full(70, 3.0), 1e-5)


def test_hills_hold_every_segment_where_it_is() -> None:
    lengths = {"a": np.full(300, 1.0), "b": np.linspace(0.0, 2.0, 1000)}
    at, hills = distances.density(lengths, far=4.0)
    width = at[1] - at[0]
    for style, hill in hills.items():
        assert hill.sum() * width / 0.1 == pytest.approx(len(lengths[style]))  # hills count segments for each 10 cm
    assert at[np.argmax(hills["a"])] == pytest.approx(1.0, abs=width)
    assert hills["b"][(at > 0.2) & (at < 1.8)] == pytest.approx(50.0, rel=0.02)


@pytest.mark.parametrize("count", [1, 30])
def test_one_style_or_many_are_drawn_and_the_picture_grows(count: int) -> None:
    drawn = np.random.default_rng(0)
    lengths = {f"style ${n}$ _^": drawn.gamma(4.0, 0.1 + 0.02 * n, 50) for n in range(count)}
    picture = distances.draw(lengths)
    tall = int.from_bytes(picture[20:24], "big")
    assert tall == pytest.approx(canvas.DPI * (1.95 + 1.1 + count * (0.62 if count == 1 else 0.34)), abs=2)


def test_nobody_moves_far_in_a_picture_of_people_who_stand() -> None:
    standing = distances.covered(gallery_of([("stand", np.zeros((60, 3)))]).tracks)
    assert not standing["stand"].any()
    assert distances.draw(standing).startswith(b"\x89PNG")


def test_clips_too_short_for_a_segment_are_refused() -> None:
    with pytest.raises(InputError, match="longer than 45 frames"):
        distances.covered(gallery_of([("walk", circle(1.0, 0.0, 40))]).tracks)


# figure 6


@pytest.mark.parametrize("seed", range(4))
def test_the_stages_are_those_of_a_candidate_that_serves_the_query(gallery: Gallery, seed: int) -> None:
    one = match.matched(gallery, 2.0, seed=seed)
    part = one.trace.parts[0]
    found, turned, placed = one.stages.found, one.stages.turned, one.stages.placed
    assert found == pytest.approx(gallery.tracks.cut(part.start, part.steps, part.mirrored))
    own = paths.query_of(found)
    assert own.distance == pytest.approx(one.query.distance, rel=0.031)
    assert one.query.distance == pytest.approx(2.0, rel=0.031)
    # The angle turns the candidate's way onto the query's.
    assert wrapped(own.heading + one.angle - one.query.heading) == pytest.approx(0.0, abs=1e-9)
    assert turned[-1, :2] == pytest.approx(one.query.target[:2])
    # What both facings are off is the error of equation 7, and gone in the finished path.
    assert abs(one.off[0]) + abs(one.off[1]) == pytest.approx(one.trace.error, abs=3e-4)
    for row, end, off in ((0, one.query.start, one.off[0]), (-1, one.query.target, one.off[1])):
        assert wrapped(turned[row, 2] - end[2] - off) == pytest.approx(0.0, abs=1e-9)
        assert wrapped(placed[row, 2] - end[2]) == pytest.approx(0.0, abs=1e-9)
        assert placed[row, :2] == pytest.approx(end[:2])


def test_a_candidate_is_shown_whose_steps_can_be_seen(gallery: Gallery) -> None:
    one = match.matched(gallery, 2.0)
    assert min(abs(off) for off in one.off) >= match.LEAST_OFF
    assert match.ANGLE_RANGE[0] <= abs(one.angle) <= match.ANGLE_RANGE[1]


def test_where_nothing_is_as_long_the_nearest_is_shown(gallery: Gallery) -> None:
    assert match.matched(gallery, 90.0).query.distance > 4.5
    assert match.matched(gallery, 0.01).query.distance < 0.6


def test_nobody_who_stands_is_matched() -> None:
    with pytest.raises(InputError, match="leads from one place to another"):
        match.matched(gallery_of([("stand", np.zeros((60, 3)))]), 2.0)


# errors


def test_without_matplotlib_it_says_what_to_install(
    gallery: Gallery, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "matplotlib"]:
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(InputError, match=r"pip install 'interpose\[train\]'"):
        plot(gallery, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_unknown_style_is_refused(gallery: Gallery, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no trajectory in style 'hop'; it has stroll, walk"):
        plot(gallery, tmp_path / "out", style="hop")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("distance", [0.0, -1.0, float("nan"), float("inf")])
def test_a_distance_that_is_none_is_refused(gallery: Gallery, tmp_path: Path, distance: float) -> None:
    with pytest.raises(InputError, match="a length in metres above 0"):
        plot(gallery, tmp_path, distance=distance)


def test_a_folder_that_cannot_be_made_is_refused(gallery: Gallery, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="cannot be created"):
            plot(gallery, out)


# how places are drawn


def test_the_page_shows_the_ground_from_above() -> None:
    ahead_then_left = np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 2.0, np.pi / 2.0]])
    assert canvas.seen(ahead_then_left).tolist() == [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]]
    assert canvas.toward(np.array([0.0, np.pi / 2.0])) == pytest.approx(np.array([[1.0, 0.0], [0.0, 1.0]]))


def test_words_go_where_most_is_free() -> None:
    assert canvas.free([0.0]) == pytest.approx(np.pi)
    assert np.cos(canvas.free([0.0, np.pi / 2.0])) == pytest.approx(-np.sqrt(0.5))
    assert np.sin(canvas.free([0.0, np.pi])) ** 2 == pytest.approx(1.0)


@pytest.mark.parametrize(("most", "round_"), [(0.013, 0.01), (0.3, 0.2), (0.99, 0.5), (1.0, 1.0), (7.0, 5.0), (40, 20)])
def test_lengths_are_round(most: float, round_: float) -> None:
    assert canvas.round_length(float(most)) == pytest.approx(round_)
