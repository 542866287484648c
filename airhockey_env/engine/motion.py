"""Motion between contacts: straight lines within a tick, and the deceleration of a gliding puck.

The deceleration a + c*v + b*v**2 is a Riccati equation, so the speed after a time h is exactly v(h) = (p*v - q) / (r*v
+ s) with four coefficients that only depend on h. No transcendental function is needed per step. A tick of the game is
half a tick of deceleration, a tick of straight motion at constant speed, and another half tick of deceleration. The
speeds of a freely gliding puck are exact. Its positions have a third-order error per tick: at most d' * tick**3 / 24 if
the deceleration changes by d' per second (less than 1 micrometre for 10 m/s on the full-size table at 50 Hz), and at
most d * tick**2 / 8 in the tick in which a puck that decelerates at d comes to rest.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import compiled, inlined


@compiled
def glide_coefficients(constant, linear, quadratic, time):
    """The coefficients p, q, r, s (see the module's docstring) for gliding `time` seconds.

    Args:
        constant, linear, quadratic: a in m/s**2, c in 1/s, b in 1/m; 0 or more.
        time: s.
    """
    discriminant = 0.25 * linear**2 - constant * quadratic
    if discriminant > 0.0:
        root = math.sqrt(discriminant)
        tangent = math.tanh(root * time) / root
    elif discriminant < 0.0:
        root = math.sqrt(-discriminant)
        if root * time >= 0.5 * math.pi:  # beyond the pole of the tangent, any speed has decayed to 0
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
def glide(vx, vy, p, q, r, s, greatest):
    """A disc's velocity after it decelerates with the given coefficients, at most `greatest` m/s."""
    speed = math.sqrt(vx * vx + vy * vy)
    if speed > 0.0:
        share = max(0.0, p * speed - q) / ((r * speed + s) * speed)
        if share * speed > greatest:
            share = greatest / speed
        return vx * share, vy * share
    return vx, vy
