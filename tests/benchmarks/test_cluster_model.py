"""The model of data-parallel training: what it must say where that can be computed by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.cluster.costs import Costs, fit_costs
from benchmarks.cluster.model import Sizes, averaging, expect, fit_spread, sent

SIZES = Sizes(num_envs=512, n_steps=32, batch_size=2048, n_epochs=3)
FREE = Costs(step=0.0, table=1e-6, gradient=0.0, sample=2e-6, latency=0.0, byte=0.0, size=40_000)


def test_an_update_of_one_worker() -> None:
    assert (SIZES.steps, SIZES.gradients) == (16_384, 24)
    costs = replace(FREE, step=1e-4, gradient=1e-3, latency=1.0, byte=1.0)
    seconds = 32 * (1e-4 + 512e-6) + 24 * (1e-3 + 2048 * 2e-6)
    found = expect(costs, 1, SIZES)
    assert found.per_second == pytest.approx(16_384 / seconds)
    assert (found.averaging, found.waiting) == (0.0, 0.0)


@pytest.mark.parametrize("sizes", [SIZES, SIZES.times(8)], ids=["the same in all", "the same for each"])
def test_where_nothing_is_lost_eight_workers_are_eight_times_as_fast(sizes: Sizes) -> None:
    one = expect(FREE, 1, SIZES).per_second
    assert expect(FREE, 8, sizes).per_second == pytest.approx(8 * one)


def test_the_messages_of_a_ring() -> None:
    costs = replace(FREE, latency=1e-3, byte=1e-6)
    assert averaging(costs, 1) == 0.0
    assert averaging(costs, 2) == pytest.approx(2 * (1e-3 + 0.02))
    assert averaging(costs, 4) == pytest.approx(6 * (1e-3 + 0.01))
    assert sent(costs, 4, SIZES) == pytest.approx(24 * 1.5 * 40_000)
    found = expect(costs, 4, SIZES)
    compute = 32 * 128e-6 + 24 * 512 * 2e-6
    assert found.averaging == pytest.approx(24 * averaging(costs, 4) / (24 * averaging(costs, 4) + compute))


def test_more_workers_wait_longer() -> None:
    costs = replace(FREE, spread=0.3)
    waits = [expect(costs, workers, SIZES.times(workers)).waiting for workers in (1, 2, 8, 64)]
    assert waits[0] == pytest.approx(0.0, abs=1e-12)
    assert waits == sorted(waits) and 0.05 < waits[1] < waits[3] < 0.6


def test_the_spread_is_found_again() -> None:
    costs = replace(FREE, latency=1e-5, spread=0.25)
    measured = {workers: expect(costs, workers, SIZES, seed=1).per_second for workers in (1, 2)}
    assert fit_spread(costs, measured, SIZES).spread == pytest.approx(0.25, abs=0.03)
    with pytest.raises(ValueError, match="1 worker"):
        fit_spread(costs, {2: 1.0, 4: 2.0}, SIZES)


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [
        ([5.0, 7.0, 11.0], (2.0, 3.0)),
        ([4.0, 3.0, 2.0], (0.0, 3.0)),  # more tables that take less time: nothing to be seen of them but chance
        ([1.0, 4.0, 10.0], (49.0 / 21.0, 0.0)),
    ],
)
def test_no_cost_is_negative(seconds: list[float], expected: tuple[float, float]) -> None:
    assert fit_costs(np.array([1.0, 2.0, 4.0]), np.array(seconds)) == pytest.approx(expected)
