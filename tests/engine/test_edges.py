"""What must hold at the edges, row by row of the method's table."""

from __future__ import annotations

import math

import numpy as np
import pytest

from airhockey_env.air_table import AirTable
from airhockey_env.engine.kiss import kiss_time
from tests.engine.scenes import deepest_overlap

INF = math.inf


def test_no_relative_velocity_is_no_kiss():
    table = AirTable([[-0.1, 0.0], [0.1, 0.0]], [[0.7, 0.3], [0.7, 0.3]], 0.1, size=None)
    assert len(table.step(1.0)) == 0
    assert (table.velocities == [[0.7, 0.3], [0.7, 0.3]]).all()
    assert kiss_time(0.2, 0.0, 0.0, 0.0, 0.2) == INF


def test_moving_apart_is_no_kiss():
    table = AirTable([[-0.1, 0.0], [0.1, 0.0]], [[-1.0, 0.5], [1.0, 0.0]], 0.1, size=None)
    assert len(table.step(1.0)) == 0
    assert (table.velocities == [[-1.0, 0.5], [1.0, 0.0]]).all()


def test_paths_that_miss_are_no_kiss():
    table = AirTable([[-0.5, 0.21], [0.0, 0.0]], [[3.0, 0.0], [0.0, 0.0]], 0.1, size=None)
    assert len(table.step(1.0)) == 0
    assert kiss_time(-0.5, 0.21, 3.0, 0.0, 0.2) == INF


def test_grazing_changes_nothing():
    table = AirTable([[-0.5, 0.25], [0.0, 0.0]], [[3.0, 0.0], [0.0, 0.0]], 0.125, size=None)
    table.step(1.0)
    assert (table.velocities == [[3.0, 0.0], [0.0, 0.0]]).all()
    assert table.positions[0, 0] == pytest.approx(2.5, abs=1e-15)
    assert (table.positions[1] == 0.0).all()


@pytest.mark.parametrize("offset", [0.25 * (1.0 - 10.0**-k) for k in range(1, 17)])
def test_nearly_grazing_is_never_nan_and_deflects_as_little_as_it_should(offset):
    table = AirTable([[-0.5, offset], [0.0, 0.0]], [[3.0, 0.0], [0.0, 0.0]], 0.125, size=None)
    table.step(1.0)
    normal_speed = 3.0 * math.sqrt(1.0 - (offset / 0.25) ** 2)
    assert math.hypot(*table.velocities[1]) == pytest.approx(normal_speed, abs=1e-7)


@pytest.mark.parametrize("overlap", [0.0, 1e-16, 1e-12, 0.9e-9])
def test_touching_or_overlapping_by_rounding_and_approaching_is_a_kiss_at_time_0(overlap):
    table = AirTable([[-0.2 + overlap, 0.0], [0.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]], 0.1, size=None)
    contacts = table.step(0.5)
    assert contacts["time"].tolist() == pytest.approx([0.0], abs=1e-15)
    assert table.velocities[1].tolist() == [1.0, 0.0]


def test_touching_a_wall_and_approaching_it_is_a_kiss_at_time_0():
    table = AirTable([[0.9, 0.0]], [[2.0, 1.0]], 0.1)
    assert table.step(0.1)["time"].tolist() == [0.0]
    assert table.velocities[0].tolist() == [-2.0, 1.0]


def test_overlap_at_construction_is_an_error():
    with pytest.raises(ValueError, match=r"positions must not overlap: discs 0 and 1 overlap by 0\.05 m"):
        AirTable([[0.0, 0.0], [0.15, 0.0]], [[0.0, 0.0], [0.0, 0.0]], 0.1)
    with pytest.raises(ValueError, match=r"positions must lie on the table: disc 0 .* reaches over a wall by 0\.01 m"):
        AirTable([[0.91, 0.0]], [[0.0, 0.0]], 0.1)


def test_infinite_mass_keeps_its_velocity():
    table = AirTable([[-0.5, 0.0], [0.0, 0.0]], [[2.0, 0.0], [-1.0, 0.0]], 0.1, [INF, 1.0], 0.5, size=None)
    (contact,) = table.step(0.2)
    assert table.velocities[0].tolist() == [2.0, 0.0]
    assert table.velocities[1] == pytest.approx([2.0 + 0.5 * 3.0, 0.0])
    assert contact["impulse"] == pytest.approx(1.5 * 3.0)


def test_infinite_mass_is_the_limit_of_a_great_one():
    outcomes = []
    for mass in (1e14, INF):
        table = AirTable([[-0.5, 0.03], [0.0, 0.0]], [[2.0, 0.0], [-1.0, 0.4]], 0.1, [mass, 1.0], size=None)
        table.step(0.5)
        outcomes.append(np.concatenate([table.positions, table.velocities]))
    np.testing.assert_allclose(*outcomes, rtol=0, atol=1e-12)


def test_both_masses_infinite_pass_through_each_other():
    table = AirTable([[-0.3, 0.0], [0.3, 0.0]], [[1.0, 0.0], [-1.0, 0.0]], 0.1, INF)
    assert len(table.step(0.6)) == 0
    assert table.positions[:, 0] == pytest.approx([0.3, -0.3])
    assert len(AirTable([[0.0, 0.0], [0.01, 0.0]], np.zeros((2, 2)), 0.1, INF).step(1.0)) == 0  # may even overlap


def test_simultaneous_kisses_repeat_to_the_bit():
    def play():
        rack = [[0.1 * i * math.sqrt(3.0), 0.1 * j] for i in range(3) for j in range(-i, i + 1, 2)]
        positions = [[-0.5, 0.0], *rack]
        velocities = [[5.0, 0.0]] + [[0.0, 0.0]] * len(rack)
        table = AirTable(positions, velocities, 0.1 - 1e-12, size=(3.0, 2.0))
        contacts = table.step(1.0)
        return contacts.tobytes() + table.positions.tobytes() + table.velocities.tobytes()

    assert play() == play()


def test_a_disc_that_two_others_reach_at_once_meets_the_faster_one_first_whatever_their_numbers():
    places = {"slow": [-0.2, 0.0], "fast": [0.2, 0.0], "puck": [0.0, 0.0]}
    speeds = {"slow": [1.0, 0.0], "fast": [-3.0, 0.0], "puck": [0.0, 0.0]}
    for names in (
        ["slow", "fast", "puck"], ["fast", "slow", "puck"], ["slow", "puck", "fast"],
        ["fast", "puck", "slow"], ["puck", "slow", "fast"], ["puck", "fast", "slow"],
    ):  # fmt: skip
        table = AirTable([places[name] for name in names], [speeds[name] for name in names], 0.1)
        contacts = table.step(1e-6)
        assert {names[contacts[0]["a"]], names[contacts[0]["b"]]} == {"puck", "fast"}, names


def test_corner_hits_both_walls_at_once():
    table = AirTable([[0.5, 0.0]], [[1.0, 1.0]], 0.1, wall_restitution=0.5)
    contacts = table.step(1.0)
    assert contacts["time"] == pytest.approx([0.4, 0.4])
    assert [(c["nx"], c["ny"]) for c in contacts] == [(-1.0, 0.0), (0.0, -1.0)]
    assert table.velocities[0] == pytest.approx([-0.5, -0.5])
    assert table.positions[0] == pytest.approx([0.6, 0.1])


def test_a_post_is_a_disc_of_radius_0():
    table = AirTable([[-0.5, 0.06], [0.0, 0.0]], [[2.0, 0.0], [0.0, 0.0]], [0.1, 0.0], [1.0, INF], size=None)
    (contact,) = table.step(1.0)
    assert (contact["nx"], contact["ny"]) == pytest.approx((-0.8, 0.6))
    assert (contact["x"], contact["y"]) == pytest.approx((0.0, 0.0), abs=1e-15)
    assert table.velocities[0] == pytest.approx([2.0 - 2 * 1.6 * 0.8, 2 * 1.6 * 0.6])


@pytest.mark.parametrize("restitution", [0.0, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("place", [(0.0, 0.3), (0.7, 0.2)], ids=["wall", "corner"])
def test_a_puck_pinned_by_a_driven_disc_stays_on_the_table_and_free_of_overlap(restitution, place):
    target = np.array([0.0, 0.4]) if place[0] == 0.0 else np.array([0.9, 0.4])
    direction = (target - place) / math.dist(target, place)
    table = AirTable(
        [np.array(place) - 0.25 * direction, place], [3.0 * direction, [0.0, 0.0]], [0.1, 0.1], [INF, 0.05],
        restitution, restitution,
    )  # fmt: skip
    for _ in range(100):
        contacts = table.step(0.02)
        assert len(contacts) < 60_000
        assert deepest_overlap(table) < 1e-11
        assert np.isfinite(table.velocities).all()
        assert (table.velocities[0] == 3.0 * direction).all()  # it gave way for the step, and drives on in the next


@pytest.mark.parametrize("restitution", [0.0, 0.8, 1.0])
def test_a_puck_squeezed_between_two_driven_discs_is_held(restitution):
    table = AirTable(
        [[-0.3, 0.0], [0.3, 0.0], [0.01, 0.0]], [[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0]], 0.1, [INF, INF, 0.05],
        restitution,
    )  # fmt: skip
    for _ in range(20):
        table.step(0.05)
        assert deepest_overlap(table) < 1e-11
    assert abs(table.positions[2, 0]) < 0.2
    assert table.positions[1, 0] - table.positions[0, 0] >= 0.4 - 1e-11


def test_a_driven_disc_moves_on_when_what_it_squeezed_is_gone():
    table = AirTable([[0.6, 0.0], [0.9, 0.0]], [[1.0, 0.0], [0.0, 0.0]], 0.1, [INF, 1.0], 0.8, 0.8)
    for _ in range(10):
        table.step(0.1)
    assert table.positions[0, 0] == pytest.approx(0.7, abs=1e-9)
    table.positions = [table.positions[0], [0.0, 0.0]]
    table.step(0.1)
    assert table.positions[0, 0] == pytest.approx(0.8, abs=1e-9)


@pytest.mark.parametrize("restitution", [0.0, 0.05, 0.1, 0.3])
def test_inelastic_collapse_of_several_pucks_ends(restitution):
    n = 6
    positions = np.stack([np.linspace(-0.9, 0.9, n), np.zeros(n)], axis=1)
    table = AirTable(positions, -3.0 * positions, 0.05, restitution=restitution, size=None)
    for _ in range(20):
        assert len(table.step(0.1)) < 100_000
        assert deepest_overlap(table) < 1e-11
    assert table.energy < 1e-3
    np.testing.assert_allclose((table.masses[:, None] * table.velocities).sum(axis=0), 0.0, atol=1e-12)


def test_restitution_0_leaves_no_normal_velocity():
    table = AirTable([[-0.5, 0.06], [0.0, 0.0]], [[2.0, 0.0], [0.0, 0.0]], 0.05, [1.0, 3.0], 0.0, size=None)
    (contact,) = table.step(0.5)
    normal = np.array([contact["nx"], contact["ny"]])
    assert (table.velocities[0] - table.velocities[1]) @ normal == pytest.approx(0.0, abs=1e-15)
    tangent = np.array([-normal[1], normal[0]])
    assert table.velocities[0] @ tangent == pytest.approx(np.array([2.0, 0.0]) @ tangent)


def test_wall_restitution_0_lets_a_puck_slide_along_the_wall():
    table = AirTable([[0.0, 0.3]], [[0.5, 1.0]], 0.1, wall_restitution=0.0)
    table.step(1.0)
    assert table.velocities[0].tolist() == pytest.approx([0.5, 0.0])
    assert table.positions[0].tolist() == pytest.approx([0.5, 0.4])
    assert len(table.step(0.5)) == 0
