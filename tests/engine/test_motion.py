"""The glide of a puck that slows down, against a 30-digit integration of v' = -(a + c v + b v^2)."""

from __future__ import annotations

import functools
import math

import mpmath
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from airhockey_env.engine.motion import fly, glide, glide_coefficients
from airhockey_env.engine.records import Discs
from tests.engine.scenes import laws

REGIMES = {
    "nothing": (0.0, 0.0, 0.0),
    "constant": (0.3, 0.0, 0.0),
    "linear": (0.0, 0.5, 0.0),
    "quadratic": (0.0, 0.0, 0.2),
    "full-size table": (0.0145, 0.0, 0.0348),
    "constant and linear": (0.3, 0.5, 0.0),
    "linear and quadratic": (0.0, 0.5, 0.2),
    "all, mostly linear": (0.01, 0.8, 0.05),
    "all, a double root": (0.25, 1.0, 1.0),
    "all, little linear": (0.4, 0.1, 0.5),
}
drags = st.tuples(*[st.one_of(st.just(0.0), st.floats(1e-6, 5.0))] * 3)
regimes = pytest.mark.parametrize("drag", REGIMES.values(), ids=REGIMES)


def after(drag, time, speed):
    """Speed after a glide of `time` seconds, as the engine computes it."""
    return glide(speed, 0.0, *glide_coefficients(*drag, time), math.inf)[0]


@functools.cache
def deceleration_path(drag, speed, time):
    """(speed, way) after `time`, with 30 digits; the puck stays at rest once it rests."""
    with mpmath.workdps(30):
        a, c, b = (mpmath.mpf(k) for k in drag)
        velocity, way, left = mpmath.mpf(speed), mpmath.mpf(0), mpmath.mpf(time)
        if a > 0:
            rest = mpmath.quad(lambda v: 1 / (a + c * v + b * v * v), [0, velocity])
            if rest <= left:
                return 0.0, float(mpmath.quad(lambda v: v / (a + c * v + b * v * v), [0, velocity]))
        while left > 0:
            # By the Taylor series of v' = -(a + c v + b v^2), in steps far below its radius of convergence.
            rate = max(c, b * velocity, mpmath.sqrt(a * b), mpmath.mpf("0.1"))
            step = min(left, mpmath.mpf("0.1") / rate)
            series = [velocity]
            for k in range(25):
                square = sum(series[i] * series[k - i] for i in range(k + 1))
                series.append(-((a if k == 0 else 0) + c * series[k] + b * square) / (k + 1))
            velocity = sum(s * step**k for k, s in enumerate(series))
            way += sum(s * step ** (k + 1) / (k + 1) for k, s in enumerate(series))
            left -= step
        return float(velocity), float(way)


@regimes
@pytest.mark.parametrize("speed", [0.05, 1.0, 10.0])
@pytest.mark.parametrize("time", [0.01, 0.3, 2.0])
def test_glide_solves_its_equation(drag, speed, time):
    exact, _ = deceleration_path(drag, speed, time)
    assert after(drag, time, speed) == pytest.approx(exact, rel=1e-12, abs=1e-13)


CLOSED_FORMS = {
    "constant": lambda a, c, b, v, t: max(0.0, v - a * t),
    "linear": lambda a, c, b, v, t: v * math.exp(-c * t),
    "quadratic": lambda a, c, b, v, t: v / (1.0 + b * v * t),
}


@pytest.mark.parametrize("regime", CLOSED_FORMS)
@laws
@given(speed=st.floats(1e-9, 100.0), time=st.floats(1e-4, 30.0))
def test_pure_drags_have_their_closed_forms(regime, speed, time):
    drag = REGIMES[regime]
    assert after(drag, time, speed) == pytest.approx(
        CLOSED_FORMS[regime](*drag, speed, time), rel=1e-12, abs=1e-14 * speed
    )


@laws
@given(drags, st.floats(0.0, 50.0), st.floats(1e-4, 20.0), st.floats(0.01, 0.99))
def test_two_glides_are_one(drag, speed, time, share):
    once = after(drag, time, speed)
    twice = after(drag, (1.0 - share) * time, after(drag, share * time, speed))
    assert twice == pytest.approx(once, rel=1e-9, abs=1e-10 * speed)


@laws
@given(drags, st.floats(0.0, 1e3), st.floats(0.0, 1e3))
@example((0.0145, 0.0, 0.0348), 1e3, 69.0)
@example((0.0145, 0.0, 0.0348), 1e3, 71.0)
def test_a_glide_never_turns_a_puck_round_or_speeds_it_up(drag, speed, time):
    assert 0.0 <= after(drag, time, speed) <= speed * (1.0 + 1e-15)


@regimes
def test_rest_is_reached_where_there_is_a_constant_drag_and_only_there(drag):
    assert (after(drag, 50.0, 1.0) == 0.0) == (drag[0] > 0.0)


@laws
@given(st.floats(0.1, 100.0), st.floats(0.001, 2.0), st.floats(0.001, 2.0))
def test_rest_comes_when_it_should(speed, constant, quadratic):
    """v' = -(a + b v^2) rests after atan(v sqrt(b / a)) / sqrt(a b); also past the quarter turn of any speed."""
    rest = math.atan(speed * math.sqrt(quadratic / constant)) / math.sqrt(constant * quadratic)
    drag = (constant, 0.0, quadratic)
    assert after(drag, 0.999 * rest, speed) > 0.0
    for share in (1.001, 1.1, 2.0, 10.0):
        assert after(drag, share * rest, speed) == 0.0


def test_no_drag_keeps_every_bit():
    for speed in np.random.default_rng(0).uniform(0.0, 30.0, 100):
        assert after((0.0, 0.0, 0.0), 0.02, speed) == speed


def test_glide_keeps_the_direction_and_the_greatest_speed():
    assert glide(-30.0, 40.0, *glide_coefficients(0.0145, 0.0, 0.0348, 0.01), 10.0) == pytest.approx((-6.0, 8.0))


@regimes
@pytest.mark.parametrize("speed", [0.3, 3.0, 10.0])
@pytest.mark.parametrize("tick", [0.02, 0.1])
def test_the_way_of_a_tick_has_at_most_the_error_that_is_promised(drag, speed, tick):
    """Half a tick of glide, a tick of flight at that speed: within d' tick^3 / 24 of the true way."""
    half = glide_coefficients(*drag, 0.5 * tick)
    discs = Discs(np.zeros((1, 2)), np.array([[speed, 0.0]]), np.ones(1), np.ones(1), np.zeros(1, np.int32))
    discs.velocity[0] = glide(*discs.velocity[0], *half, math.inf)
    fly(discs, tick)
    discs.velocity[0] = glide(*discs.velocity[0], *half, math.inf)
    exact_speed, exact_way = deceleration_path(drag, speed, tick)
    constant, linear, quadratic = drag
    deceleration = constant + linear * speed + quadratic * speed**2
    change = (linear + 2.0 * quadratic * speed) * deceleration
    assert exact_speed > 0.0
    assert abs(discs.position[0, 0] - exact_way) <= change * tick**3 / 24.0 + 1e-15
    assert discs.velocity[0, 0] == pytest.approx(exact_speed, rel=1e-13)


@pytest.mark.parametrize("speed", [0.001, 0.003, 0.005, 0.0055])
def test_the_way_of_the_last_tick_has_at_most_the_error_that_is_promised(speed):
    drag, tick = (0.3, 0.1, 0.05), 0.02
    discs = Discs(np.zeros((1, 2)), np.array([[speed, 0.0]]), np.ones(1), np.ones(1), np.zeros(1, np.int32))
    discs.velocity[0] = glide(*discs.velocity[0], *glide_coefficients(*drag, 0.5 * tick), math.inf)
    fly(discs, tick)
    exact_speed, exact_way = deceleration_path(drag, speed, tick)
    deceleration = drag[0] + drag[1] * speed + drag[2] * speed**2
    assert exact_speed == 0.0
    assert abs(discs.position[0, 0] - exact_way) <= deceleration * tick**2 / 8.0


def test_the_example_of_the_docstring():
    """10 m/s on the full-size table at 50 Hz: less than 1 micrometre a tick."""
    deceleration = 0.0145 + 0.0348 * 10.0**2
    assert 2.0 * 0.0348 * 10.0 * deceleration * 0.02**3 / 24.0 < 1e-6
