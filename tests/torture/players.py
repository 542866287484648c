"""What hostile players do: actions that no fair player would take, and situations that play would rarely lead to."""

from __future__ import annotations

import math

from airhockey_env.kernel.observations import view_of
from airhockey_env.kernel.random_stream import draw, draw_between
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from tests.torture.compiled_here import compiled_here

CHASE, AHEAD, PIN, JITTER, SHAKE, WANDER, MODES = range(7)


@compiled_here
def _push(view, reach, dx, dy):
    """Push the puck along the unit vector (dx, dy): from behind it, at full speed."""
    to_x, to_y = view.puck_x - view.x, view.puck_y - view.y
    along = to_x * dx + to_y * dy
    if along > 0.8 * math.sqrt(to_x * to_x + to_y * to_y):
        return to_x + 0.5 * reach * dx, to_y + 0.5 * reach * dy
    return to_x - 1.4 * reach * dx, to_y - 1.4 * reach * dy


@compiled_here
def hostile_action(state, params, player, mode, whim):
    """A hostile action of length 1 or more in the player's own view; `whim`, 0 to 1, chooses within the mode."""
    if mode == JITTER:
        return (1.0 if draw(state) < 0.5 else -1.0), (1.0 if draw(state) < 0.5 else -1.0)
    if mode == WANDER:
        return draw_between(state, -1.5, 1.5), draw_between(state, -1.5, 1.5)
    view = view_of(state, player)
    reach = params.radius[player] + params.radius[PUCK]
    x, y = view.puck_x - view.x, view.puck_y - view.y
    if mode == AHEAD:
        lead = whim * 0.3
        x, y = x + lead * view.puck_vx, y + lead * view.puck_vy
    elif mode == SHAKE:
        sign = 1.0 if state.steps % 2 == 0 else -1.0
        x, y = sign * x, sign * y
        if whim < 0.5:
            x, y = -y, x
    elif mode == PIN:
        side = 1.0 if view.puck_y > 0.0 else -1.0
        if whim < 0.2:  # on the side wall
            x, y = _push(view, reach, 0.0, side)
        elif whim < 0.4:  # on the own end wall
            x, y = _push(view, reach, -1.0, 0.0)
        elif whim < 0.6:  # into the own corner
            x, y = _push(view, reach, -math.sqrt(0.5), side * math.sqrt(0.5))
        elif whim < 0.8:  # on a post
            px = -params.half_length - view.puck_x
            py = side * params.half_goal - view.puck_y
            away = max(math.sqrt(px * px + py * py), 1e-9)
            x, y = _push(view, reach, px / away, py / away)
        else:  # at the other player
            x, y = _push(view, reach, 1.0, 0.0)
    length = max(math.sqrt(x * x + y * y), 1e-9)
    return 1.5 * x / length, 1.5 * y / length


@compiled_here
def ambush(state, params):
    """Put the puck on an edge and a paddle against it, both at great speed, if there is room."""
    p, v = state.position, state.velocity
    r = params.radius[PUCK]
    x_most, y_most = params.half_length - r, params.half_width - r
    x, y = draw_between(state, -x_most, x_most), draw_between(state, -y_most, y_most)
    where = draw(state)
    if where < 0.3:
        y = y_most if draw(state) < 0.5 else -y_most
    if 0.2 < where < 0.6:
        x = x_most if draw(state) < 0.5 else -x_most
    if where > 0.8:  # around a post
        end, side = (1.0 if draw(state) < 0.5 else -1.0), (1.0 if draw(state) < 0.5 else -1.0)
        angle = draw_between(state, 0.0, 0.5 * math.pi)
        x = end * (params.half_length - r * math.cos(angle))
        y = side * (params.half_goal - r * math.sin(angle))
    player = LEFT if x < 0.0 else RIGHT
    angle = draw_between(state, -math.pi, math.pi)
    reach = params.radius[player] + r
    px, py = x + reach * math.cos(angle), y + reach * math.sin(angle)
    near, far = params.radius[player], params.half_length - params.radius[player]
    if not near <= abs(px) <= far or px * x < 0.0 or abs(py) > params.half_width - params.radius[player]:
        return
    other = RIGHT if player == LEFT else LEFT
    if math.sqrt((x - p[other, 0]) ** 2 + (y - p[other, 1]) ** 2) < reach:
        return
    p[PUCK, 0], p[PUCK, 1], p[player, 0], p[player, 1] = x, y, px, py
    speed = params.puck_speed * draw(state)
    angle = draw_between(state, -math.pi, math.pi)
    v[PUCK, 0], v[PUCK, 1] = speed * math.cos(angle), speed * math.sin(angle)
    speed = params.paddle_speed * draw(state)
    angle = draw_between(state, -math.pi, math.pi)
    v[player, 0], v[player, 1] = speed * math.cos(angle), speed * math.sin(angle)
