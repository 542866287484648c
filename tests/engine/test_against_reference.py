"""The engine against a reference with 60 digits, table by table."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.engine.reference import Reference, TooManyContacts
from tests.engine.scenes import random_scene

NUDGE = 1e-30
WELL_POSED = 1e5
"""Every hit on a disc multiplies an error by about distance / radius, more for a thin hit: after enough of them no
float64 engine can know where a disc is. The reference measures this growth with a twin that starts 1e-30 away. Up to
1e5, roundings of some 1e-15 cannot reach 1e-9; tables that grow errors faster say nothing about the engine."""


def compare(scene, ticks) -> tuple[int, int] | None:
    """Contacts in all ticks and in the busiest one; None if the table is ill-posed or never ends."""
    table, exact, twin = scene.table(), Reference(scene), Reference(scene, NUDGE)
    total, busiest = 0, 0
    for dt in ticks:
        try:
            expected = exact.step(dt)
            twin.step(dt)
        except TooManyContacts:
            return None
        if exact.growth(twin, NUDGE) > WELL_POSED:
            return None
        contacts = table.step(dt)
        state = np.concatenate([table.positions, table.velocities], axis=1).ravel()
        assert [(c["a"], c["b"]) for c in contacts] == [(a, b) for _, a, b, _ in expected]
        np.testing.assert_allclose(state, [float(number) for number in exact.state()], rtol=0, atol=1e-9)
        np.testing.assert_allclose(contacts["time"], [time for time, *_ in expected], rtol=0, atol=1e-9)
        np.testing.assert_allclose(contacts["impulse"], [impulse for *_, impulse in expected], rtol=0, atol=1e-8)
        total += len(contacts)
        busiest = max(busiest, len(contacts))
    return total, busiest


@pytest.mark.parametrize("walls", [True, False])
@pytest.mark.parametrize("elastic", [True, False])
@pytest.mark.parametrize("heavy", [0.0, 0.3])
def test_random_tables_agree_to_a_billionth(walls, elastic, heavy):
    rng = np.random.default_rng([walls, elastic, round(10 * heavy)])
    tables = 60
    outcomes = []
    for _ in range(tables):
        scene = random_scene(rng, discs=(2, 6), walls=walls, elastic=elastic, heavy=heavy)
        outcomes.append(compare(scene, ticks=rng.uniform(0.05, 0.25, 2)))
    judged = [outcome for outcome in outcomes if outcome is not None]
    assert len(judged) >= 0.8 * tables  # the comparison is about tables, not about exceptions
    assert sum(total for total, _ in judged) > (3 if walls else 0.4) * tables
    assert max(busiest for _, busiest in judged) >= (8 if walls else 3)


def test_reference_knows_a_closed_form():
    """Head on, masses 1 and 3: v1' = (m1 - m2) / (m1 + m2) v and v2' = 2 m1 / (m1 + m2) v, after 0.3 m at 2 m/s."""
    rng = np.random.default_rng(0)
    scene = random_scene(rng, discs=(2, 2), walls=False, elastic=True)
    scene.positions[:] = [[-0.4, 0.0], [0.0, 0.0]]
    scene.velocities[:] = [[2.0, 0.0], [0.0, 0.0]]
    scene.radii[:] = 0.05
    scene.masses[:] = [1.0, 3.0]
    exact = Reference(scene)
    (contact,) = exact.step(1.0)
    assert contact[0] == pytest.approx(0.15, abs=1e-15)
    assert [float(number) for number in exact.state()] == pytest.approx(
        [-0.1 - 0.85, 0.0, -1.0, 0.0, 0.85, 0.0, 1.0, 0.0], abs=1e-14
    )
    assert math.isclose(contact[3], 3.0)
