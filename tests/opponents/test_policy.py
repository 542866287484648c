"""A policy's network: each of its numbers is one sum in one order, however many rows are asked for."""

from __future__ import annotations

import numpy as np
import pytest

from airhockey_env.opponents.policy import _EVEN, _ODD, _TANH_END, FEWEST_LANES, LANES, MlpPolicy, _forward

ROWS = (0, 1, FEWEST_LANES - 1, FEWEST_LANES, LANES - 1, LANES, LANES + 1, LANES + FEWEST_LANES, 3 * LANES)


def tanh(x):
    """The rational function, term by term in single precision."""
    x = np.clip(x, -_TANH_END, _TANH_END)
    odd, even = _ODD[0], _EVEN[0]
    for c in _ODD[1:]:
        odd = odd * (x * x) + c
    for c in _EVEN[1:]:
        even = even * (x * x) + c
    return x * odd / even


def reference(seen, weights, biases, use_tanh, squash):
    """Bias first, then one product after the other."""
    values = seen
    for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        sums = np.repeat(bias[np.newaxis], len(values), axis=0)
        for k in range(weight.shape[1]):
            sums = sums + values[:, k : k + 1] * weight[:, k]
        last = layer == len(weights) - 1
        if last:
            return tanh(sums) if squash else sums
        values = tanh(sums) if use_tanh else np.where(sums > 0.0, sums, np.float32(0.0))
    raise AssertionError("no layers")


@pytest.mark.parametrize("units", [(2,), (64, 64, 2), (7, 9), (33, 5, 130, 9)], ids=str)
@pytest.mark.parametrize("squash", [False, True])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_every_row_is_the_same_sum(activation, squash, units):
    rng = np.random.default_rng(len(units))
    sizes = (13, *units)
    weights = [rng.normal(size=(n_out, n_in)).astype(np.float32) for n_in, n_out in zip(sizes, units, strict=False)]
    biases = [rng.normal(size=n_out).astype(np.float32) for n_out in units]
    policy = MlpPolicy(weights, biases, activation, squash)
    for n in ROWS:
        seen = rng.uniform(-1.0, 1.0, (n, 13)).astype(np.float32)
        out = np.full((n, units[-1]), np.nan, np.float32)
        _forward(seen, policy._parameters, policy._sizes, activation == "tanh", squash, out)
        expected = reference(seen, weights, biases, activation == "tanh", squash)
        assert out.tobytes() == expected.astype(np.float32).tobytes(), n
