"""Diagonal normal distributions against torch's."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.distributions import Normal as Oracle
from torch.distributions import kl_divergence

from interpose.models.normal import Normal, divergence, normal

numbers = st.floats(-3.0, 3.0)


@given(numbers, st.floats(-2.0, 2.0), numbers, st.floats(-2.0, 2.0))
def test_divergence_is_that_of_torch(a, b, c, d):
    q, p = ((torch.tensor([[mean]]).double(), torch.tensor([[log]]).double()) for mean, log in ((a, b), (c, d)))
    wanted = kl_divergence(Oracle(q[0], q[1].exp()), Oracle(p[0], p[1].exp()))
    torch.testing.assert_close(divergence(Normal(*q), Normal(*p)), wanted)
    assert float(divergence(Normal(*q), Normal(*q))) == pytest.approx(0.0, abs=1e-12)


def test_a_head_predicts_a_mean_and_a_deviation_within_bounds():
    made = normal(torch.tensor([[1.0, -2.0, -50.0, 0.5], [0.0, 0.0, 50.0, 3.5]]))
    assert made.mean.tolist() == [[1.0, -2.0], [0.0, 0.0]]
    assert made.log_deviation.tolist() == [[-5.0, 0.5], [3.0, 3.0]]
    noise = torch.tensor([[1.0, 2.0], [0.0, -1.0]])
    wanted = [[1.0 + math.exp(-5.0), -2.0 + 2.0 * math.exp(0.5)], [0.0, -math.exp(3.0)]]
    np.testing.assert_allclose(made.at(noise), wanted, rtol=1e-6)
