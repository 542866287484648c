"""What a contact reports agrees with what it did."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given

from tests.engine.scenes import laws, random_scene, seeds


@laws
@given(seeds)
def test_contacts_come_in_the_order_of_time_and_within_the_step(seed):
    table = random_scene(np.random.default_rng(seed), discs=(3, 6), speed=15.0).table()
    for _ in range(4):
        contacts = table.step(0.1)
        assert (np.diff(contacts["time"]) >= 0.0).all()
        assert ((contacts["time"] >= 0.0) & (contacts["time"] <= 0.1)).all()
        assert ((contacts["b"] == -1) | (contacts["b"] > contacts["a"])).all()


@laws
@given(seeds)
def test_impulses_add_up_to_the_change_of_momentum(seed):
    scene = random_scene(np.random.default_rng(seed), discs=(2, 6), speed=10.0, heavy=0.2)
    table = scene.table()
    contacts = table.step(0.1)
    for k, mass in enumerate(scene.masses):
        push = sum(
            (c["impulse"] * np.array([c["nx"], c["ny"]]) * (1.0 if c["a"] == k else -1.0))
            for c in contacts
            if k in (c["a"], c["b"])
        )
        if math.isfinite(mass):
            gained = mass * (table.velocities[k] - scene.velocities[k])
            np.testing.assert_allclose(gained, push + np.zeros(2), rtol=0, atol=1e-11 * (1.0 + len(contacts)))
        else:
            assert (table.velocities[k] == scene.velocities[k]).all()


@laws
@given(seeds)
def test_place_and_normal_are_those_of_the_kiss(seed):
    """The contacts alone give every path: replayed from them, discs touch where and when the contacts say."""
    scene = random_scene(np.random.default_rng(seed), discs=(2, 5), speed=6.0)
    table = scene.table()
    contacts = table.step(0.15)
    positions, velocities, now = scene.positions.copy(), scene.velocities.copy(), 0.0
    for c in contacts:
        positions += velocities * (c["time"] - now)
        now = c["time"]
        normal = np.array([c["nx"], c["ny"]])
        touch = np.array([c["x"], c["y"]])
        assert math.hypot(*normal) == pytest.approx(1.0, abs=1e-15)
        assert c["impulse"] > 0.0
        a, b = c["a"], c["b"]
        np.testing.assert_allclose(positions[a] - scene.radii[a] * normal, touch, rtol=0, atol=1e-9)
        velocities[a] += c["impulse"] / scene.masses[a] * normal
        if b >= 0:
            np.testing.assert_allclose(positions[b] + scene.radii[b] * normal, touch, rtol=0, atol=1e-9)
            velocities[b] -= c["impulse"] / scene.masses[b] * normal
        else:
            assert np.abs(touch) @ np.abs(normal) == pytest.approx(np.abs(normal) @ [1.0, 0.5], abs=1e-9)
    np.testing.assert_allclose(positions + velocities * (0.15 - now), table.positions, rtol=0, atol=1e-9)
