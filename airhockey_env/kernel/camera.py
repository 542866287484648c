"""What a camera does in a control step, compiled: frames are taken, travel, arrive, and positions become velocities.

It stands between a player's exact observation and the player, and overwrites what the player cannot know exactly: the
columns of the opponent's paddle and of the puck. Times are in control steps since the start of the episode.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.cameras import Camera
from airhockey_env.compiled import compiled, inlined, records
from airhockey_env.kernel.observations import OTHER_PADDLE
from airhockey_env.kernel.parameters import params_of
from airhockey_env.kernel.random_stream import draw
from airhockey_env.kernel.state import PUCK, RIGHT

CAMERA = np.dtype(
    [
        ("control_hz", np.float64),
        ("camera_hz", np.float64),
        ("delay", np.float64),  # steps
        ("jitter", np.float64),  # steps
        ("noise", np.float64, (2,)),  # m: opponent's paddle, puck
        ("dropout", np.float64),
        ("occlusion", np.float64),  # m
        ("estimates", np.bool_),  # velocities come from positions
    ],
    align=True,
)
"""A `Camera` at a control rate."""

CAMERA_STATE = np.dtype(
    [
        ("stream", np.uint64),  # state of the camera's own random stream
        ("step", np.int64),  # of the episode
        ("frame", np.int64),  # number of the next frame
        ("first", np.int64),  # place in the queue of the frame that arrives next
        ("waiting", np.int64),  # frames in the queue
        ("known", np.int64, (2,)),  # remembered positions of the opponent's paddle, the puck
        ("next", np.int64, (2,)),  # place in these rings of the next
        ("true", np.float64, (2, 4)),  # x, y, vx, vy of these at the last control step, m and m/s
        ("seen", np.float64, (2, 4)),  # as the player knows them
        ("scale", np.float64, (2, 4)),  # from these to the observation, in this episode
        ("reach", np.float64),  # m between their centres, below which the puck is hidden
    ],
    align=True,
)
"""What a camera keeps of one table, besides its queue and its rings."""

TAKEN, ARRIVES, SHOWS_PUCK, STATES = range(4)
"""Columns of the queue; from STATES on, the two discs' x, y, vx, vy."""

QUEUE_COLUMNS = STATES + 8

OTHER, THE_PUCK = range(2)
DISCS = 2
FIRST_COLUMN = OTHER_PADDLE.start
"""The first column of the observation that a camera sees: the opponent's paddle's come first, then the puck's."""

MOMENT = 1e-9
"""Steps: differences in time that are rounding."""


class CameraArrays(NamedTuple):
    """A player's camera: what it is, and all that it keeps of N tables."""

    camera: NDArray[np.void]  # (1,) CAMERA
    states: NDArray[np.void]  # (N,) CAMERA_STATE
    queue: NDArray[np.float64]  # (N, length, QUEUE_COLUMNS): frames on their way
    past: NDArray[np.float64]  # (N, 2, frames, 3): time, x, y that estimates are made from, a ring for each disc


def make_camera(camera: Camera, num_tables: int, control_hz: float) -> CameraArrays:
    """A camera over so many tables, with room for all frames that can be on their way."""
    record = records(1, CAMERA)
    record["control_hz"] = control_hz
    record["camera_hz"] = control_hz if camera.camera_hz is None else camera.camera_hz
    record["delay"] = camera.delay_ms * 1e-3 * control_hz
    record["jitter"] = camera.jitter_ms * 1e-3 * control_hz
    record["noise"] = camera.opponent_noise_mm * 1e-3, camera.noise_mm * 1e-3
    record["dropout"] = camera.dropout
    record["occlusion"] = camera.occlusion_mm * 1e-3
    record["estimates"] = camera.velocity_frames is not None
    per_step = float(record["camera_hz"][0]) / control_hz
    length = math.floor((float(record["delay"][0] + record["jitter"][0]) + 1.0) * per_step) + 3
    return CameraArrays(
        record,
        records(num_tables, CAMERA_STATE),
        np.zeros((num_tables, length, QUEUE_COLUMNS)),
        np.zeros((num_tables, DISCS, camera.velocity_frames or 1, 3)),
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
def draw_normal(state):
    """A number from the normal distribution (Marsaglia and Tsang, "The ziggurat method", 2000)."""
    while True:
        u = draw(state) * _LAYERS
        layer = int(u)
        x = (2.0 * (u - layer) - 1.0) * _WIDTHS[layer]
        if abs(x) < _WIDTHS[layer + 1]:
            return x
        if layer == 0:
            while True:  # the tail
                a = -math.log(1.0 - draw(state)) / _EDGE
                b = -math.log(1.0 - draw(state))
                if 2.0 * b > a * a:
                    return math.copysign(_EDGE + a, x)
        y = _HEIGHTS[layer] + draw(state) * (_HEIGHTS[layer + 1] - _HEIGHTS[layer])
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
def blur(state, camera, disc, x, y):
    """A place as a frame shows it."""
    sigma = camera.noise[disc]
    if sigma > 0.0:
        x += sigma * draw_normal(state)
        y += sigma * draw_normal(state)
    return x, y


@inlined
def remember(state, past, disc, time, x, y):
    """Note a seen position."""
    k = state.next[disc]
    past[disc, k, 0] = time
    past[disc, k, 1] = x
    past[disc, k, 2] = y
    state.known[disc] = min(state.known[disc] + 1, past.shape[1])
    state.next[disc] = k + 1 if k + 1 < past.shape[1] else 0


@inlined
def slope(state, past, disc, tick):
    """Velocity, m/s, of the least-squares line through the remembered positions; 0 while there is only one."""
    n = state.known[disc]
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
    spread = tt - t * t / n
    if not spread > 0.0:
        return 0.0, 0.0
    return (tx - t * x / n) / (spread * tick), (ty - t * y / n) / (spread * tick)


@inlined
def take_frame(state, camera, queue, tick, time, now):
    """Take a frame at a time in the last control step and send it on its way. `now`: the true states at its end."""
    if state.waiting >= queue.shape[0]:  # which there is room for, unless a state was made up
        return
    if camera.dropout > 0.0 and draw(state) < camera.dropout:
        return
    share = time - (state.step - 1)
    then = state.true
    a, b = OTHER, THE_PUCK
    ox, oy, ovx, ovy = along(
        then[a, 0], then[a, 1], then[a, 2], then[a, 3], now[0], now[1], now[2], now[3], tick, share
    )
    x, y, vx, vy = along(then[b, 0], then[b, 1], then[b, 2], then[b, 3], now[4], now[5], now[6], now[7], tick, share)
    hidden = (x - ox) * (x - ox) + (y - oy) * (y - oy) < state.reach * state.reach
    ox, oy = blur(state, camera, OTHER, ox, oy)
    x, y = blur(state, camera, THE_PUCK, x, y)
    arrives = time + camera.delay
    if camera.jitter > 0.0:
        arrives += camera.jitter * (2.0 * draw(state) - 1.0)
    k = state.first + state.waiting
    if k >= queue.shape[0]:
        k -= queue.shape[0]
    state.waiting += 1
    queue[k, TAKEN], queue[k, ARRIVES], queue[k, SHOWS_PUCK] = time, arrives, 0.0 if hidden else 1.0
    s = STATES
    queue[k, s], queue[k, s + 1], queue[k, s + 2], queue[k, s + 3] = ox, oy, ovx, ovy
    queue[k, s + 4], queue[k, s + 5], queue[k, s + 6], queue[k, s + 7] = x, y, vx, vy


@inlined
def receive(state, camera, queue, past, tick):
    """Take in the frames that have arrived by now. A frame that would overtake another waits for it in the queue."""
    new_other, new_puck = False, False
    while state.waiting > 0 and queue[state.first, ARRIVES] <= state.step + MOMENT:
        k = state.first
        state.first = k + 1 if k + 1 < queue.shape[0] else 0
        state.waiting -= 1
        for disc in range(DISCS):
            if disc == THE_PUCK and queue[k, SHOWS_PUCK] == 0.0:
                continue
            for c in range(4):
                state.seen[disc, c] = queue[k, STATES + 4 * disc + c]
            if camera.estimates:
                remember(state, past, disc, queue[k, TAKEN], state.seen[disc, 0], state.seen[disc, 1])
            if disc == OTHER:
                new_other = True
            else:
                new_puck = True
    if camera.estimates:
        for disc in range(DISCS):
            if new_other if disc == OTHER else new_puck:
                state.seen[disc, 2], state.seen[disc, 3] = slope(state, past, disc, tick)


@inlined
def measure(state, camera, params):
    """Note the sizes of the table and the scales of its observations, which stay the same for an episode."""
    state.reach = camera.occlusion + params.radius[RIGHT] + params.radius[PUCK] if camera.occlusion > 0.0 else 0.0
    for disc in range(DISCS):
        per_speed = params.per_paddle if disc == OTHER else params.per_puck
        state.scale[disc, 0], state.scale[disc, 1] = params.per_x, params.per_y
        state.scale[disc, 2], state.scale[disc, 3] = per_speed, per_speed


@inlined
def look(state, observation, now):
    """The true states of the two discs, in m and m/s, from a player's exact observation."""
    for c in range(4 * DISCS):
        now[c] = observation[FIRST_COLUMN + c] * (1.0 / state.scale[c // 4, c % 4])


@inlined
def show(state, observation):
    """Put what the player knows in place of what is true."""
    for c in range(4 * DISCS):
        value = state.seen[c // 4, c % 4] * state.scale[c // 4, c % 4]
        observation[FIRST_COLUMN + c] = min(max(value, -1.0), 1.0)


@compiled
def start_episode(state, camera, queue, past, params, observation, now):
    """Begin an episode: its first frame is seen immediately and completely, and nothing of the last episode is kept."""
    queue[:] = 0.0
    past[:] = 0.0
    measure(state, camera, params)
    look(state, observation, now)
    state.step = 0
    state.frame = 1
    state.first = 0
    state.waiting = 0
    for disc in range(DISCS):
        state.known[disc] = 0
        state.next[disc] = 0
        for c in range(4):
            state.true[disc, c] = now[4 * disc + c]
            state.seen[disc, c] = now[4 * disc + c]
        x, y = blur(state, camera, disc, now[4 * disc], now[4 * disc + 1])
        state.seen[disc, 0], state.seen[disc, 1] = x, y
        if camera.estimates:
            remember(state, past, disc, 0.0, x, y)
            state.seen[disc, 2], state.seen[disc, 3] = 0.0, 0.0
    show(state, observation)


@compiled
def follow(state, camera, queue, past, observation, now):
    """Follow the game for one control step."""
    tick = 1.0 / camera.control_hz
    look(state, observation, now)
    state.step += 1
    time = state.frame * camera.control_hz / camera.camera_hz
    while time <= state.step + MOMENT:
        take_frame(state, camera, queue, tick, time, now)
        state.frame += 1
        time = state.frame * camera.control_hz / camera.camera_hz
    receive(state, camera, queue, past, tick)
    for c in range(4 * DISCS):
        state.true[c // 4, c % 4] = now[c]
    show(state, observation)


@compiled
def follow_rows(first, last, player, parameters, cameras, out):
    """Let a player's camera follow a step of the tables `first` to `last` (excluded), after `step_rows`.

    Args:
        player: LEFT or RIGHT.
        parameters: (1,) or (N,) `PARAMETERS`.
        cameras: `CameraArrays`; changed in place.
        out: `Outputs`: the player's observations are changed in place.
    """
    camera = cameras.camera[0]
    now = np.empty(4 * DISCS)
    for i in range(first, last):
        state, queue, past = cameras.states[i], cameras.queue[i], cameras.past[i]
        observation = out.observation[player, i]
        if not out.began[i]:
            follow(state, camera, queue, past, observation, now)
            continue
        if out.terminated[i] or out.truncated[i]:  # the end came in the same step
            follow(state, camera, queue, past, out.final_observation[player, i], now)
        start_episode(state, camera, queue, past, params_of(parameters, i), observation, now)


@compiled
def start_rows(rows, player, parameters, cameras, out):
    """Let a player's camera begin an episode on each of the given tables, after `reset_rows`."""
    camera = cameras.camera[0]
    now = np.empty(4 * DISCS)
    for k in range(rows.shape[0]):
        i = rows[k]
        state, queue, past = cameras.states[i], cameras.queue[i], cameras.past[i]
        start_episode(state, camera, queue, past, params_of(parameters, i), out.observation[player, i], now)


@compiled
def show_rows(rows, player, cameras, out):
    """Show what a player's camera has seen of each of the given tables, after `refresh_rows`."""
    for k in range(rows.shape[0]):
        show(cameras.states[rows[k]], out.observation[player, rows[k]])
