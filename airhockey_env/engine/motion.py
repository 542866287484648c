"""Free flight: straight lines inside a tick, and the glide of a puck that slows down.

The deceleration a + c*v + b*v**2 is a Riccati equation, so the speed after a time h is exactly
v(h) = (p*v - q) / (r*v + s), with four numbers that depend on h alone: no transcendental function per step. The game
flies one tick at the speed in the middle of it: half a tick of glide, a tick of straight flight, half a tick of
glide. Speeds of a free flight are exact; positions have an error of the third order in the tick: when the
deceleration changes by d' per second, at most d' * tick**3 / 24 each tick (for 10 m/s on the full-size table at
50 Hz: less than 1 micrometre). In the one tick in which a puck decelerating at d comes to rest it is at most
d * tick**2 / 8.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import compiled, inlined


@compiled
def glide_coefficients(constant, linear, quadratic, time):
    """The numbers p, q, r, s of the module's docstring for a glide of `time` seconds.

    Args:
        constant, linear, quadratic: a in m/s**2, c in 1/s, b in 1/m; none negative.
        time: s.
    """
    discriminant = 0.25 * linear**2 - constant * quadratic
    if discriminant > 0.0:
        root = math.sqrt(discriminant)
        tangent = math.tanh(root * time) / root
    elif discriminant < 0.0:
        root = math.sqrt(-discriminant)
        if root * time >= 0.5 * math.pi:  # past a quarter turn, the tangent's pole, any speed has come to 0
            return 0.0, 0.0, 0.0, 1.0
        tangent = math.tan(root * time) / root
    else:
        tangent = time
    half_linear = 0.5 * linear * tangent
    return 1.0 - half_linear, constant * tangent, quadratic * tangent, 1.0 + half_linear


@inlined
def fly(discs, time):
    """Move every disc along its straight line for `time` seconds."""
    for a in range(discs.position.shape[0]):
        discs.position[a, 0] += discs.velocity[a, 0] * time
        discs.position[a, 1] += discs.velocity[a, 1] * time


@inlined
def glide(discs, a, p, q, r, s, greatest):
    """Slow disc a down by a glide with the given coefficients, and to `greatest` m/s if it is faster still."""
    vx, vy = discs.velocity[a, 0], discs.velocity[a, 1]
    speed = math.sqrt(vx * vx + vy * vy)
    if speed > 0.0:
        share = max(0.0, p * speed - q) / ((r * speed + s) * speed)
        if share * speed > greatest:
            share = greatest / speed
        discs.velocity[a, 0] = vx * share
        discs.velocity[a, 1] = vy * share
