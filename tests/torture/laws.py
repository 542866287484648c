"""The laws that a table keeps whatever the players do, as checks of one step."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from airhockey_env.kernel.observations import observe
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.kernel.tasks import TASKS
from tests.torture.compiled_here import compiled_here

OVERLAP = 1e-9
"""m: a deeper overlap is a failure."""
ROUNDING = 1e-12
"""Share by which a speed may exceed its cap."""

FAILURES = (
    "nothing",
    "a number is not finite",
    "the puck overlaps a paddle",
    "the puck overlaps a wall or post, or has escaped",
    "a paddle has left its part of the table",
    "the puck is faster than its cap",
    "a paddle is faster than its cap",
    "an observation is out of [-1, 1]",
    "a contact is not sane",
    "the puck gained speed without a paddle",
    "a drawn table is out of its ranges",
    "the score is not that of the step",
    "the shot clock is not that of the step",
    "the end of the episode is not that of the step",
)
(
    FINE, FINITE, PADDLE, EDGE, CONFINED, PUCK_SPEED, PADDLE_SPEED, OBSERVED, CONTACTS, ENERGY, RANGES,
    SCORE, CLOCK, ENDED,
) = range(len(FAILURES))  # fmt: skip

POINT_TASKS = (TASKS["point"].number, TASKS["match"].number)
"""Those that end with the points."""

WORST, PADDLE_CONTACTS, EDGE_CONTACTS, CROWDED, PINNED, POINTS, DRAWN, TALLY = range(8)
"""Places in a tally: see `Report`."""


@compiled_here
def _edge_depth(x, y, r, params):
    """How deep a puck is in a wall or post, m; negative if it is clear of them."""
    x, y = abs(x), abs(y)
    depth = y + r - params.half_width
    if y >= params.half_goal:
        return max(depth, x + r - params.half_length)
    post = r - math.sqrt((x - params.half_length) ** 2 + (y - params.half_goal) ** 2)
    return max(depth, post, x - params.half_length)


@compiled_here
def _sane(contacts, count, params):
    """Whether the contacts of a step are what contacts can be."""
    before = 0.0
    for k in range(count):
        c = contacts[k]
        if not before <= c.time <= params.tick or not c.impulse > 0.0:
            return False
        if not (c.a == PUCK and c.b == -1) and not ((c.a == LEFT or c.a == RIGHT) and c.b == PUCK):
            return False
        if not abs(c.nx * c.nx + c.ny * c.ny - 1.0) < 1e-9:
            return False
        if not (abs(c.x) <= params.half_length + OVERLAP and abs(c.y) <= params.half_width + OVERLAP):
            return False
        before = c.time
    return True


@compiled_here
def check_state(state, params, room, tally):
    """The first law that a state breaks, or FINE; keeps the worst overlap in `tally`. `room` is (2, 1, 13), to use."""
    p, v = state.position, state.velocity
    total = 0.0
    for disc in range(3):
        total += abs(p[disc, 0]) + abs(p[disc, 1]) + abs(v[disc, 0]) + abs(v[disc, 1])
    if not total < math.inf:
        return FINITE

    r = params.radius[PUCK]
    gap = math.inf
    for player in (LEFT, RIGHT):
        dx, dy = p[PUCK, 0] - p[player, 0], p[PUCK, 1] - p[player, 1]
        gap = min(gap, math.sqrt(dx * dx + dy * dy) - params.radius[player] - r)
        forward = 1.0 if player == LEFT else -1.0
        ahead, radius = forward * p[player, 0], params.radius[player]
        out = max(ahead + radius, -ahead + radius - params.half_length, abs(p[player, 1]) + radius - params.half_width)
        tally[WORST] = max(tally[WORST], out)
        if out > OVERLAP:
            return CONFINED
        if math.sqrt(v[player, 0] ** 2 + v[player, 1] ** 2) > params.paddle_speed * (1.0 + ROUNDING):
            return PADDLE_SPEED
    edge = _edge_depth(p[PUCK, 0], p[PUCK, 1], r, params)
    tally[WORST] = max(tally[WORST], -gap, edge)
    if -gap > OVERLAP:
        return PADDLE
    if edge > OVERLAP:
        return EDGE
    if gap < OVERLAP and edge > -OVERLAP:
        tally[PINNED] += 1
    if math.sqrt(v[PUCK, 0] ** 2 + v[PUCK, 1] ** 2) > params.puck_speed * (1.0 + ROUNDING):
        return PUCK_SPEED

    for player in (LEFT, RIGHT):
        observe(state, params, player, room, 0)
        for k in range(room.shape[2]):
            if not -1.0 <= room[player, 0, k] <= 1.0:
                return OBSERVED
    return FINE


@compiled_here
def check_step(before, state, params, settings, contacts, n_contacts, reward, terminated, truncated, room, tally):
    """The first law that a step from `before` to `state` breaks, or FINE; keeps counts in `tally`.

    Args:
        settings: the `SETTINGS` in force.
        contacts: (CONTACT_ROWS,) the first `n_contacts` are those of the step.
        reward, terminated, truncated: what the left player was told.
    """
    failure = check_state(state, params, room, tally)
    if failure != FINE:
        return failure
    failure = _check_rules(before, state, params, settings, reward, terminated, truncated)
    if failure != FINE:
        return failure
    if not _sane(contacts, n_contacts, params):
        return CONTACTS
    with_paddles = 0
    for k in range(n_contacts):
        with_paddles += contacts[k].b == PUCK
    tally[PADDLE_CONTACTS] += with_paddles
    tally[EDGE_CONTACTS] += n_contacts - with_paddles
    crowded = n_contacts == contacts.shape[0]
    tally[CROWDED] += crowded
    speed_before = math.sqrt(before.velocity[PUCK, 0] ** 2 + before.velocity[PUCK, 1] ** 2)
    speed = math.sqrt(state.velocity[PUCK, 0] ** 2 + state.velocity[PUCK, 1] ** 2)
    if not (crowded or with_paddles) and speed > speed_before * (1.0 + ROUNDING):  # a served puck is at rest
        return ENERGY
    return FINE


@compiled_here
def _check_rules(before, state, params, settings, reward, terminated, truncated):
    """The first rule of the game that a step breaks, or FINE."""
    won, lost = state.score[0] - before.score[0], state.score[1] - before.score[1]
    if won < 0 or lost < 0 or won + lost > 1:
        return SCORE
    if not settings.shaped and reward != float(won - lost):
        return SCORE

    if won + lost == 1:  # the side that conceded serves, if the game goes on
        kept = state.clock == before.clock if terminated else state.clock == 0 and state.side == won - lost
    elif state.side != before.side:  # over the centre line, or a foul
        kept = state.clock == 0
    else:
        kept = state.clock == before.clock + 1 and (state.clock <= params.clock_limit or terminated)
    if not kept or not (terminated or state.side * state.position[PUCK, 0] >= 0.0):
        return CLOCK

    limit = settings.max_steps > 0 and state.steps >= settings.max_steps
    won_by_points = max(state.score[0], state.score[1]) >= settings.points
    by_points = settings.task == POINT_TASKS[0] or settings.task == POINT_TASKS[1]
    if (
        state.steps != before.steps + 1
        or (state.done != 0) != (terminated or truncated)
        or truncated != (limit and not terminated)
        or (by_points and terminated != won_by_points)
        or (won + lost == 1 and not by_points and not terminated)
    ):
        return ENDED
    return FINE


@compiled_here
def in_ranges(params, ranges):
    """Whether a table's fields are what `randomize` may draw."""
    outside = 0
    for k in range(ranges.shape[0]):
        outside += not ranges[k, 0] <= params.spec[k] <= ranges[k, 1]
    return outside == 0


def new_tally() -> NDArray[np.float64]:
    """Nothing was counted yet."""
    tally = np.zeros(TALLY)
    tally[WORST] = -math.inf
    return tally
