"""Packed discs that lose energy: settled at once, by the laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings

from airhockey_env.air_table import AirTable
from airhockey_env.engine.cluster import patience
from airhockey_env.engine.near import FEWEST
from airhockey_env.engine.tolerances import TABLE_CONTACTS
from tests.engine.scenes import deepest_overlap, laws, momentum, seeds


def packed(n: int, gap: float, radius: float = 0.02) -> np.ndarray:
    """The n places nearest to the centre of a hexagonal packing with a gap between neighbours, m."""
    k = math.ceil(math.sqrt(n)) + 2
    places = np.array(
        [(i + 0.5 * (j % 2), 0.5 * math.sqrt(3.0) * j) for i in range(-k, k + 1) for j in range(-k, k + 1)]
    )
    nearest = np.argsort(np.hypot(*places.T).round(9), kind="stable")[:n]
    return places[nearest] * (2.0 * radius + gap)


def random_cluster(seed: int, walls: bool, **changes) -> dict:
    """A packed cluster in some motion, with sizes, masses, gaps and losses drawn at random."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(FEWEST, 60))
    positions = packed(n, rng.choice([0.0, 1e-9, 1e-6, 1e-4, 1e-3]))
    velocities = {
        0: lambda: rng.uniform(-2.0, 2.0, positions.shape),
        1: lambda: rng.uniform(-3.0, 3.0, 2) - rng.uniform(0.5, 5.0) * positions,
        2: lambda: np.where(np.arange(n)[:, None] == n - 1, -20.0 * positions, 0.0),
    }[int(rng.integers(3))]()
    masses = 10.0 ** rng.uniform(-1.0, 1.0, n) if rng.random() < 0.5 else np.ones(n)
    half = np.abs(positions).max(axis=0) + 0.02
    return {
        "positions": positions,
        "velocities": velocities,
        "radii": np.where(rng.random(n) < 0.5, 0.02, 0.0199),
        "masses": masses,
        "restitution": float(rng.choice([0.0, 0.1, 0.5])),
        "wall_restitution": float(rng.choice([0.0, 0.5, 1.0])),
        "size": tuple(2.0 * (half + rng.uniform(1e-6, 0.02))) if walls else None,
    } | changes


def spin(table: AirTable) -> float:
    (x, y), (vx, vy) = table.positions.T, table.velocities.T
    return float((table.masses * (x * vy - y * vx)).sum())


few = settings(laws, max_examples=60)


@few
@given(seeds)
def test_clusters_in_flight_keep_momentum_and_spin(seed):
    table = AirTable(**random_cluster(seed, walls=False))
    before, turning, scale = momentum(table), spin(table), 1e-12 * table.masses.sum()
    for _ in range(5):
        energy = table.energy
        contacts = table.step(0.02)
        assert table.energy <= energy * (1.0 + 1e-14)
        assert deepest_overlap(table) < 1e-11
        assert (np.diff(contacts["time"]) >= 0.0).all()
        assert (contacts["impulse"] > 0.0).all()
    np.testing.assert_allclose(momentum(table), before, rtol=0, atol=scale)
    assert spin(table) == pytest.approx(turning, rel=0, abs=scale)


@few
@given(seeds)
def test_clusters_between_walls_stay_on_the_table_and_never_gain(seed):
    table = AirTable(**random_cluster(seed, walls=True))
    for _ in range(4):
        energy, before = table.energy, momentum(table)
        contacts = table.step(0.02)
        assert table.energy <= energy * (1.0 + 1e-14)
        assert deepest_overlap(table) < 1e-11
        at_wall = contacts[contacts["b"] == -1]
        push = (at_wall["impulse"][:, None] * np.stack([at_wall["nx"], at_wall["ny"]], axis=1)).sum(axis=0)
        np.testing.assert_allclose(momentum(table) - before, push, rtol=0, atol=1e-11 * table.masses.sum())


@settings(laws, max_examples=25)
@given(seeds)
def test_driven_discs_and_posts_among_them_keep_their_velocity(seed):
    scene = random_cluster(seed, walls=True)
    rng = np.random.default_rng(seed + 1)
    scene["masses"][rng.random(len(scene["masses"])) < 0.1] = np.inf
    driven = np.isinf(scene["masses"])
    scene["velocities"][driven] = rng.choice([0.0, 0.5]) * rng.uniform(-1.0, 1.0, 2)  # all the same way
    table = AirTable(**scene)
    for _ in range(3):
        table.step(0.02)
        assert deepest_overlap(table) < 1e-9
        assert np.isfinite(table.velocities).all()
        assert (table.velocities[driven] == scene["velocities"][driven]).all()


@pytest.mark.parametrize("signs", [(-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)])
@settings(laws, max_examples=20)
@given(seed=seeds)
def test_a_mirrored_cluster_plays_the_mirrored_game(signs, seed):
    scene = random_cluster(seed, walls=True)
    table = AirTable(**scene)
    mirror = AirTable(**scene | {"positions": scene["positions"] * signs, "velocities": scene["velocities"] * signs})
    for _ in range(2):
        assert len(table.step(0.02)) == len(mirror.step(0.02))
        assert (table.positions == mirror.positions * signs).all()
        assert (table.velocities == mirror.velocities * signs).all()


@pytest.mark.parametrize("restitution", [0.0, 0.1, 0.5])
@pytest.mark.parametrize("gap", [0.0, 1e-6, 1e-4])
def test_two_hundred_packed_pucks_have_no_endless_train_of_contacts(restitution, gap):
    """One by one they would have up to a million contacts, and 20 s of work in a step of 0.02 s."""
    positions = packed(200, gap)
    velocities = -2.0 * positions
    table = AirTable(positions, velocities, 0.02, restitution=restitution, size=None)
    energy = table.energy
    contacts = sum(len(table.step(0.02)) for _ in range(3))
    assert 500 < contacts < 20_000
    assert table.energy < 0.01 * energy  # what falls in on its centre comes to rest
    assert deepest_overlap(table) < 1e-11


def test_a_row_that_is_hit_moves_on_together():
    """The closed form: without rebound, all move with the speed of the centre of mass."""
    n = 20
    positions = np.zeros((n, 2))
    positions[:, 0] = 0.1 * np.arange(n)
    velocities = np.zeros((n, 2))
    velocities[0, 0] = 5.0
    table = AirTable(positions, velocities, 0.05, restitution=0.0, size=None)
    table.step(1e-3)
    np.testing.assert_allclose(table.velocities, np.tile([5.0 / n, 0.0], (n, 1)), rtol=0, atol=1e-10)


def test_what_loses_nothing_is_never_settled():
    assert patience(0.0) < patience(0.1) < patience(0.5) < patience(0.9) < TABLE_CONTACTS
    assert patience(1.0) == patience(math.nextafter(1.0, 0.0)) == math.inf
    table = AirTable(packed(30, 0.0), -2.0 * packed(30, 0.0), 0.02, size=None)
    energy = table.energy
    table.step(0.02)
    assert table.energy == pytest.approx(energy, rel=1e-12)
