"""The shot that the method was made for: a fast puck, a still one, and a tick boundary that falls anywhere."""

from __future__ import annotations

import math

import numpy as np
import pytest

from airhockey_env.air_table import AirTable

SPEED, RADIUS, DISTANCE = 25.0, 0.05, 1.0
TICK = 0.0625 / SPEED  # 62.5 mm a tick: shorter than any chord below, so that no phase jumps over the overlap


def outgoing_angles(method, offset, phase, tick):
    """Degrees, of the fast puck and of the one that was still; `phase`, 0 to 1, shifts the tick boundaries."""
    start = -DISTANCE + phase * min(SPEED * tick, 0.5 * DISTANCE)
    table = AirTable([[start, offset], [0.0, 0.0]], [[SPEED, 0.0], [0.0, 0.0]], RADIUS, size=None, method=method)
    for _ in range(math.ceil(1.5 * DISTANCE / (SPEED * tick))):
        table.step(tick)
    return np.degrees(np.arctan2(table.velocities[:, 1], table.velocities[:, 0]))


def ideal_angles(offset):
    """The still puck leaves along the line of centres at the kiss, the fast one at a right angle to it."""
    along = -math.degrees(math.asin(offset / (2.0 * RADIUS)))
    return np.array([along + 90.0, along])


PHASES = np.linspace(0.0, 1.0, 25, endpoint=False) + 1e-3
OFFSETS = [0.02, 0.05, 0.07]


@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize(("method", "tick"), [("kiss", TICK), *(("continuous", t) for t in (1e-4, TICK, 0.03, 0.5))])
def test_the_kiss_gives_the_ideal_angles_wherever_the_tick_boundary_falls(method, tick, offset):
    ideal = ideal_angles(offset)
    for phase in PHASES:
        np.testing.assert_allclose(outgoing_angles(method, offset, phase, tick), ideal, atol=1e-9)


@pytest.mark.parametrize("method", ["kiss", "continuous"])
@pytest.mark.parametrize("quarter", range(4))
def test_a_shot_along_an_axis_never_divides_by_the_component_that_is_zero(method, quarter):
    offset = 0.06
    still = np.array([0.8, -0.6])  # the line of centres at the kiss of a shot along +x
    turn = np.round(np.array([[math.cos(t := quarter * math.pi / 2), -math.sin(t)], [math.sin(t), math.cos(t)]]))
    positions = [turn @ [-DISTANCE, offset], [0.0, 0.0]]
    table = AirTable(positions, [turn @ [SPEED, 0.0], [0.0, 0.0]], RADIUS, size=None, method=method)
    for _ in range(30):
        table.step(TICK)
    np.testing.assert_allclose(table.velocities[1], turn @ (0.8 * SPEED * still), rtol=0, atol=1e-11)


@pytest.mark.parametrize("offset", OFFSETS)
def test_the_overlap_does_not(offset):
    angles = np.array([outgoing_angles("overlap", offset, phase, TICK)[1] for phase in PHASES])
    assert np.ptp(angles) > 5.0
    assert np.abs(angles - ideal_angles(offset)[1]).max() > 5.0


def test_only_continuous_sees_a_puck_that_passes_through():
    deflected = {
        method: any(abs(outgoing_angles(method, 0.05, phase, 0.05)[1]) > 1.0 for phase in (0.1, 0.2, 0.3))
        for method in ("continuous", "kiss", "overlap")
    }
    assert deflected == {"continuous": True, "kiss": False, "overlap": False}


def test_three_hits_in_one_tick_are_played_one_after_the_other():
    table = AirTable(
        [[-0.5, 0.0], [0.0, 2e-3], [0.3, -1e-3], [0.6, 1e-3]], [[25.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
        RADIUS, size=None,
    )  # fmt: skip
    contacts = table.step(0.05)
    assert contacts[["a", "b"]].tolist()[:3] == [(0, 1), (1, 2), (2, 3)]
    assert contacts["time"][0] == pytest.approx((0.5 - math.sqrt(0.01 - 4e-6)) / 25.0, abs=1e-15)
