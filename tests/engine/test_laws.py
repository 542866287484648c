"""Conservation laws, reversal and closed forms, on random tables."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airhockey_env.engine.kiss import kiss_time
from tests.engine.scenes import deepest_overlap, laws, momentum, random_scene, seeds


@laws
@given(seeds)
def test_momentum_is_conserved_without_walls(seed):
    rng = np.random.default_rng(seed)
    table = random_scene(rng, walls=False).table()
    before = momentum(table)
    for _ in range(4):
        table.step(0.1)
    np.testing.assert_allclose(momentum(table), before, rtol=0, atol=1e-12 * table.masses.sum())


@laws
@given(seeds)
def test_elastic_contacts_conserve_energy(seed):
    table = random_scene(np.random.default_rng(seed), elastic=True, discs=(2, 6)).table()
    before = table.energy
    for _ in range(10):
        table.step(0.2)
    assert table.energy == pytest.approx(before, rel=1e-12)


@laws
@given(seeds)
def test_energy_never_grows(seed):
    table = random_scene(np.random.default_rng(seed), elastic=False, discs=(2, 6)).table()
    for _ in range(10):
        before = table.energy
        contacts = table.step(0.1)
        assert table.energy <= before * (1.0 + 1e-14)
        assert len(contacts) or table.energy == before


@laws
@given(seeds)
def test_no_overlap_ever(seed):
    table = random_scene(np.random.default_rng(seed), discs=(3, 6), speed=25.0).table()
    for _ in range(10):
        table.step(0.05)
        assert deepest_overlap(table) < 1e-13


@laws
@given(seeds)
def test_time_reversal(seed):
    """Sparse, short scenes: each hit on a disc multiplies roundings by about ten, there and back."""
    scene = random_scene(np.random.default_rng(seed), discs=(1, 3), elastic=True, speed=3.0)
    table = scene.table()
    forth = len(table.step(0.3))
    table.velocities = -table.velocities
    back = len(table.step(0.3))
    assert back == forth
    np.testing.assert_allclose(table.positions, scene.positions, rtol=0, atol=1e-8)
    np.testing.assert_allclose(-table.velocities, scene.velocities, rtol=0, atol=1e-7)


@laws
@given(seeds, st.integers(2, 40))
def test_the_step_may_be_divided_at_will(seed, parts):
    scene = random_scene(np.random.default_rng(seed), discs=(1, 4), speed=4.0)
    whole, divided = scene.table(), scene.table()
    contacts = whole.step(0.25)
    pieces = []
    for k in range(parts):
        piece = divided.step(0.25 / parts)
        piece["time"] += k * 0.25 / parts
        pieces.append(piece)
    pieces = np.concatenate(pieces)
    assert contacts[["a", "b"]].tolist() == pieces[["a", "b"]].tolist()
    np.testing.assert_allclose(pieces["time"], contacts["time"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(divided.positions, whole.positions, rtol=0, atol=1e-9)
    np.testing.assert_allclose(divided.velocities, whole.velocities, rtol=0, atol=1e-8)


@laws
@given(
    st.floats(0.0, 2.0 * math.pi), st.floats(0.0, 0.999), st.floats(0.1, 100.0), st.floats(0.01, 1.0),
    st.floats(1e-3, 10.0),
)  # fmt: skip
def test_kiss_times_have_their_closed_form(angle, thinness, speed, reach, way):
    """Built backwards from the kiss: along the path, `way` before the place where the discs touch."""
    ux, uy = math.cos(angle), math.sin(angle)
    shared, top = thinness * reach, math.sqrt(1.0 - thinness**2) * reach
    dx, dy = -(way + top) * ux - shared * uy, -(way + top) * uy + shared * ux
    time = kiss_time(dx, dy, speed * ux, speed * uy, reach)
    # Roundings of the distance weigh more in a thin hit, by distance over top leg.
    assert time * speed == pytest.approx(way, abs=1e-15 * (way + reach) ** 2 / top * 10)


@laws
@given(seeds)
def test_the_tick_before_the_kiss_sees_none(seed):
    """Up to just before the first contact a table is in free flight; the contact comes right after."""
    scene = random_scene(np.random.default_rng(seed), discs=(2, 4))
    first = scene.table().step(0.5)[:1]
    if len(first) == 0 or first["time"][0] < 1e-6:
        return
    table = scene.table()
    time = first["time"][0]
    assert len(table.step(time - 1e-9)) == 0
    np.testing.assert_array_equal(table.velocities, scene.velocities)
    assert table.step(2e-9)[["a", "b"]].tolist()[:1] == first[["a", "b"]].tolist()


@laws
@given(seeds)
def test_a_moving_frame_sees_the_same(seed):
    """Galilei: without walls, a common drift changes nothing but where it all happens."""
    rng = np.random.default_rng(seed)
    scene = random_scene(rng, discs=(2, 4), walls=False)
    drift = rng.uniform(-5.0, 5.0, 2)
    still, moving = scene.table(), dataclasses.replace(scene, velocities=scene.velocities + drift).table()
    assert still.step(0.2)[["a", "b"]].tolist() == moving.step(0.2)[["a", "b"]].tolist()
    np.testing.assert_allclose(moving.positions - 0.2 * drift, still.positions, rtol=0, atol=1e-9)
    np.testing.assert_allclose(moving.velocities - drift, still.velocities, rtol=0, atol=1e-8)
