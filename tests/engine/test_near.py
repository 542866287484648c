"""The broad phase leaves no contact out: with it and without it, the same to the bit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airhockey_env.air_table import AirTable
from airhockey_env.engine.near import FEWEST, PARTNERS, find_near, make_near
from airhockey_env.engine.tolerances import SKIN
from tests.engine.scenes import laws, random_scene, seeds


def play_both(table: AirTable, every_pair: AirTable, dt: float, steps: int) -> int:
    """Play a table with the broad phase and one without it, and compare; the number of contacts."""
    assert table._near is not None and table._cluster is not None
    table._cluster.patience[:] = math.inf  # clusters are settled only where there is a broad phase
    every_pair._near = None
    contacts = 0
    for _ in range(steps):
        played, expected = table.step(dt), every_pair.step(dt)
        assert played.tobytes() == expected.tobytes()
        assert table.positions.tobytes() == every_pair.positions.tobytes()
        assert table.velocities.tobytes() == every_pair.velocities.tobytes()
        contacts += len(played)
    return contacts


@laws
@given(seeds, st.sampled_from([0.001, 0.02, 0.5]), st.sampled_from([0.0, 0.3]))
def test_random_tables(seed: int, dt: float, heavy: float) -> None:
    scene = random_scene(np.random.default_rng(seed), discs=(FEWEST, 16), heavy=heavy, radii=(0.02, 0.05))
    play_both(scene.table(), scene.table(), dt, 5)


def grid(n: int, moving: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """n * n pucks on a square of 2 m, a share of which moves."""
    places = (np.arange(n) + 0.5) / n * 2.0 - 1.0
    positions = np.stack(np.meshgrid(places, places), axis=-1).reshape(-1, 2)
    rng = np.random.default_rng(seed)
    velocities = rng.normal(0.0, 3.0, positions.shape)
    velocities[rng.random(len(positions)) >= moving] = 0.0
    return positions, velocities


@pytest.mark.parametrize("moving", [0.02, 0.5, 1.0])
@pytest.mark.parametrize("dt", [0.02, 0.3])
def test_many_pucks_at_rest_and_in_motion(moving: float, dt: float) -> None:
    positions, velocities = grid(10, moving, 0)
    tables = [AirTable(positions, velocities, 0.07, size=(2.0, 2.0)) for _ in range(2)]
    assert play_both(*tables, dt, round(3.0 / dt)) > 20


def test_a_row_that_touches_passes_a_blow_on() -> None:
    """Every bounce makes a resting disc fast, so the pairs have to be found anew inside the step."""
    n = 20
    positions = np.zeros((n + 1, 2))
    positions[1:, 0] = 0.1 * np.arange(n)
    positions[0, 0] = -0.3
    velocities = np.zeros((n + 1, 2))
    velocities[0, 0] = 5.0
    tables = [AirTable(positions, velocities, 0.05, size=None) for _ in range(2)]
    assert play_both(*tables, 0.1, 3) >= n


def test_the_pairs_are_those_whose_reaches_meet() -> None:
    positions, velocities = grid(8, 0.3, 1)
    table = AirTable(positions, velocities, 0.05, size=(2.0, 2.0))
    near = make_near(len(positions))
    find_near(near, table._discs(), 0.02)
    assert not near.whole[0]
    reach = 0.05 * (1.0 + SKIN) + 1.5 * np.hypot(*velocities.T) * 0.02
    for a in range(len(positions)):
        partners = near.partner[near.start[a] : near.start[a + 1]].tolist()
        gaps = np.abs(positions - positions[a]).max(axis=1)
        assert partners == [b for b in range(a + 1, len(positions)) if gaps[b] <= reach[a] + reach[b]]


def test_with_too_many_pairs_all_are_asked() -> None:
    positions, velocities = grid(14, 1.0, 2)
    tables = [AirTable(positions, velocities, 0.05, size=(2.0, 2.0)) for _ in range(2)]
    near = make_near(len(positions))
    find_near(near, tables[0]._discs(), math.inf)
    assert near.whole[0]
    assert len(near.partner) == len(positions) * PARTNERS < len(positions) * (len(positions) - 1) // 2
    play_both(*tables, 0.3, 1)
