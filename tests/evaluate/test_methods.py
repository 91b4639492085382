from __future__ import annotations

import numpy as np
import pytest

from interpose import rotation
from interpose.evaluate import lafan1
from interpose.evaluate.methods import INTERP, ZERO_VELOCITY, from_model
from interpose.motion import Motion
from interpose.runtime import methods, model_folder
from interpose.runtime.backends.dcmoe import continued
from interpose.runtime.interpolate import interpolate
from interpose.skeleton import HUMANOID

from .conftest import MakeClip


def about_x(*degrees: float) -> np.ndarray:
    return rotation.from_rotation_vector(np.radians(np.array(degrees))[:, None] * np.array([1.0, 0.0, 0.0]))


def test_interp_is_linear_in_the_root_and_constant_in_angular_speed() -> None:
    context_root = np.array([[[9.0, 9.0, 9.0], [1.0, 2.0, 3.0]]])
    context_local = np.stack([about_x(170.0), about_x(10.0)])[None]
    root, local = INTERP.generate(context_root, context_local, np.array([[5.0, 2.0, -1.0]]), about_x(90.0)[None], 3)
    np.testing.assert_allclose(root[0], [[2.0, 2.0, 2.0], [3.0, 2.0, 1.0], [4.0, 2.0, 0.0]])
    np.testing.assert_allclose(local[0, :, 0], about_x(30.0, 50.0, 70.0))


def test_interp_takes_the_shorter_arc_and_the_start_keys_sign() -> None:
    start, target = -about_x(10.0)[None, None], about_x(90.0)[None]
    _, local = INTERP.generate(np.zeros((1, 1, 3)), start, np.zeros((1, 3)), target, 1)
    np.testing.assert_allclose(local[0, 0], -about_x(50.0))


@pytest.mark.parametrize("degrees", [0.0, 1e-6, 16.2, 16.3, 179.0])
def test_interp_stays_a_unit_quaternion_on_both_sides_of_the_linear_threshold(degrees: float) -> None:
    # The cosine of half of 16.26 degrees is 0.99.
    _, local = INTERP.generate(
        np.zeros((1, 1, 3)), about_x(0.0)[None, None], np.zeros((1, 3)), about_x(degrees)[None], 9
    )
    np.testing.assert_allclose(np.linalg.norm(local, axis=-1), 1.0)
    np.testing.assert_allclose(rotation.angle(local[0, :, 0]), np.radians(degrees) * np.arange(1, 10) / 10, atol=1e-4)


def test_zero_velocity_holds_the_start_key() -> None:
    context_root, context_local = np.arange(12.0).reshape(2, 2, 3), np.stack([[about_x(5.0), about_x(6.0)]] * 2)
    root, local = ZERO_VELOCITY.generate(
        context_root, context_local, np.zeros((2, 3)), about_x(90.0)[[0, 0]][:, None], 4
    )
    np.testing.assert_array_equal(root, np.repeat(context_root[:, 1:], 4, axis=1))
    np.testing.assert_array_equal(local, np.repeat(context_local[:, 1:], 4, axis=1))


def test_signs_go_on_from_the_start_key() -> None:
    true = about_x(*np.linspace(0.0, 500.0, 20))[None, :, None]
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(1, 20, 1, 1))
    made = continued(-true[:, 0], (signs * true)[:, 1:])
    np.testing.assert_array_equal(np.sum(made[:, 1:] * made[:, :-1], axis=-1) > 0.0, True)
    assert np.sum(made[0, 0, 0] * -true[0, 0, 0]) > 0.0
    np.testing.assert_allclose(np.abs(made), np.abs(true[:, 1:]))


def test_a_model_is_retargeted_on_the_way_in_and_back_on_the_way_out(
    make_clip: MakeClip, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Interpolation on the humanoid, in place of a network, comes back as the data set's own interpolation."""
    seen: list[tuple[int, ...]] = []

    def stand_in(
        model: object,
        start_root: np.ndarray,
        start_local: np.ndarray,
        target_root: np.ndarray,
        target_local: np.ndarray,
        frames: int,
        style: list[str | None],
        seed: int,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        assert (model, style, seed) == ("the model in runs/mine", ["Angry"] * len(start_root), 7)
        seen.append(start_local.shape)
        made = [
            interpolate(Motion(HUMANOID, a, b, 30.0), Motion(HUMANOID, c[None], d[None], 30.0), frames)
            for a, b, c, d in zip(start_root, start_local, target_root, target_local, strict=True)
        ]
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(len(made), frames, 22, 1))
        local = signs * np.stack([m.local_rotations for m in made])
        return np.stack([m.root_positions for m in made]), local, np.zeros((len(made), frames, 4))

    monkeypatch.setattr(model_folder, "load", lambda name: f"the model in {name}")
    monkeypatch.setattr(methods, "generate_batch", stand_in)
    windows = lafan1.cut((make_clip(200),))
    method = from_model("mine", "runs/mine", windows.skeleton, 30.0, context_frames=4, style="Angry", seed=7)
    given = windows.root[:, 6:10], windows.local[:, 6:10], windows.root[:, 25], windows.local[:, 25]
    root, local = method.generate(*given, 15)
    expected_root, expected_local = INTERP.generate(*given, 15)
    assert seen == [(len(windows), 4, 22, 4)]
    np.testing.assert_allclose(root, expected_root, atol=1e-3)  # the humanoid's own hips lie off the line by as much
    np.testing.assert_allclose(local, expected_local, atol=1e-4)
