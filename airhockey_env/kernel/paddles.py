"""Paddles: from an action to a velocity that a hand could give them."""

from __future__ import annotations

import math

from airhockey_env.compiled import inlined
from airhockey_env.kernel.state import LEFT


@inlined
def _within(place, velocity, low, high, tick):
    """`velocity` along one axis, changed so that the tick ends between low and high."""
    after = place + velocity * tick
    if low <= after <= high:
        return velocity
    return ((high if after > high else low) - place) / tick


@inlined
def drive(x, y, vx, vy, ax, ay, radius, player, params):
    """The velocity of a player's paddle for the coming tick, (x, y) m/s.

    Args:
        x, y, vx, vy: where the paddle is and how it moves now, m and m/s.
        ax, ay: target velocity as a share of the greatest speed, as the player sees it (the right-hand player sees
            the table turned by 180 degrees). Clipped to [-1, 1] each, then to a length of 1.
        radius: m, the paddle's.
        player: LEFT or RIGHT.

    The velocity moves towards the target by at most the greatest acceleration, and is then cut so that the paddle
    ends the tick on its own half and off the walls.
    """
    forward = 1.0 if player == LEFT else -1.0
    ax = min(max(ax, -1.0), 1.0)
    ay = min(max(ay, -1.0), 1.0)
    length2 = ax * ax + ay * ay
    scale = forward * params.paddle_speed
    if length2 > 1.0:
        scale /= math.sqrt(length2)
    dvx, dvy = ax * scale - vx, ay * scale - vy
    change2 = dvx * dvx + dvy * dvy
    if change2 > params.paddle_step * params.paddle_step:
        share = params.paddle_step / math.sqrt(change2)
        dvx *= share
        dvy *= share
    near, far = radius, params.half_length - radius
    low, high = (-far, -near) if player == LEFT else (near, far)
    side = params.half_width - radius
    return _within(x, vx + dvx, low, high, params.tick), _within(y, vy + dvy, -side, side, params.tick)
