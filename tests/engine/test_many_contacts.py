"""Long trains of contacts: honest ones are all played, and those without an end are cut short."""

from __future__ import annotations

import numpy as np
import pytest

from airhockey_env.air_table import AirTable
from airhockey_env.engine.tolerances import TABLE_CONTACTS
from tests.engine.scenes import deepest_overlap, momentum


@pytest.mark.parametrize(("ratio", "contacts"), [(1.0, 3), (1e2, 31), (1e4, 314), (1e6, 3141)])
@pytest.mark.parametrize("dt", [15.0, 0.01])
def test_a_heavy_puck_a_light_one_and_a_wall_count_the_digits_of_pi(ratio, contacts, dt):
    """Galperin's billiard: the number of contacts is pi * sqrt(ratio), rounded down."""
    table = AirTable([[-19.5, 0.0], [-19.0, 0.0]], [[0.0, 0.0], [-1.0, 0.0]], 0.05, [1.0, ratio], size=(40.0, 1.0))
    assert sum(len(table.step(dt)) for _ in range(round(15.0 / dt))) == contacts
    assert table.energy == pytest.approx(0.5 * ratio, rel=1e-12)


def test_a_pair_that_sticks_together_keeps_its_momentum():
    """Once such pairs lay an ulp apart, kissed for ever at time 0, and were brought to rest in mid-flight."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        offset = rng.uniform(0.02, 0.1) * np.array([np.cos(angle), np.sin(angle)])
        positions = np.array([[0.0, 0.0], offset / np.hypot(*offset) * 0.11])
        drift = rng.uniform(-5.0, 5.0, 2)
        velocities = np.array([drift + rng.uniform(0.5, 3.0) * positions[1], drift + rng.uniform(-1.0, 1.0, 2)])
        table = AirTable(positions, velocities, 0.05, rng.uniform(0.1, 5.0, 2), restitution=0.0, size=None)
        before = momentum(table)
        for _ in range(5):
            assert len(table.step(0.1)) <= 10
        np.testing.assert_allclose(momentum(table), before, rtol=0, atol=1e-12)


@pytest.mark.parametrize("restitution", [0.0, 0.1, 0.3, 0.6])
def test_clusters_that_collapse_in_flight_keep_their_momentum(restitution):
    rng = np.random.default_rng(1)
    for _ in range(60):
        n = 5
        angle = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
        positions = rng.uniform(0.15, 0.3, (n, 1)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        velocities = rng.uniform(-5.0, 5.0, 2) - rng.uniform(1.0, 5.0) * positions
        table = AirTable(positions, velocities, 0.05, rng.uniform(0.1, 5.0, n), restitution, size=None)
        before = momentum(table)
        for _ in range(5):
            table.step(0.1)
        np.testing.assert_allclose(momentum(table), before, rtol=0, atol=1e-11)
        assert deepest_overlap(table) < 1e-12


def test_pucks_between_driven_discs_and_walls_never_overlap_or_leave_the_table():
    rng = np.random.default_rng(2)
    busiest = 0
    for _ in range(40):
        n = 4
        positions = np.array([[-0.6, -0.2], [-0.2, 0.2], [0.2, -0.2], [0.6, 0.2], [0.0, 0.0]])
        masses = np.array([np.inf, 1.0, 0.2, np.inf, 0.05])
        radii = rng.uniform(0.05, 0.12, n + 1)
        velocities = rng.uniform(-3.0, 3.0, (n + 1, 2))
        restitution, wall_restitution = rng.uniform(0.0, 1.0, 2)
        table = AirTable(positions, velocities, radii, masses, restitution, wall_restitution)
        for _ in range(25):
            busiest = max(busiest, len(table.step(0.02)))
            assert deepest_overlap(table) < 1e-9
            # Driven home again by the walls, as paddles are; a driven disc passes through walls by itself.
            beyond = np.abs(table.positions) + radii[:, None] > [1.0, 0.5]
            outwards = beyond & (table.velocities * table.positions > 0.0) & np.isinf(masses)[:, None]
            table.velocities[outwards] *= -1.0
    assert busiest > 1000  # some of them did squeeze


def test_a_train_of_contacts_beyond_the_bound_is_cut_short():
    """A speck between two heavy pucks that lose a little with every contact would need a million of them."""
    table = AirTable(
        [[-0.5, 0.0], [0.0, 0.0], [0.5, 0.0]], [[2.0, 0.0], [0.1, 0.0], [-1.0, 0.0]], 0.05, [1.0, 1e-12, 1.0],
        restitution=0.99999, size=None,
    )  # fmt: skip
    assert len(table.step(1.0)) == 2 * TABLE_CONTACTS
    assert table.energy < 2.5
    assert deepest_overlap(table) < 1e-12
