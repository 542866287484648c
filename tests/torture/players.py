"""What hostile players do: actions that no fair player would take, and situations that play would rarely lead to."""

from __future__ import annotations

import math

from airhockey_env.kernel.observations import view
from airhockey_env.kernel.random_stream import draw, draw_between
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from tests.torture.compiled_here import compiled_here

CHASE, AHEAD, PIN, JITTER, SHAKE, WANDER, MODES = range(7)


@compiled_here
def _push(seen, reach, dx, dy):
    """Push the puck along the unit vector (dx, dy): from behind it, at full speed."""
    to_x, to_y = seen.puck_x - seen.x, seen.puck_y - seen.y
    along = to_x * dx + to_y * dy
    if along > 0.8 * math.sqrt(to_x * to_x + to_y * to_y):
        return to_x + 0.5 * reach * dx, to_y + 0.5 * reach * dy
    return to_x - 1.4 * reach * dx, to_y - 1.4 * reach * dy


@compiled_here
def hostile_action(table, physics, player, mode, whim):
    """A hostile action of length 1 or more in the player's own view; `whim`, 0 to 1, chooses within the mode."""
    if mode == JITTER:
        return (1.0 if draw(table) < 0.5 else -1.0), (1.0 if draw(table) < 0.5 else -1.0)
    if mode == WANDER:
        return draw_between(table, -1.5, 1.5), draw_between(table, -1.5, 1.5)
    seen = view(table, player)
    reach = physics.radius[player] + physics.radius[PUCK]
    x, y = seen.puck_x - seen.x, seen.puck_y - seen.y
    if mode == AHEAD:
        lead = whim * 0.3
        x, y = x + lead * seen.puck_vx, y + lead * seen.puck_vy
    elif mode == SHAKE:
        sign = 1.0 if table.steps % 2 == 0 else -1.0
        x, y = sign * x, sign * y
        if whim < 0.5:
            x, y = -y, x
    elif mode == PIN:
        side = 1.0 if seen.puck_y > 0.0 else -1.0
        if whim < 0.2:  # on the side wall
            x, y = _push(seen, reach, 0.0, side)
        elif whim < 0.4:  # on the own end wall
            x, y = _push(seen, reach, -1.0, 0.0)
        elif whim < 0.6:  # into the own corner
            x, y = _push(seen, reach, -math.sqrt(0.5), side * math.sqrt(0.5))
        elif whim < 0.8:  # on a post
            px = -physics.half_length - seen.puck_x
            py = side * physics.half_goal - seen.puck_y
            away = max(math.sqrt(px * px + py * py), 1e-9)
            x, y = _push(seen, reach, px / away, py / away)
        else:  # at the other player
            x, y = _push(seen, reach, 1.0, 0.0)
    length = max(math.sqrt(x * x + y * y), 1e-9)
    return 1.5 * x / length, 1.5 * y / length


@compiled_here
def ambush(table, physics):
    """Put the puck on an edge and a paddle against it, both at great speed, if there is room."""
    p, v = table.position, table.velocity
    r = physics.radius[PUCK]
    x_most, y_most = physics.half_length - r, physics.half_width - r
    x, y = draw_between(table, -x_most, x_most), draw_between(table, -y_most, y_most)
    where = draw(table)
    if where < 0.3:
        y = y_most if draw(table) < 0.5 else -y_most
    if 0.2 < where < 0.6:
        x = x_most if draw(table) < 0.5 else -x_most
    if where > 0.8:  # around a post
        end, side = (1.0 if draw(table) < 0.5 else -1.0), (1.0 if draw(table) < 0.5 else -1.0)
        angle = draw_between(table, 0.0, 0.5 * math.pi)
        x = end * (physics.half_length - r * math.cos(angle))
        y = side * (physics.half_goal - r * math.sin(angle))
    player = LEFT if x < 0.0 else RIGHT
    angle = draw_between(table, -math.pi, math.pi)
    reach = physics.radius[player] + r
    px, py = x + reach * math.cos(angle), y + reach * math.sin(angle)
    near, far = physics.radius[player], physics.half_length - physics.radius[player]
    if not near <= abs(px) <= far or px * x < 0.0 or abs(py) > physics.half_width - physics.radius[player]:
        return
    other = RIGHT if player == LEFT else LEFT
    if math.sqrt((x - p[other, 0]) ** 2 + (y - p[other, 1]) ** 2) < reach:
        return
    p[PUCK, 0], p[PUCK, 1], p[player, 0], p[player, 1] = x, y, px, py
    speed = physics.puck_speed * draw(table)
    angle = draw_between(table, -math.pi, math.pi)
    v[PUCK, 0], v[PUCK, 1] = speed * math.cos(angle), speed * math.sin(angle)
    speed = physics.paddle_speed * draw(table)
    angle = draw_between(table, -math.pi, math.pi)
    v[player, 0], v[player, 1] = speed * math.cos(angle), speed * math.sin(angle)
