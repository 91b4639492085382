"""Layers against formulas written out."""

import math

import numpy as np
import pytest
import torch

from interpose.models.layers import Cell, ExpertLinear, residual_mlp, sinusoids


def test_blending_outputs_is_blending_weights():
    torch.manual_seed(0)
    layer = ExpertLinear(3, 5, 4)
    torch.nn.init.normal_(layer.linear.bias)
    x, gate = torch.randn(7, 5), torch.softmax(torch.randn(7, 3), dim=-1)
    weight, bias = layer.linear.weight.view(3, 4, 5), layer.linear.bias.view(3, 4)
    blended = torch.einsum("bk,koi->boi", gate, weight)
    wanted = (blended @ x[..., None])[..., 0] + gate @ bias
    torch.testing.assert_close(layer(x, gate), wanted)


def test_the_embedding_of_time_is_equation_2():
    frames = torch.tensor([[1.0], [45.0], [91.0]], dtype=torch.float64)
    got = sinusoids(frames)
    assert got.shape == (3, 128)
    for row, tta in enumerate((1.0, 45.0, 91.0)):
        for i in range(64):
            angle = tta / 10000.0 ** (2 * i / 128)
            assert float(got[row, 2 * i]) == pytest.approx(math.sin(angle))
            assert float(got[row, 2 * i + 1]) == pytest.approx(math.cos(angle))


def test_a_cell_is_torchs_own_lstm():
    torch.manual_seed(0)
    cell, other = Cell(5, 7), torch.nn.LSTMCell(5, 7)
    # Ours orders the gates take, keep, give, new; torch's take, keep, new, give.
    order = [0, 1, 3, 2]
    weight = cell.linear.weight.detach().chunk(4)
    bias = cell.linear.bias.detach().chunk(4)
    with torch.no_grad():
        other.weight_ih.copy_(torch.cat([weight[i][:, :5] for i in order]))
        other.weight_hh.copy_(torch.cat([weight[i][:, 5:] for i in order]))
        other.bias_ih.copy_(torch.cat([bias[i] for i in order]))
        other.bias_hh.zero_()
    x, hidden, state = torch.randn(3, 5), torch.randn(3, 7), torch.randn(3, 7)
    wanted = other(x, (hidden, state))
    torch.testing.assert_close(cell(x, hidden, state), wanted)
    assert np.allclose(Cell(5, 7).linear.bias.detach()[7:14], 1.0)


def test_a_residual_network_says_little_at_first_and_is_a_linear_map_then():
    torch.manual_seed(0)
    network = residual_mlp(6, 8, 3, depth=2).eval()
    x = torch.randn(5, 6)
    wide = network[0](x)
    assert torch.equal(network[2](network[1](wide)), wide)
    assert float(network(x).detach().abs().max()) < 0.5
