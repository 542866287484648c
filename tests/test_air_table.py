"""The table's own duties: clear errors, complete contact lists, and a state that can be copied."""

from __future__ import annotations

import doctest
import math

import numpy as np
import pytest

from airhockey_env import air_table
from airhockey_env.air_table import AirTable
from airhockey_env.compiled import records
from airhockey_env.engine.discrete import advance_discrete
from airhockey_env.engine.records import CONTACT, SURFACE, Discs
from tests.helpers import COPIES, INF, NAN

GOOD = {"positions": [[-0.5, 0.0], [0.5, 0.0]], "velocities": [[1.0, 0.0], [0.0, 0.5]], "radii": 0.05}


def snapshot(table):
    return table.time, table.positions.tobytes(), table.velocities.tobytes()


BAD = {
    "positions": [
        [], 3.0, None, "puck", [0.0, 1.0], [[0.0, 0.0, 0.0]], [[0.0, 0.0], [1.0]], [[0.0, NAN], [0.5, 0.0]],
        [[0.0, INF], [0.5, 0.0]], [[-1e51, 0.0], [0.5, 0.0]], [["0.5", 0.0], [0.5, 0.0]], [[10**5000, 0.0], [0.5, 0.0]],
        [[0.0, 0.0], [0.0, 0.0]],  # one on the other
        [[0.0, 0.46], [0.5, 0.0]],  # in a wall
    ],
    "velocities": [[[0.0, 0.0]], "fast", [["a", 0.0], [0.0, 0.0]], [[0.0, NAN], [0, 0]], [[1e160, 0.0], [0.0, 0.0]]],
    "radii": [0.0, -0.05, INF, NAN, None, [0.05], [0.05, -0.1], [0.05, 1e-51], [0.05, 1e200], 5e-324],
    "masses": [0.0, -INF, NAN, [1.0, -2.0], [1.0, 1.0, 1.0], [1.0, 1e-320], 1e300],
    "restitution": [-0.1, 1.1, NAN, "0.5", None, True, [0.5, 0.5]],
    "wall_restitution": [2.0, 0.5j],
    "size": [(2.0, 0.0), (2.0, -1.0), (INF, 1.0), (2.0, NAN), (2.0, 1.0, 1.0), "big", (1e308, 1.0), (True, 1.0)],
    "method": ["exact", None],
}  # fmt: skip


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in BAD.items() for value in values])
def test_bad_arguments_are_named(name, value):
    with pytest.raises(ValueError, match=rf"^{name} "):
        AirTable(**GOOD | {name: value})


@pytest.mark.parametrize(
    ("name", "value", "shown"),
    [
        ("positions", [[0.0, 0.0, 0.0]], r"\(1, 3\)"),
        ("positions", [[0.0, 0.0], [0.0, 9.0]], r"disc 1 at \(0.0, 9.0\)"),
        ("positions", [[0.0, 0.0], [0.0, 0.0]], "discs 0 and 1"),
        ("radii", np.array([0.05, -0.05]), "got -0.05$"),
        ("restitution", np.float64(2.0), "got 2.0$"),
        ("method", "exact", "'continuous'.* got 'exact'"),
        ("size", (0.05, 1.0), "^positions "),
    ],
)
def test_errors_show_what_was_given(name, value, shown):
    with pytest.raises(ValueError, match=shown):
        AirTable(**GOOD | {name: value})


REFUSED = {
    "dt": [0, -0.1, NAN, INF, True, "0.1", None, [0.1], 0.1j, np.zeros(2)],
    "positions": [value for value in BAD["positions"] if value != []],
    "velocities": BAD["velocities"],
}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in REFUSED.items() for value in values])
def test_a_bad_step_or_assignment_changes_nothing(name, value):
    table = AirTable(**GOOD)
    before = snapshot(table)
    with pytest.raises(ValueError, match=rf"^{name} "):
        table.step(value) if name == "dt" else setattr(table, name, value)
    assert snapshot(table) == before


@pytest.mark.parametrize("name", ["positions", "velocities"])
@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_a_live_array_gone_bad_is_caught_by_the_next_step(name, value):
    table = AirTable(**GOOD)
    getattr(table, name)[1, 0] = value
    before = snapshot(table)
    with pytest.raises(ValueError, match=rf"^{name} "):
        table.step(0.1)
    assert snapshot(table) == before


@pytest.mark.parametrize("dt", [1, 5e-324])
def test_a_step_may_be_as_short_as_numbers_are(dt):
    table = AirTable(**GOOD)
    table.step(dt)
    assert table.time == dt
    assert table.positions[0, 0] == pytest.approx(-0.5 + dt * 1.0)


def test_even_a_boundless_step_ends():
    table = AirTable(**GOOD, size=None)
    assert len(table.step(1e300)) == 0
    assert table.positions[0, 0] == pytest.approx(1e300)


def test_arguments_are_copied_and_the_state_is_live():
    positions, velocities = np.array(GOOD["positions"]), np.array(GOOD["velocities"])
    table = AirTable(positions, velocities, 0.05)
    table.step(0.1)
    assert positions.tolist() == GOOD["positions"]
    table.velocities[0] = [0.0, 0.0]
    before = table.positions[0].copy()
    table.step(0.1)
    assert (table.positions[0] == before).all()
    table.velocities *= 2.0
    assert table.velocities[1].tolist() == [0.0, 1.0]
    table.radii[0] = 7.0
    table.masses[0] = 7.0
    assert (table.radii[0], table.masses[0]) == (0.05, 1.0)


def test_time_adds_up():
    table = AirTable(**GOOD)
    for dt in (0.25, 0.5, 1.0):
        table.step(dt)
    assert table.time == 1.75


def test_contacts_have_the_documented_columns():
    contacts = AirTable(**GOOD).step(1e-3)
    assert contacts.dtype.names == ("time", "a", "b", "x", "y", "nx", "ny", "impulse")
    assert type(contacts) is np.ndarray
    assert contacts.shape == (0,)


def test_an_earlier_list_of_contacts_is_not_overwritten():
    table = AirTable([[0.0, 0.0]], [[3.0, 1.0]], 0.05)
    first = table.step(1.0)
    copied = first.copy()
    table.step(1.0)
    assert len(first) > 0
    assert (first == copied).all()


@pytest.mark.parametrize("speed", [36.0, 360.0, 3600.0])
def test_a_step_returns_all_contacts_however_many(speed):
    """Between walls 0.9 m of way apart there are exactly speed / 0.9 contacts in a second, or one more."""
    table = AirTable([[0.1, 0.0]], [[0.0, speed]], 0.05)
    contacts = table.step(1.0)
    assert len(contacts) == math.floor(speed / 0.9 + 0.5)
    np.testing.assert_allclose(contacts["time"], (0.45 + 0.9 * np.arange(len(contacts))) / speed, rtol=1e-12)
    assert (contacts["ny"] == np.where(np.arange(len(contacts)) % 2, 1.0, -1.0)).all()


def test_a_crowded_step_is_the_same_as_many_small_ones():
    """22 pucks on a line in a box: hundreds of contacts, and no errors that grow."""
    n = 22
    positions = np.stack([np.linspace(-0.9, 0.9, n), np.zeros(n)], axis=1)
    velocities = np.stack([np.random.default_rng(0).uniform(-5.0, 5.0, n), np.zeros(n)], axis=1)
    whole, divided = (AirTable(positions, velocities, 0.02) for _ in range(2))
    contacts = whole.step(1.0)
    pieces = []
    for k in range(500):
        piece = divided.step(0.002)
        piece["time"] += k * 0.002
        pieces.append(piece)
    pieces = np.concatenate(pieces)
    assert len(contacts) > 500
    assert contacts[["a", "b"]].tolist() == pieces[["a", "b"]].tolist()
    np.testing.assert_allclose(pieces["time"], contacts["time"], rtol=0, atol=1e-10)
    np.testing.assert_allclose(divided.positions, whole.positions, rtol=0, atol=1e-10)
    np.testing.assert_allclose(divided.velocities, whole.velocities, rtol=0, atol=1e-10)


@pytest.mark.parametrize("method", ["kiss", "overlap"])
def test_a_tick_with_more_overlaps_than_expected_is_the_same_as_with_room_from_the_start(method):
    # Ever faster driven discs, one on top of the other, sweep over a row of pucks: each meets each.
    driven, pucks = 40, 14
    n = driven + pucks
    positions = np.zeros((n, 2))
    velocities = np.zeros((n, 2))
    velocities[:driven, 0] = 10.0 * 1.1 ** np.arange(driven)
    positions[:driven, 0] = -0.15 + 0.001 * np.arange(driven) - 0.05 * velocities[:driven, 0]
    positions[driven:, 1] = 0.045 * (np.arange(pucks) - 6.5)
    radii = np.repeat([0.4, 0.02], [driven, pucks])
    masses = np.repeat([INF, 1.0], [driven, pucks])
    table = AirTable(positions, velocities, radii, masses, restitution=0.0, size=None, method=method)
    contacts = table.step(0.05)

    surface, buffer = records(1, SURFACE), records(10_000, CONTACT)
    surface["half_length"] = surface["half_width"] = INF
    discs = Discs(positions, velocities, radii, 1.0 / masses, np.zeros(n, np.int32))
    count = advance_discrete(discs, surface[0], 0.05, method == "kiss", buffer)
    assert len(contacts) == count > 4 * n
    assert sorted(contacts.tolist()) == sorted(buffer[:count].tolist())
    assert (table.positions == discs.position).all()
    assert (table.velocities == discs.velocity).all()


@pytest.mark.parametrize("method", ["continuous", "kiss", "overlap"])
@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_a_copy_goes_on_to_the_bit_and_on_its_own(method, copied):
    rng = np.random.default_rng(3)
    positions = [[x, y] for x in (-0.8, -0.4, 0.0, 0.4, 0.8) for y in (-0.25, 0.25)]
    table = AirTable(positions, rng.uniform(-5.0, 5.0, (10, 2)), 0.06, [INF, *[1.0] * 9], 0.9, 0.8, method=method)
    for _ in range(10):
        table.step(0.02)
    other = copied(table)
    before = snapshot(other)
    played = [table.step(0.02).tobytes() for _ in range(20)]
    assert snapshot(other) == before
    assert [other.step(0.02).tobytes() for _ in range(20)] == played
    assert snapshot(other) == snapshot(table)
    assert (other.size, other.method) == (table.size, table.method)


def test_the_examples_of_the_docstring():
    outcome = doctest.testmod(air_table)
    assert outcome.attempted >= 6
    assert outcome.failed == 0


@pytest.mark.parametrize("method", ["continuous", "kiss", "overlap"])
def test_at_the_ends_of_the_ranges_all_stays_finite(method):
    table = AirTable([[-1e50, 0.0], [1e50, 1.0]], [[1e50, 0.0], [-1e50, 1e-320]], 1e49, [1e-50, 1e50], size=None,
                     method=method)  # fmt: skip
    for _ in range(3):
        contacts = table.step(0.4)
        assert all(np.isfinite(contacts[field]).all() for field in contacts.dtype.names)
    assert np.isfinite(table.velocities).all()
    assert math.isfinite(table.energy)


@pytest.mark.parametrize("method", ["continuous", "kiss", "overlap"])
def test_a_step_that_leads_beyond_all_numbers_is_named_and_changes_nothing(method):
    table = AirTable(**GOOD | {"velocities": [[1e40, 0.0], [0.0, 0.0]]}, size=None, method=method)
    before = snapshot(table)
    with pytest.raises(ValueError, match=r"^dt "):
        table.step(1e300)
    assert snapshot(table) == before


def test_a_step_with_more_contacts_than_memory_should_hold_is_named_and_changes_nothing(monkeypatch):
    monkeypatch.setattr(air_table, "MOST_CONTACTS", 1000)
    table = AirTable(**GOOD)
    table.step(0.1)
    before = snapshot(table)
    with pytest.raises(ValueError, match=r"^dt "):
        table.step(1e6)
    assert snapshot(table) == before
    assert len(table.step(100.0)) < 1000
