"""Scripted opponents, compiled, so that they play in the batch at the engine's speed.

Each sees the table as a player does (own goal at -x) and answers with a target velocity, as a share of the paddle's
greatest speed. To add one: write a function like `goalie`, give it a number and a name, and add it to `play`.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import compiled, inlined
from airhockey_env.observations import view
from airhockey_env.random_stream import draw, draw_between
from airhockey_env.records import HOME

IDLE, RANDOM, GOALIE, STRIKER, EXTERNAL = range(5)
SCRIPTED = {"idle": IDLE, "random": RANDOM, "goalie": GOALIE, "striker": STRIKER}

GAIN = 15.0
"""1/s: speed towards a target per distance from it. A paddle that brakes at 60 m/s**2 from 4 m/s can just follow."""


@inlined
def _towards(seen, physics, x, y):
    """The action that brings the paddle to a place and stops it there."""
    gain = min(GAIN, 1.0 / physics.tick) / physics.paddle_speed
    return gain * (x - seen.x), gain * (y - seen.y)


@inlined
def _clamp(value, limit):
    return min(max(value, -limit), limit)


@inlined
def wander(table):
    """Random: a direction and speed, drawn anew ten steps apart on average."""
    if draw(table) < 0.1:
        table.wander[0] = draw_between(table, -1.0, 1.0)
        table.wander[1] = draw_between(table, -1.0, 1.0)
    return table.wander[0], table.wander[1]


@inlined
def goalie(seen, physics):
    """Stays home and keeps between the puck and the goal."""
    return _towards(seen, physics, -HOME * physics.half_length, _clamp(seen.puck_y, physics.half_goal))


@compiled
def _folded(y, limit):
    """Where a path that leaves the table at the side walls comes to lie when it is folded back at them."""
    for _ in range(4):
        if y > limit:
            y = 2.0 * limit - y
        elif y < -limit:
            y = -2.0 * limit - y
    return _clamp(y, limit)


@compiled
def _defend(seen, physics):
    """Be on the goal line's near side where the puck will come through."""
    guard = -0.86 * physics.half_length
    if seen.puck_vx < -0.2 and seen.puck_x > guard:
        time = (guard - seen.puck_x) / seen.puck_vx
        y = _folded(seen.puck_y + seen.puck_vy * time, physics.half_width - physics.radius[2])
        return _towards(seen, physics, guard, _clamp(y, 1.2 * physics.half_goal))
    return _towards(seen, physics, -HOME * physics.half_length, _clamp(0.6 * seen.puck_y, 0.8 * physics.half_goal))


@compiled
def _aim(seen, physics, x, y, plan):
    """Unit vector along which a puck at (x, y) should leave: straight at a corner of the goal, or off a side wall."""
    puck = physics.radius[2]
    corner = 0.7 * (physics.half_goal - puck)
    goal_x = physics.half_length
    wall = physics.half_width - puck
    if plan < 0.5:  # straight, past the side of the goal that the other paddle leaves open
        goal_y = corner if (seen.other_y < 0.0) == (plan < 0.4) else -corner
    else:  # a wall takes more from the one component than from the other: the image of the goal shifts
        side = 1.0 if plan < 0.75 else -1.0
        goal_y = side * wall - y + side * wall * physics.wall_tangential / max(physics.wall_restitution, 0.1)
        goal_y = y + goal_y
    dx, dy = goal_x - x, goal_y - y
    length = math.sqrt(dx * dx + dy * dy)
    return dx / length, dy / length


@compiled
def striker(seen, physics, plan):
    """Defends, gets behind the puck and shoots at the goal.

    `plan`, 0 to 1, decides how it shoots: it is drawn when the puck comes to its side.
    """
    reach = physics.radius[0] + physics.radius[2]
    speed = math.sqrt(seen.puck_vx * seen.puck_vx + seen.puck_vy * seen.puck_vy)
    if seen.puck_x > 0.05 or seen.puck_vx > 0.5 or seen.puck_vx < -2.5 or speed > 4.0:
        return _defend(seen, physics)

    # Meet the puck where it will be when the paddle can be there.
    gap = math.sqrt((seen.puck_x - seen.x) ** 2 + (seen.puck_y - seen.y) ** 2)
    lead = max(0.0, gap - reach) / physics.paddle_speed
    wall = physics.half_width - physics.radius[2]
    x = seen.puck_x + seen.puck_vx * lead
    y = _folded(seen.puck_y + seen.puck_vy * lead, wall)
    dir_x, dir_y = _aim(seen, physics, x, y, plan)

    to_x, to_y = x - seen.x, y - seen.y
    distance = math.sqrt(to_x * to_x + to_y * to_y)
    along = to_x * dir_x + to_y * dir_y
    aside = to_x * dir_y - to_y * dir_x
    if to_x > 0.3 * reach and along > 0.0 and abs(aside) < 0.15 * reach + 0.05 * along:
        # Behind the puck and in line: strike through it. The normal at the kiss should be the aim.
        sx, sy = x - 0.5 * reach * dir_x - seen.x, y - 0.5 * reach * dir_y - seen.y
        length = max(math.sqrt(sx * sx + sy * sy), 1e-9)
        return sx / length, sy / length

    back = 1.5 * reach
    behind_x, behind_y = x - back * dir_x, y - back * dir_y
    far = physics.half_length - physics.radius[0]
    behind_x = max(behind_x, -far)
    if to_x < 0.8 * reach and distance < 3.0 * reach and abs(to_y) < 1.15 * reach:
        # Beside or in front of the puck: around it, on the side with room, never through it.
        side = 1.0 if to_y < 0.0 else -1.0
        if abs(y + side * 1.3 * reach) > physics.half_width - physics.radius[0]:
            side = -side
        away = y + side * 1.3 * reach
        return _towards(seen, physics, seen.x if to_x < -0.5 * reach else behind_x, away)
    return _towards(seen, physics, behind_x, behind_y)


@inlined
def play(table, physics, player):
    """The action of the scripted opponent that the table names, for the paddle of `player`."""
    if table.opponent == IDLE:
        return 0.0, 0.0
    if table.opponent == RANDOM:
        ax, ay = wander(table)
    else:
        seen = view(table, player)
        if table.opponent == GOALIE:
            ax, ay = goalie(seen, physics)
        else:
            ax, ay = striker(seen, physics, table.plan)
    length = math.sqrt(ax * ax + ay * ay)
    share = table.skill / max(length, 1.0)
    return ax * share, ay * share
