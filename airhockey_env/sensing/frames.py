"""What a camera does in a control step, compiled: frames are taken, travel, arrive and are made sense of.

Times are in control steps since the start of the episode.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled, inlined, records
from airhockey_env.kernel.random_stream import draw
from airhockey_env.kernel.state import OBSERVATION_SIZE, PUCK, RIGHT

LENS = np.dtype(
    [
        ("control_hz", np.float64),
        ("camera_hz", np.float64),
        ("delay", np.float64),  # steps
        ("jitter", np.float64),  # steps
        ("noise", np.float64, (2,)),  # m: opponent's paddle, puck
        ("dropout", np.float64),
        ("gap", np.float64),  # m
        ("estimates", np.bool_),  # velocities come from positions
    ],
    align=True,
)
"""A `Camera` at a control rate."""

SIGHT = np.dtype(
    [
        ("stream", np.uint64),  # state of the table's own random stream
        ("step", np.int64),  # of the episode
        ("frame", np.int64),  # number of the next frame
        ("first", np.int64),  # place in the queue of the frame that arrives next
        ("waiting", np.int64),  # frames in the queue
        ("latest", np.float64),  # when the last of them arrives
        ("known", np.int64, (2,)),  # remembered positions of the opponent's paddle, the puck
        ("next", np.int64, (2,)),  # place in these rings of the next
        ("true", np.float64, (2, 4)),  # x, y, vx, vy of these at the last control step, m and m/s
        ("seen", np.float64, (2, 4)),  # as the player knows them
        ("scale", np.float64, (2, 4)),  # from these to the observation, in this episode
        ("unit", np.float64, (2, 4)),  # and back
        ("reach", np.float64),  # m between their centres, below which the puck is hidden
    ],
    align=True,
)
"""What a camera knows of one table."""

HOLD, ADVANCE, RESTART = range(3)
"""What to do with a table: leave it, go one control step on, or begin an episode."""

TAKEN, ARRIVES, SHOWS_PUCK, STATES = range(4)
"""Columns of the queue; from STATES on, the two discs' x, y, vx, vy."""

QUEUE_COLUMNS = STATES + 8

OTHER, THE_PUCK = range(2)
DISCS = 2
FIRST_COLUMN = 4
"""The first column of the observation that a camera sees: the opponent's paddle's come first, then the puck's."""

MOMENT = 1e-9
"""Steps: differences in time that are rounding."""


class Memory(NamedTuple):
    """All that a camera keeps, for N tables."""

    sights: NDArray[np.void]  # (N,) SIGHT
    queue: NDArray[np.float64]  # (N, length, QUEUE_COLUMNS): frames on their way
    past: NDArray[np.float64]  # (N, 2, frames, 3): time, x, y that estimates are made from, a ring for each disc
    seen: NDArray[np.float32]  # (N, 13): the observations as the player has them


def make_memory(num_tables: int, lens: NDArray[np.void], frames: int) -> Memory:
    """A memory with room for all frames that can be on their way."""
    per_step = float(lens["camera_hz"][0] / lens["control_hz"][0])
    length = math.floor((float(lens["delay"][0] + lens["jitter"][0]) + 1.0) * per_step) + 3
    return Memory(
        records(num_tables, SIGHT),
        np.zeros((num_tables, length, QUEUE_COLUMNS)),
        np.zeros((num_tables, DISCS, frames, 3)),
        np.zeros((num_tables, OBSERVATION_SIZE), np.float32),
    )


def _ziggurat(layers: int = 256, edge: float = 3.6541528853610088) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Widths of the layers, all of one area, under exp(-x**2 / 2), and their heights from the bottom up.

    The bottom layer holds the tail beyond `edge` too, and is as wide as its area makes it.
    """
    area = edge * math.exp(-0.5 * edge**2) + math.sqrt(0.5 * math.pi) * math.erfc(edge / math.sqrt(2.0))
    widths, heights = [edge], [0.0, math.exp(-0.5 * edge**2)]
    while len(widths) < layers - 1:
        heights.append(heights[-1] + area / widths[-1])
        widths.append(math.sqrt(-2.0 * math.log(heights[-1])))
    bottom = area / heights[1]
    return np.array([bottom, *widths, 0.0]), np.array([*heights, 1.0])


_WIDTHS, _HEIGHTS = _ziggurat()
_EDGE = float(_WIDTHS[1])
_LAYERS = len(_WIDTHS) - 1


@compiled
def draw_normal(sight):
    """A number from the normal distribution (Marsaglia and Tsang, "The ziggurat method", 2000)."""
    while True:
        u = draw(sight) * _LAYERS
        layer = int(u)
        x = (2.0 * (u - layer) - 1.0) * _WIDTHS[layer]
        if abs(x) < _WIDTHS[layer + 1]:
            return x
        if layer == 0:
            while True:  # the tail
                a = -math.log(1.0 - draw(sight)) / _EDGE
                b = -math.log(1.0 - draw(sight))
                if 2.0 * b > a * a:
                    return math.copysign(_EDGE + a, x)
        y = _HEIGHTS[layer] + draw(sight) * (_HEIGHTS[layer + 1] - _HEIGHTS[layer])
        if y < math.exp(-0.5 * x * x):
            return x


@inlined
def along(x0, y0, vx0, vy0, x1, y1, vx1, vy1, tick, share):
    """Where a disc was between two control steps, after `share` of the time from state 0 to state 1.

    With one bounce between them the path is a line that leaves state 0 and another that leads to state 1; they are
    at the same place at the time of the bounce. Exact for that but for drag; in free flight too.
    """
    if share >= 1.0 - MOMENT:
        return x1, y1, vx1, vy1
    dvx, dvy = vx0 - vx1, vy0 - vy1
    dv2 = dvx * dvx + dvy * dvy
    if dv2 < 1e-12:
        return x0 + share * (x1 - x0), y0 + share * (y1 - y0), vx1, vy1
    bounce = ((x1 - x0 - vx1 * tick) * dvx + (y1 - y0 - vy1 * tick) * dvy) / dv2
    since = share * tick
    if since < bounce:
        return x0 + vx0 * since, y0 + vy0 * since, vx0, vy0
    left = tick - since
    return x1 - vx1 * left, y1 - vy1 * left, vx1, vy1


@inlined
def blur(sight, lens, disc, x, y):
    """A place as a frame shows it."""
    sigma = lens.noise[disc]
    if sigma > 0.0:
        x += sigma * draw_normal(sight)
        y += sigma * draw_normal(sight)
    return x, y


@inlined
def remember(sight, past, disc, time, x, y):
    """Note a seen position."""
    k = sight.next[disc]
    past[disc, k, 0] = time
    past[disc, k, 1] = x
    past[disc, k, 2] = y
    sight.known[disc] = min(sight.known[disc] + 1, past.shape[1])
    sight.next[disc] = k + 1 if k + 1 < past.shape[1] else 0


@inlined
def slope(sight, past, disc, tick):
    """Velocity, m/s, of the least-squares line through the remembered positions; 0 while there is only one."""
    n = sight.known[disc]
    if n < 2:
        return 0.0, 0.0
    t0, x0, y0 = past[disc, 0, 0], past[disc, 0, 1], past[disc, 0, 2]
    t, x, y, tt, tx, ty = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(n):  # relative to one of them, so that little is lost to rounding
        dt, dx, dy = past[disc, k, 0] - t0, past[disc, k, 1] - x0, past[disc, k, 2] - y0
        t += dt
        x += dx
        y += dy
        tt += dt * dt
        tx += dt * dx
        ty += dt * dy
    below = (tt - t * t / n) * tick
    return (tx - t * x / n) / below, (ty - t * y / n) / below


@inlined
def take_frame(sight, lens, queue, tick, time, now):
    """Take a frame at a time in the last control step and send it on its way. `now`: the true states at its end."""
    if lens.dropout > 0.0 and draw(sight) < lens.dropout:
        return
    share = time - (sight.step - 1)
    then = sight.true
    a, b = OTHER, THE_PUCK
    ox, oy, ovx, ovy = along(
        then[a, 0], then[a, 1], then[a, 2], then[a, 3], now[0], now[1], now[2], now[3], tick, share
    )
    x, y, vx, vy = along(then[b, 0], then[b, 1], then[b, 2], then[b, 3], now[4], now[5], now[6], now[7], tick, share)
    hidden = (x - ox) * (x - ox) + (y - oy) * (y - oy) < sight.reach * sight.reach
    ox, oy = blur(sight, lens, OTHER, ox, oy)
    x, y = blur(sight, lens, THE_PUCK, x, y)
    arrives = time + lens.delay
    if lens.jitter > 0.0:
        arrives += lens.jitter * (2.0 * draw(sight) - 1.0)
    arrives = max(arrives, sight.latest)
    sight.latest = arrives
    k = sight.first + sight.waiting
    if k >= queue.shape[0]:
        k -= queue.shape[0]
    sight.waiting += 1
    queue[k, TAKEN], queue[k, ARRIVES], queue[k, SHOWS_PUCK] = time, arrives, 0.0 if hidden else 1.0
    s = STATES
    queue[k, s], queue[k, s + 1], queue[k, s + 2], queue[k, s + 3] = ox, oy, ovx, ovy
    queue[k, s + 4], queue[k, s + 5], queue[k, s + 6], queue[k, s + 7] = x, y, vx, vy


@inlined
def receive(sight, lens, queue, past, tick):
    """Make sense of the frames that have arrived by now."""
    new_other, new_puck = False, False
    while sight.waiting > 0 and queue[sight.first, ARRIVES] <= sight.step + MOMENT:
        k = sight.first
        sight.first = k + 1 if k + 1 < queue.shape[0] else 0
        sight.waiting -= 1
        for disc in range(DISCS):
            if disc == THE_PUCK and queue[k, SHOWS_PUCK] == 0.0:
                continue
            for c in range(4):
                sight.seen[disc, c] = queue[k, STATES + 4 * disc + c]
            if lens.estimates:
                remember(sight, past, disc, queue[k, TAKEN], sight.seen[disc, 0], sight.seen[disc, 1])
            if disc == OTHER:
                new_other = True
            else:
                new_puck = True
    if lens.estimates:
        for disc in range(DISCS):
            if new_other if disc == OTHER else new_puck:
                sight.seen[disc, 2], sight.seen[disc, 3] = slope(sight, past, disc, tick)


@inlined
def restart(sight, lens, past, now):
    """Begin an episode: its first frame is seen at once, whole."""
    sight.step = 0
    sight.frame = 1
    sight.first = 0
    sight.waiting = 0
    sight.latest = 0.0
    for disc in range(DISCS):
        sight.known[disc] = 0
        sight.next[disc] = 0
        for c in range(4):
            sight.seen[disc, c] = now[4 * disc + c]
        x, y = blur(sight, lens, disc, now[4 * disc], now[4 * disc + 1])
        sight.seen[disc, 0], sight.seen[disc, 1] = x, y
        if lens.estimates:
            remember(sight, past, disc, 0.0, x, y)
            sight.seen[disc, 2], sight.seen[disc, 3] = 0.0, 0.0


@inlined
def take_measures(sight, lens, law):
    """Note the sizes of the table and the scales of its observations, which hold for an episode."""
    sight.reach = lens.gap + law.radius[RIGHT] + law.radius[PUCK] if lens.gap > 0.0 else 0.0
    for disc in range(DISCS):
        per_speed = law.per_paddle if disc == OTHER else law.per_puck
        sight.scale[disc, 0], sight.scale[disc, 1] = law.per_x, law.per_y
        sight.scale[disc, 2], sight.scale[disc, 3] = per_speed, per_speed
        for c in range(4):
            sight.unit[disc, c] = 1.0 / sight.scale[disc, c]


@compiled
def sense_rows(tasks, observations, physics, lenses, memory):
    """Look at every table and write what the player knows of it to `memory.seen`.

    Args:
        tasks: (N,) int8: HOLD, ADVANCE or RESTART.
        observations: (N, 13) float32, the true ones.
        physics: (1,) or (N,) `PHYSICS`; read where an episode begins.
        lenses: (1,) `LENS`.
        memory: `Memory`; changed in place.
    """
    lens = lenses[0]
    tick = 1.0 / lens.control_hz
    own_physics = physics.shape[0] > 1
    now = np.empty(4 * DISCS)
    for i in range(tasks.shape[0]):
        if tasks[i] == HOLD:
            continue
        law = physics[i if own_physics else 0]
        sight, queue, past = memory.sights[i], memory.queue[i], memory.past[i]
        if tasks[i] == RESTART:
            take_measures(sight, lens, law)
        for c in range(4 * DISCS):
            now[c] = observations[i, FIRST_COLUMN + c] * sight.unit[c // 4, c % 4]
        if tasks[i] == RESTART:
            restart(sight, lens, past, now)
        else:
            sight.step += 1
            time = sight.frame * lens.control_hz / lens.camera_hz
            while time <= sight.step + MOMENT:
                take_frame(sight, lens, queue, tick, time, now)
                sight.frame += 1
                time = sight.frame * lens.control_hz / lens.camera_hz
            receive(sight, lens, queue, past, tick)
        for c in range(observations.shape[1]):
            memory.seen[i, c] = observations[i, c]
        for c in range(4 * DISCS):
            sight.true[c // 4, c % 4] = now[c]
            value = sight.seen[c // 4, c % 4] * sight.scale[c // 4, c % 4]
            memory.seen[i, FIRST_COLUMN + c] = min(max(value, -1.0), 1.0)
