"""A policy's network: each of its numbers is one sum in one order, however many rows are asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from airhockey_env.actions import DIRECTIONS
from airhockey_env.opponents.policy import _EVEN, _ODD, _TANH_END, FEWEST_LANES, LANES, MlpPolicy, _forward
from tests.helpers import some_policy

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


@pytest.mark.parametrize("stack", [1, 4])
@pytest.mark.parametrize("units", [(2,), (64, 64, 2), (7, 9), (33, 5, 130, 9)], ids=str)
@pytest.mark.parametrize("squash", [False, True])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_every_row_is_the_same_sum(activation, squash, units, stack):
    rng = np.random.default_rng(len(units))
    shape = (13,) if stack == 1 else (stack, 15)
    sizes = (math.prod(shape), *units)
    weights = [rng.normal(size=(n_out, n_in)).astype(np.float32) for n_in, n_out in zip(sizes, units, strict=False)]
    biases = [rng.normal(size=n_out).astype(np.float32) for n_out in units]
    policy = MlpPolicy(weights, biases, activation, squash, stack)
    for n in ROWS:
        seen = rng.uniform(-1.0, 1.0, (n, *shape)).astype(np.float32)
        flat = seen.reshape(n, sizes[0])
        out = np.full((n, units[-1]), np.nan, np.float32)
        _forward(flat, policy._parameters, policy._sizes, activation == "tanh", squash, out)
        expected = reference(flat, weights, biases, activation == "tanh", squash).astype(np.float32)
        assert out.tobytes() == expected.tobytes(), n
        chosen = expected.clip(-1.0, 1.0) if units[-1] == 2 else DIRECTIONS[expected.argmax(axis=1)]
        assert policy(seen).tobytes() == chosen.tobytes()
        longer = np.concatenate([seen, seen], axis=1)[:, -shape[0] :]  # not laid out one after the other
        assert policy(longer).tobytes() == chosen.tobytes()


def test_a_policy_takes_what_it_was_made_for():
    for policy in (some_policy(), some_policy(stack=2), some_policy(stack=3)):
        for shape in ((4, 13), (4, 2, 15), (4, 3, 15), (4, 30), (4,)):
            if shape[1:] == ((13,) if policy.stack == 1 else (policy.stack, 15)):
                assert policy(np.zeros(shape, np.float32)).shape == (4, 2)
            else:
                with pytest.raises(ValueError, match=r"^observations must .*got \(4,"):
                    policy(np.zeros(shape, np.float32))


@pytest.mark.parametrize("stack", [0, 65, 1.0, "2", None])
def test_a_stack_out_of_range_is_named(stack):
    with pytest.raises(ValueError, match=r"^stack must be .*got "):
        MlpPolicy([np.zeros((2, 13))], [np.zeros(2)], stack=stack)


@pytest.mark.parametrize("stack", [1, 2, 7])
def test_files_keep_the_stack(stack, tmp_path):
    policy, path = some_policy(stack=stack), tmp_path / "policy.npz"
    policy.save(path)
    seen = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 13) if stack == 1 else (5, stack, 15)).astype(np.float32)
    assert MlpPolicy.load(path).stack == stack
    assert MlpPolicy.load(path)(seen).tobytes() == policy(seen).tobytes()
    with np.load(path) as file:
        arrays = dict(file)
    del arrays["stack"]  # as in files of older versions
    np.savez(path, **arrays)
    if stack == 1:
        assert MlpPolicy.load(path)(seen).tobytes() == policy(seen).tobytes()
    else:
        with pytest.raises(ValueError, match=r"does not hold a policy: layer 0 "):
            MlpPolicy.load(path)
    for wrong in (np.array(2.0), np.array([stack]), np.array(0), np.array("1")):
        np.savez(path, **arrays, stack=wrong)
        with pytest.raises(ValueError, match=r"does not hold a policy: stack must be "):
            MlpPolicy.load(path)
