"""Scripted opponents, compiled, so that they play in the batch at the engine's speed.

Each sees the table as a player does (own goal at -x) and answers with a place for its paddle, m: (x, y, through), where
`through` is to pass there at full speed instead of stopping. To add one: write a function like `goalie`, give it a
number and a name, and add it to `_choose_places`.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import compiled, inlined
from airhockey_env.kernel.block import params_at
from airhockey_env.kernel.observations import view_at
from airhockey_env.kernel.random_stream import draw, draw_between
from airhockey_env.kernel.state import HOME, LEFT, RIGHT

IDLE, RANDOM, GOALIE, STRIKER, EXTERNAL = range(5)
SCRIPTED = {"idle": IDLE, "random": RANDOM, "goalie": GOALIE, "striker": STRIKER}

GUARD = 0.72
"""Where a striker waits for a shot: share of the half length from the centre."""

BRAKING = 0.5
"""How hard a paddle counts on braking towards a place: 2 would be all that its acceleration gives. Less is better: it
has something left when the puck changes its course."""


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
def goalie(view, params, plan):
    """Stays home and keeps between the puck and the goal."""
    return -HOME * params.half_length, _clamp(view.puck_y, params.half_goal), False


@inlined
def _folded(y, limit):
    """Where a straight path that leaves the table at a side wall comes to lie when it is folded back there."""
    if y > limit:
        y = 2.0 * limit - y
    elif y < -limit:
        y = -2.0 * limit - y
    return _clamp(y, limit)


@inlined
def _defend(view, params):
    """Be where a straight shot will come through; bank shots have to be seen coming off the wall first."""
    guard = -GUARD * params.half_length
    if view.puck_x < view.x and abs(view.puck_y) > params.half_goal:
        # The puck is behind the paddle in a corner: home, but not through it.
        return guard, _clamp(view.puck_y, 0.5 * params.half_goal)
    y = 0.5 * view.puck_y
    if view.puck_vx < -0.3 and view.puck_x > guard:
        y = view.puck_y + view.puck_vy * (guard - view.puck_x) / view.puck_vx
        if view.puck_vx > -0.4 * params.paddle_speed:
            y = _folded(y, params.half_width - params.radius[2])
    return guard, _clamp(y, 1.6 * params.half_goal)


@inlined
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
        part = (plan - (0.4 if plan < 0.7 else 0.7)) / 0.3
        goal_y = side * (wall + params.bend * (wall + part * spread))
    dx, dy = goal_x - x, goal_y - y
    length = math.sqrt(dx * dx + dy * dy)
    return dx / length, dy / length


@inlined
def _attack(view, params, plan):
    """Get behind the puck and shoot at the goal."""
    reach = params.radius[0] + params.radius[2]
    far_x, far_y = params.half_length - params.radius[0], params.half_width - params.radius[0]

    # Meet the puck where it will be when the paddle can be there.
    gap_x, gap_y = view.puck_x - view.x, view.puck_y - view.y
    gap = math.sqrt(gap_x * gap_x + gap_y * gap_y)
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
    kiss_x, kiss_y = x - reach * nx, y - reach * ny
    dx, dy = kiss_x - view.x, kiss_y - view.y
    distance = math.sqrt(dx * dx + dy * dy)
    to_x, to_y = x - view.x, y - view.y
    if to_x > 0.0 and dx * nx + dy * ny > 0.7 * distance > 0.0:
        return kiss_x, kiss_y, True

    behind_x, behind_y = max(x - 2.2 * reach * nx, -far_x), _clamp(y - 2.2 * reach * ny, far_y)
    if to_x < 0.9 * reach and abs(to_y) < 1.2 * reach:
        # Beside or in front of the puck: back around it, on the side with room, never through it.
        side = 1.0 if to_y < 0.0 else -1.0
        if abs(y + side * 1.3 * reach) > far_y:
            side = -side
        behind_y = y + side * 1.5 * reach
        if to_x < -0.9 * reach or abs(to_y) < reach:
            behind_x = view.x
    return behind_x, behind_y, False


@inlined
def striker(view, params, plan):
    """Defends, gets behind the puck and shoots at the goal.

    `plan`, 0 to 1, decides how it shoots: it is drawn when the puck comes to its side.
    """
    speed = math.sqrt(view.puck_vx * view.puck_vx + view.puck_vy * view.puck_vy)
    leaving = view.puck_vx > 0.3 * params.paddle_speed
    if view.puck_x > 0.0 or leaving or speed > 0.75 * params.paddle_speed:
        x, y = _defend(view, params)
        return x, y, False
    return _attack(view, params, plan)


@inlined
def _towards(view, params, x, y, through):
    """The action that brings the paddle to a place and stops it there, or takes it through there at full speed."""
    dx, dy = x - view.x, y - view.y
    distance = math.sqrt(dx * dx + dy * dy)
    if through:
        return dx / distance, dy / distance
    # No faster than it can brake on the way.
    braking = math.sqrt(BRAKING * params.paddle_step / params.tick * distance)
    speed = min(braking, distance / params.tick, params.paddle_speed)
    share = speed / (params.paddle_speed * max(distance, 1e-9))
    return dx * share, dy * share


@inlined
def _limited(ax, ay, skill):
    """An action, cut to a length of 1, of a player of that skill."""
    length = math.sqrt(ax * ax + ay * ay)
    share = skill / max(length, 1.0)
    return ax * share, ay * share


@inlined
def scripted_action(view, params, plan, skill, destination):
    """The action of a player that wants to be where `destination`, one of the functions above, says."""
    x, y, through = destination(view, params, plan)
    ax, ay = _towards(view, params, x, y, through)
    return _limited(ax, ay, skill)


@inlined
def _choose_place(block, n, player, number, destination):
    """The actions of those tables on which scripted player `number` drives this paddle."""
    for k in range(n):
        view, params = view_at(block, k, player), params_at(block, k)
        ax, ay = scripted_action(view, params, block.plan[k], block.skill[player, k], destination)
        mine = block.driver[k] == number
        block.action[player, 0, k] = ax if mine else block.action[player, 0, k]
        block.action[player, 1, k] = ay if mine else block.action[player, 1, k]


@inlined
def _choose_places(block, n, player, drivers):
    if drivers & 1 << GOALIE:
        _choose_place(block, n, player, GOALIE, goalie)
    if drivers & 1 << STRIKER:
        _choose_place(block, n, player, STRIKER, striker)


@compiled
def choose(block, n, first, player, states, drivers, actions):
    """Write the actions of the players in a seat, on n tables from number `first` on, to the block."""
    here = drivers[player, first : first + n]
    found = 0
    for k in range(n):
        block.driver[k] = here[k]
        found |= 1 << here[k]
    if found & 1 << EXTERNAL:
        for k in range(n):
            block.action[player, 0, k] = actions[first + k, 0]
            block.action[player, 1, k] = actions[first + k, 1]
    if found & (1 << IDLE | 1 << RANDOM):
        for k in range(n):
            if here[k] == IDLE or here[k] == RANDOM:
                ax, ay = 0.0, 0.0
                if here[k] == RANDOM and not block.begins[k]:  # where an episode begins, nobody draws
                    ax, ay = _limited(*wander(states[first + k], player), block.skill[player, k])
                block.action[player, 0, k] = ax
                block.action[player, 1, k] = ay
    if player == LEFT:
        _choose_places(block, n, LEFT, found)
    else:
        _choose_places(block, n, RIGHT, found)
