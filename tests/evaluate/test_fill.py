"""How every evaluation fills gaps: the baselines, any skeleton, locked feet, and methods as they are typed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from interpose import rotation
from interpose.errors import InputError
from interpose.evaluate import windows
from interpose.evaluate.case import Case, Windows, joined
from interpose.evaluate.fill import INTERP, ZERO_VELOCITY, Contender, fill, parse, with_locked_feet
from interpose.retarget import map_skeleton
from interpose.runtime import model_folder
from interpose.runtime.backends.dcmoe import DCMoEBackend
from interpose.runtime.backends.interp import BACKEND as INTERPOLATION
from interpose.runtime.feet import lock
from interpose.runtime.gap_batch import GapBatch, Generated
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import continued
from interpose.skeleton import HUMANOID

from .conftest import MakeClip


def about_x(*degrees: float) -> np.ndarray:
    """(angle, joint, 4): all joints turned alike."""
    turned = rotation.from_rotation_vector(np.radians(np.array(degrees))[:, None] * np.array([1.0, 0.0, 0.0]))
    return np.repeat(turned[:, None], len(HUMANOID), axis=1)


def gap(frames: int, *keys: np.ndarray, root: np.ndarray | None = None) -> Case:
    """A gap from the last but one of some key rotations (frame, joint, 4) to the last one."""
    local = np.concatenate(keys)[None]
    root = np.zeros((1, local.shape[1], 3)) if root is None else root[None]
    known = local.shape[1] - 1
    inner = Windows(HUMANOID, 30.0, np.zeros((1, frames, 3)), np.zeros((1, frames, 22, 4)))
    recorded = Windows(HUMANOID, 30.0, root, local)
    whole = joined(recorded.frames(slice(0, known)), inner, recorded.frame(-1))
    return Case("any", frames, whole, known - 1, known + frames, known)


def test_interp_is_linear_in_the_root_and_constant_in_angular_speed() -> None:
    root = np.array([[9.0, 9.0, 9.0], [1.0, 2.0, 3.0], [5.0, 2.0, -1.0]])
    made = fill(gap(3, about_x(170.0, 10.0, 90.0), root=root), INTERP).motion
    np.testing.assert_allclose(made.root[0], [[2.0, 2.0, 2.0], [3.0, 2.0, 1.0], [4.0, 2.0, 0.0]])
    np.testing.assert_allclose(made.local[0], about_x(30.0, 50.0, 70.0))


def test_interp_takes_the_shorter_arc_and_the_start_keys_sign() -> None:
    made = fill(gap(1, -about_x(10.0), about_x(90.0)), INTERP).motion
    np.testing.assert_allclose(made.local[0], -about_x(50.0))


@pytest.mark.parametrize("degrees", [0.0, 1e-6, 16.2, 16.3, 179.0])
def test_interp_stays_a_unit_quaternion_on_both_sides_of_the_linear_threshold(degrees: float) -> None:
    # The cosine of half of 16.26 degrees is 0.99.
    local = fill(gap(9, about_x(0.0, degrees)), INTERP).motion.local
    np.testing.assert_allclose(np.linalg.norm(local, axis=-1), 1.0)
    wanted = np.radians(degrees) * np.arange(1, 10)[:, None] / 10 * np.ones(len(HUMANOID))
    np.testing.assert_allclose(rotation.angle(local[0]), wanted, atol=1e-4)


def test_zero_velocity_holds_the_start_key() -> None:
    root = np.arange(9.0).reshape(3, 3)
    made = fill(gap(4, about_x(5.0, 6.0, 90.0), root=root), ZERO_VELOCITY).motion
    np.testing.assert_array_equal(made.root[0], np.repeat(root[1:2], 4, axis=0))
    np.testing.assert_array_equal(made.local[0], np.repeat(about_x(6.0), 4, axis=0))


def test_signs_go_on_from_the_start_key() -> None:
    true = about_x(*np.linspace(0.0, 500.0, 20))[None]
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(1, 20, 1, 1))
    made = continued(-true[:, 0], (signs * true)[:, 1:])
    np.testing.assert_array_equal(np.sum(made[:, 1:] * made[:, :-1], axis=-1) > 0.0, True)
    assert np.sum(made[0, 0, 0] * -true[0, 0, 0]) > 0.0
    np.testing.assert_allclose(np.abs(made), np.abs(true[:, 1:]))


@pytest.fixture
def stand_in(monkeypatch: pytest.MonkeyPatch) -> list[GapBatch]:
    """What dcmoe was given; it interpolates, with quaternions of either sign."""
    seen: list[GapBatch] = []

    def generate(self: DCMoEBackend, model: Session, batch: GapBatch) -> Generated:
        seen.append(batch)
        made = INTERPOLATION.generate(None, batch)
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(*made.local.shape[:-1], 1))
        return Generated(made.root, signs * made.local, made.contacts, np.full(len(batch), 0.5))

    monkeypatch.setattr(DCMoEBackend, "generate", generate)
    return seen


def contender(context_frames: int) -> Contender:
    model = Session(Path("nowhere"), {"name": "mine", "method": "dcmoe", "styles": ["Angry"]})
    return Contender("mine", DCMoEBackend(), model, context_frames)


@pytest.fixture
def case(make_clip: MakeClip) -> Case:
    clip = make_clip(200)
    return Case("any", 15, windows.cut((clip,)), 9, 25, 10, map_skeleton(clip.skeleton))


def test_a_model_is_retargeted_both_ways_and_given_what_was_requested(case: Case, stand_in: list[GapBatch]) -> None:
    """Interpolation on the humanoid, in place of a network, comes back as the data set's own interpolation."""
    styles = ["Angry"] * len(case)
    made = fill(case, contender(4), styles=styles, seed=7, style_strength=2.0)
    expected = fill(case, INTERP).motion
    (batch,) = stand_in
    assert batch.context_local.shape == (len(case), 4, 22, 4)
    assert batch.draws == tuple((7, row) for row in range(len(case)))
    assert (batch.styles, batch.style_strength) == (tuple(styles), 2.0)
    # the humanoid's own hips lie off the straight line by as much
    np.testing.assert_allclose(made.raw.root, expected.root, atol=1e-3)
    np.testing.assert_allclose(made.raw.local, expected.local, atol=1e-4)
    np.testing.assert_array_equal(made.chain_distance, np.full(len(case), 0.5))


def test_no_more_frames_are_known_than_the_case_has(case: Case, stand_in: list[GapBatch]) -> None:
    fill(replace(case, known=2), contender(4))
    assert stand_in[0].context_local.shape[1] == 2


def test_feet_are_locked_as_in_use(case: Case, stand_in: list[GapBatch], monkeypatch: pytest.MonkeyPatch) -> None:
    def plant_batch(root: np.ndarray, local: np.ndarray, contacts: np.ndarray) -> np.ndarray:
        assert root.shape[1] == local.shape[1] == contacts.shape[1] == 17  # with both keys
        return np.full_like(local, 0.5)

    standing = Generated(case.truth.root, case.truth.local, np.ones((len(case), 15, 4)))
    locked = with_locked_feet(case.windows.frame(9), case.truth, case.windows.frame(25), standing)
    assert np.abs(locked.local - case.truth.local).max() > 1e-3
    monkeypatch.setattr(lock, "plant_batch", plant_batch)
    made = fill(replace(case, mapping=None), contender(1))
    assert set(np.unique(np.abs(made.motion.local))) == {0.5}
    assert np.abs(made.raw.local - made.motion.local).max() > 0.1


def installed_models(folder: Path, **models: tuple[str, list[str]]) -> None:
    """Model folders: a method and training data each."""
    for name, (method, data) in models.items():
        (folder / name).mkdir()
        more = "" if method != "stitch" else ', "network": {}, "chains": {}'
        data_text = str(data).replace("'", '"')
        (folder / name / "model.json").write_text(
            f'{{"format": 2, "name": "{name}", "method": "{method}", "styles": [], "licence": "MIT", '
            f'"training_data": {data_text}, "planner": {{"latent": 4}}{more}}}'
        )


@pytest.fixture
def models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    lafan1_data = ["lafan1 (1234)"]
    installed_models(
        tmp_path,
        default=("dcmoe", ["100style (12)"]),
        steps=("dcmoe", lafan1_data),
        stitched=("stitch", lafan1_data),
        mixed=("stitch", [*lafan1_data, "100style (12)"]),
    )
    monkeypatch.setattr(model_folder, "INSTALLED", tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("text", "model", "name", "method", "served_by"),
    [
        ("interp", None, "interp", "interp", None),
        ("zero-velocity", None, "zero-velocity", "zero-velocity", None),
        ("dcmoe", None, "dcmoe", "dcmoe", "steps"),
        ("plan", None, "plan", "plan", "steps"),
        (" stitch ", None, "stitch", "stitch", "stitched"),
        ("dcmoe", "default", "dcmoe", "dcmoe", "default"),
        ("plan=mixed", None, "plan", "plan", "mixed"),
        ("mine=stitched", "default", "mine", "stitch", "stitched"),
    ],
)
def test_methods_as_they_are_typed(
    models: Path, text: str, model: str | None, name: str, method: str, served_by: str | None
) -> None:
    (found,) = parse([text], model=model, context_frames=3)
    assert (found.name, found.backend.name) == (name, method)
    assert (None if found.model is None else found.model.name) == served_by
    assert found.context_frames == (3 if served_by else 10)


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        ([], "names each method once, got none"),
        (["interp", "interp"], "names each method once, got interp, interp"),
        (["spline"], "spline: unknown method; choose interp, zero-velocity, dcmoe, stitch, stitch\\+detail, plan, or"),
        (["interp=steps"], "interp=steps: choose interp"),
        (["truth=steps"], "truth=steps: choose interp"),
        (["mine="], "mine=: choose interp"),
        (["=steps"], "=steps: choose interp"),
        ([""], ": choose interp"),
        (["mine=nowhere"], "no model 'nowhere'"),
        (["dcmoe=stitched"], "the model 'stitched' serves stitch and plan, not 'dcmoe'"),
        (["stitch+detail"], r"no installed model that was trained on LaFAN1 serves 'stitch\+detail'; name one as"),
    ],
)
def test_what_cannot_be_parsed(models: Path, texts: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse(texts, reserved=("truth",))
