from __future__ import annotations

import math

import pytest
import torch

from interpose.models.periodic_autoencoder import PeriodicAutoencoder, Phase, TimeConvolution, spectrum

FRAMES, RATE = 61, 30.0
TIME = (torch.arange(FRAMES) - FRAMES // 2) / RATE


def sinusoid(frequency: float, amplitude: float, shift: float, offset: float) -> torch.Tensor:
    return amplitude * torch.sin(2 * math.pi * (frequency * TIME + shift)) + offset


def test_the_convolution_is_torchs() -> None:
    torch.manual_seed(0)
    layer, x = TimeConvolution(6, 4, FRAMES), torch.randn(3, 6, FRAMES, requires_grad=True)
    expected = torch.nn.functional.conv1d(x, layer.weight, layer.bias, padding=FRAMES // 2)
    torch.testing.assert_close(layer(x), expected, rtol=1e-4, atol=1e-5)
    weights = torch.randn_like(expected)
    ours = torch.autograd.grad((layer(x) * weights).sum(), [x, layer.weight])
    torch.testing.assert_close(ours, torch.autograd.grad((expected * weights).sum(), [x, layer.weight]))


def test_a_window_without_a_middle_is_refused() -> None:
    with pytest.raises(ValueError, match="odd number"):
        TimeConvolution(1, 1, 60)


@pytest.mark.parametrize("periods", [1, 3, 6])
@pytest.mark.parametrize("amplitude", [0.05, 2.0])
def test_the_spectrum_finds_a_whole_number_of_periods_exactly(periods: int, amplitude: float) -> None:
    curve = sinusoid(periods * RATE / FRAMES, amplitude, 0.2, -0.7)
    frequency, found, offset = spectrum(curve[None, None], RATE)
    assert frequency.item() == pytest.approx(periods * RATE / FRAMES, abs=1e-4)
    assert found.item() == pytest.approx(amplitude, rel=1e-4)
    assert offset.item() == pytest.approx(-0.7, abs=1e-5)


def test_the_spectrum_finds_any_frequency_nearly() -> None:
    for hertz in (0.9, 1.3, 2.2):
        frequency, amplitude, _ = spectrum(sinusoid(hertz, 1.0, 0.1, 0.0)[None, None], RATE)
        assert frequency.item() == pytest.approx(hertz, abs=0.5)
        assert amplitude.item() == pytest.approx(1.0, abs=0.1)


def passing(channels: int = 2) -> PeriodicAutoencoder:
    """An autoencoder whose latent curves are the first velocity curves and whose phase is that of bin 2, by hand."""
    model = PeriodicAutoencoder(joints=4, channels=channels)
    model.encoder = torch.nn.Sequential(Pick(channels))
    angle = 2 * math.pi * 2 * RATE / FRAMES * TIME
    with torch.no_grad():
        model.direction.copy_(torch.stack([angle.sin(), angle.cos()], dim=-1).expand_as(model.direction))
        model.direction_bias.zero_()
    return model


class Pick(torch.nn.Module):
    def __init__(self, channels: int) -> None:
        super().__init__()
        self.channels = channels

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return x[:, : self.channels]


def window(*curves: torch.Tensor) -> torch.Tensor:
    return torch.cat([torch.stack(curves), torch.zeros(12 - len(curves), FRAMES)])[None]


@pytest.mark.parametrize("shift", [-0.45, -0.1, 0.0, 0.3])
def test_the_sinusoid_of_a_latent_sinusoid_is_itself(shift: float) -> None:
    hertz = 2 * RATE / FRAMES
    curves = [sinusoid(hertz, 0.8, shift, 0.3), sinusoid(hertz, 0.2, -shift, -1.0)]
    model = passing()
    phase = model.encode(window(*curves))
    assert phase.shift[0].tolist() == pytest.approx([shift, -shift], abs=1e-4)
    torch.testing.assert_close(model.curves(phase)[0], torch.stack(curves), rtol=0, atol=1e-3)
    torch.testing.assert_close(phase.point().norm(dim=-1), phase.amplitude)


def test_a_window_that_moves_on_turns_the_phase_by_its_frequency() -> None:
    hertz, model = 2 * RATE / FRAMES, passing(1)
    shifts = [model.encode(window(sinusoid(hertz, 1.0, hertz * later / RATE, 0.0))).shift.item() for later in range(40)]
    steps = (torch.tensor(shifts).diff() + 0.5) % 1.0 - 0.5
    torch.testing.assert_close(steps, torch.full_like(steps, hertz / RATE), rtol=0, atol=1e-4)


@pytest.mark.parametrize("normalised", [False, True])
def test_stillness_gives_numbers_and_finite_gradients(normalised: bool) -> None:
    model = PeriodicAutoencoder(normalised=normalised)
    with torch.no_grad():
        for weight in model.parameters():
            weight.zero_()
    still = torch.zeros(2, 66, FRAMES)
    assert all(value.isfinite().all() for value in model.encode(still))
    (model(still) - 1.0).square().mean().backward()
    assert all(weight.grad is not None and weight.grad.isfinite().all() for weight in model.parameters())


def test_the_reconstruction_has_the_form_of_the_window_and_every_weight_takes_part() -> None:
    torch.manual_seed(0)
    model = PeriodicAutoencoder(channels=10)
    x = torch.randn(3, 66, FRAMES)
    phase = model.encode(x)
    assert isinstance(phase, Phase)
    assert all(value.shape == (3, 10) for value in phase)
    (model(x) - x).square().mean().backward()
    assert all(weight.grad is not None and weight.grad.abs().max() > 0 for weight in model.parameters())
    assert torch.all((phase.shift > -0.5) & (phase.shift <= 0.5) & (phase.amplitude >= 0))
