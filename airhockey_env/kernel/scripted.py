"""Scripted opponents, compiled, so that they play in the batch at the engine's speed.

Each sees the table as a player does (own goal at -x) and answers with a target velocity, as a share of the paddle's
greatest speed. To add one: write a function like `goalie`, give it a number and a name, and add it to
`scripted_action`.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import compiled, inlined
from airhockey_env.kernel.observations import view_of
from airhockey_env.kernel.random_stream import draw, draw_between
from airhockey_env.kernel.state import HOME

IDLE, RANDOM, GOALIE, STRIKER, EXTERNAL = range(5)
SCRIPTED = {"idle": IDLE, "random": RANDOM, "goalie": GOALIE, "striker": STRIKER}

GUARD = 0.72
"""Where a striker waits for a shot: share of the half length from the centre."""

BRAKING = 0.5
"""How hard a paddle counts on braking towards a place: 2 would be all that its acceleration gives. Less is better: it
has something left when the puck changes its course."""


@inlined
def _towards(view, params, x, y):
    """The action that brings the paddle to a place and stops it there: no faster than it can brake on the way."""
    dx, dy = x - view.x, y - view.y
    distance = math.sqrt(dx * dx + dy * dy)
    braking = math.sqrt(BRAKING * params.paddle_step / params.tick * distance)
    speed = min(braking, distance / params.tick, params.paddle_speed)
    share = speed / (params.paddle_speed * max(distance, 1e-9))
    return dx * share, dy * share


@inlined
def _clamp(value, limit):
    return min(max(value, -limit), limit)


@inlined
def wander(state, player):
    """Random: a direction and speed, which change every ten steps on average."""
    if draw(state) < 0.1:
        state.wander[player, 0] = draw_between(state, -1.0, 1.0)
        state.wander[player, 1] = draw_between(state, -1.0, 1.0)
    return state.wander[player, 0], state.wander[player, 1]


@inlined
def goalie(view, params):
    """Stays home and keeps between the puck and the goal."""
    return _towards(view, params, -HOME * params.half_length, _clamp(view.puck_y, params.half_goal))


@inlined
def _folded(y, limit):
    """Where a straight path that leaves the table at a side wall comes to lie when it is folded back there."""
    if y > limit:
        y = 2.0 * limit - y
    elif y < -limit:
        y = -2.0 * limit - y
    return _clamp(y, limit)


@compiled
def _defend(view, params):
    """Be where a straight shot will come through; bank shots have to be seen coming off the wall first."""
    if view.puck_x < view.x and abs(view.puck_y) > params.half_goal:
        # The puck is behind the paddle in a corner: home, but not through it.
        return _towards(view, params, -GUARD * params.half_length, _clamp(view.puck_y, 0.5 * params.half_goal))
    guard = -GUARD * params.half_length
    y = 0.5 * view.puck_y
    if view.puck_vx < -0.3 and view.puck_x > guard:
        y = view.puck_y + view.puck_vy * (guard - view.puck_x) / view.puck_vx
        if view.puck_vx > -0.4 * params.paddle_speed:
            y = _folded(y, params.half_width - params.radius[2])
    return _towards(view, params, guard, _clamp(y, 1.6 * params.half_goal))


@compiled
def _aim(view, params, x, y, plan):
    """Unit vector along which a puck at (x, y) should leave: straight at a corner of the goal, or off a side wall."""
    puck = params.radius[2]
    goal_x = params.half_length
    wall = params.half_width - puck
    spread = 0.7 * (params.half_goal - puck)
    if plan < 0.4:  # straight, past the side of the goal that the other paddle leaves open
        goal_y = spread if view.other_y < 0.0 else -spread
    else:
        # Off a wall, to the middle or the far half of the goal. A wall that keeps different shares of the two
        # components bends the path, so that the image of the goal lies nearer than its mirror image.
        side = 1.0 if plan < 0.7 else -1.0
        part = (plan - 0.4) / 0.3 if plan < 0.7 else (plan - 0.7) / 0.3
        bend = params.wall_tangential / max(params.wall_restitution, 0.1)
        goal_y = side * (wall + bend * (wall + part * spread))
    dx, dy = goal_x - x, goal_y - y
    length = math.sqrt(dx * dx + dy * dy)
    return dx / length, dy / length


@compiled
def striker(view, params, plan):
    """Defends, gets behind the puck and shoots at the goal.

    `plan`, 0 to 1, decides how it shoots: it is drawn when the puck comes to its side.
    """
    reach = params.radius[0] + params.radius[2]
    far_x, far_y = params.half_length - params.radius[0], params.half_width - params.radius[0]
    speed = math.sqrt(view.puck_vx * view.puck_vx + view.puck_vy * view.puck_vy)
    leaving = view.puck_vx > 0.3 * params.paddle_speed
    if view.puck_x > 0.0 or leaving or speed > 0.75 * params.paddle_speed:
        return _defend(view, params)

    # Meet the puck where it will be when the paddle can be there.
    gap = math.sqrt((view.puck_x - view.x) ** 2 + (view.puck_y - view.y) ** 2)
    lead = max(0.0, gap - reach) / params.paddle_speed
    x = max(view.puck_x + view.puck_vx * lead, params.radius[2] - params.half_length)
    y = _folded(view.puck_y + view.puck_vy * lead, params.half_width - params.radius[2])

    # The impulse lies along the normal at the kiss, so the normal has to be what turns the puck's velocity into the
    # shot's; and the kiss has to be at the point of the puck's rim where that is the normal.
    aim_x, aim_y = _aim(view, params, x, y, plan)
    shot = 0.8 * (1.0 + params.disc_restitution) * params.paddle_speed
    nx, ny = shot * aim_x - view.puck_vx, shot * aim_y - view.puck_vy
    length = math.sqrt(nx * nx + ny * ny)
    nx, ny = nx / length, ny / length
    kiss_x, kiss_y = x - reach * nx - view.x, y - reach * ny - view.y
    distance = math.sqrt(kiss_x * kiss_x + kiss_y * kiss_y)
    to_x, to_y = x - view.x, y - view.y
    if to_x > 0.0 and kiss_x * nx + kiss_y * ny > 0.7 * distance > 0.0:
        return kiss_x / distance, kiss_y / distance

    behind_x, behind_y = max(x - 2.2 * reach * nx, -far_x), _clamp(y - 2.2 * reach * ny, far_y)
    if to_x < 0.9 * reach and abs(to_y) < 1.2 * reach:
        # Beside or in front of the puck: back around it, on the side with room, never through it.
        side = 1.0 if to_y < 0.0 else -1.0
        if abs(y + side * 1.3 * reach) > far_y:
            side = -side
        if to_x < -0.9 * reach or abs(to_y) < reach:
            return _towards(view, params, view.x, y + side * 1.5 * reach)
        return _towards(view, params, behind_x, y + side * 1.5 * reach)
    return _towards(view, params, behind_x, behind_y)


@inlined
def scripted_action(state, params, player, who):
    """The action of scripted player number `who`, who drives the paddle of `player` (LEFT or RIGHT)."""
    if who == IDLE:
        return 0.0, 0.0
    if who == RANDOM:
        ax, ay = wander(state, player)
    else:
        view = view_of(state, player)
        if who == GOALIE:
            ax, ay = goalie(view, params)
        else:
            ax, ay = striker(view, params, state.plan)
    length = math.sqrt(ax * ax + ay * ay)
    share = state.skill[player] / max(length, 1.0)
    return ax * share, ay * share
