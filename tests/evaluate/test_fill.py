"""How every evaluation fills gaps: the baselines, any skeleton, locked feet, and methods as they are typed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from interpose import rotation
from interpose.errors import InputError
from interpose.evaluate import lafan1
from interpose.evaluate.fill import INTERP, ZERO_VELOCITY, Carrier, Contender, fill, parse, with_locked_feet
from interpose.runtime import model_folder
from interpose.runtime.backends.dcmoe import DCMoEBackend
from interpose.runtime.backends.interp import BACKEND as INTERPOLATION
from interpose.runtime.feet import lock
from interpose.runtime.gap_batch import Batch, GapBatch, Generated
from interpose.runtime.model_folder import Session
from interpose.runtime.poses import continued
from interpose.skeleton import HUMANOID

from .conftest import MakeClip


def about_x(*degrees: float) -> np.ndarray:
    """(angle, joint, 4): all joints turned alike."""
    turned = rotation.from_rotation_vector(np.radians(np.array(degrees))[:, None] * np.array([1.0, 0.0, 0.0]))
    return np.repeat(turned[:, None], len(HUMANOID), axis=1)


def key(degrees: float, *root: float) -> Batch:
    return np.array([[root or (0.0, 0.0, 0.0)]]), about_x(degrees)[None]


def test_interp_is_linear_in_the_root_and_constant_in_angular_speed() -> None:
    context = np.array([[[9.0, 9.0, 9.0], [1.0, 2.0, 3.0]]]), about_x(170.0, 10.0)[None]
    root, local = fill(INTERP, context, key(90.0, 5.0, 2.0, -1.0), 3).motion
    np.testing.assert_allclose(root[0], [[2.0, 2.0, 2.0], [3.0, 2.0, 1.0], [4.0, 2.0, 0.0]])
    np.testing.assert_allclose(local[0], about_x(30.0, 50.0, 70.0))


def test_interp_takes_the_shorter_arc_and_the_start_keys_sign() -> None:
    root, local = key(10.0)
    _, made = fill(INTERP, (root, -local), key(90.0), 1).motion
    np.testing.assert_allclose(made[0], -about_x(50.0))


@pytest.mark.parametrize("degrees", [0.0, 1e-6, 16.2, 16.3, 179.0])
def test_interp_stays_a_unit_quaternion_on_both_sides_of_the_linear_threshold(degrees: float) -> None:
    # The cosine of half of 16.26 degrees is 0.99.
    _, local = fill(INTERP, key(0.0), key(degrees), 9).motion
    np.testing.assert_allclose(np.linalg.norm(local, axis=-1), 1.0)
    wanted = np.radians(degrees) * np.arange(1, 10)[:, None] / 10 * np.ones(len(HUMANOID))
    np.testing.assert_allclose(rotation.angle(local[0]), wanted, atol=1e-4)


def test_zero_velocity_holds_the_start_key() -> None:
    context = np.arange(12.0).reshape(2, 2, 3), np.stack([about_x(5.0, 6.0)] * 2)
    target = np.zeros((2, 1, 3)), np.stack([about_x(90.0)] * 2)
    root, local = fill(ZERO_VELOCITY, context, target, 4).motion
    np.testing.assert_array_equal(root, np.repeat(context[0][:, 1:], 4, axis=1))
    np.testing.assert_array_equal(local, np.repeat(context[1][:, 1:], 4, axis=1))


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


def test_a_model_is_retargeted_both_ways_and_given_what_was_requested(
    make_clip: MakeClip, stand_in: list[GapBatch]
) -> None:
    """Interpolation on the humanoid, in place of a network, comes back as the data set's own interpolation."""
    windows = lafan1.cut((make_clip(200),))
    start, target = (windows.root[:, :10], windows.local[:, :10]), (windows.root[:, 25:], windows.local[:, 25:])
    drawn = [(7, row) for row in range(len(windows))]
    carrier = Carrier.of(windows.skeleton, 30.0)
    made = fill(contender(4), start, target, 15, carrier=carrier, styles="Angry", draws=drawn, style_strength=2.0)
    expected = fill(INTERP, start, target, 15).motion
    (batch,) = stand_in
    assert batch.context_local.shape == (len(windows), 4, 22, 4)
    assert (batch.styles, batch.draws, batch.style_strength) == (("Angry",) * len(windows), tuple(drawn), 2.0)
    root, local = made.raw
    np.testing.assert_allclose(root, expected[0], atol=1e-3)  # the humanoid's own hips lie off the line by as much
    np.testing.assert_allclose(local, expected[1], atol=1e-4)
    np.testing.assert_array_equal(made.chain_distance, np.full(len(windows), 0.5))


def test_feet_are_locked_as_in_use(
    make_clip: MakeClip, stand_in: list[GapBatch], monkeypatch: pytest.MonkeyPatch
) -> None:
    windows = lafan1.cut((make_clip(200),))
    keys = (windows.root[:, :1], windows.local[:, :1]), (windows.root[:, 9:10], windows.local[:, 9:10])

    def plant_batch(root: np.ndarray, local: np.ndarray, contacts: np.ndarray) -> np.ndarray:
        assert root.shape[1] == local.shape[1] == contacts.shape[1] == 10  # with both keys
        return np.full_like(local, 0.5)

    raw = Generated(windows.root[:, 1:9], windows.local[:, 1:9], np.ones((len(windows), 8, 4)))
    assert np.abs(with_locked_feet(*keys, raw) - raw.local).max() > 1e-3
    monkeypatch.setattr(lock, "plant_batch", plant_batch)
    made = fill(contender(1), *keys, 8)
    assert set(np.unique(np.abs(made.motion[1]))) == {0.5}
    assert np.abs(made.raw[1] - made.motion[1]).max() > 0.1


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
