"""What a camera does in a control step, compiled: frames are taken, travel, arrive, and positions become velocities.

It stands between a player's exact observation and the player, and overwrites what the player cannot know exactly: the
columns of the opponent's paddle and of the puck. Times are in control steps since the start of the episode.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.cameras import FIELDS, Camera
from airhockey_env.compiled import compiled, inlined, records
from airhockey_env.kernel.normal import draw_normal
from airhockey_env.kernel.observations import OTHER_PADDLE
from airhockey_env.kernel.parameters import params_of
from airhockey_env.kernel.random_stream import draw, draw_between
from airhockey_env.kernel.state import PUCK, RIGHT

(CAMERA_HZ, DELAY_MS, JITTER_MS, NOISE_MM, OPPONENT_NOISE_MM, VELOCITY_FRAMES, DROPOUT, OCCLUSION_MM) = range(
    len(FIELDS)
)

CAMERA = np.dtype(
    [
        ("spec", np.float64, (len(FIELDS),)),  # the Camera's fields in their order; all else follows from these
        ("control_hz", np.float64),
        ("camera_hz", np.float64),
        ("delay", np.float64),  # steps
        ("jitter", np.float64),  # steps
        ("noise", np.float64, (2,)),  # m: opponent's paddle, puck
        ("dropout", np.float64),
        ("occlusion", np.float64),  # m
        ("frames", np.int64),  # from whose positions velocities are estimated; 0: they are true
    ],
    align=True,
)
"""A `Camera` at a control rate. A rate of frames that is None is that of the control steps, and no estimates are 0."""

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

    camera: NDArray[np.void]  # (1,) CAMERA, or (N,) if it is drawn for every episode
    ranges: NDArray[np.float64]  # (len(FIELDS), 2) least and greatest values of its spec, or (0, 2) if none is drawn
    states: NDArray[np.void]  # (N,) CAMERA_STATE
    queue: NDArray[np.float64]  # (N, length, QUEUE_COLUMNS): frames on their way
    past: NDArray[np.float64]  # (N, 2, frames, 3): time, x, y that estimates are made from, a ring for each disc


@compiled
def derive(camera):
    """Work out everything in a `CAMERA` record from its `spec` and `control_hz`."""
    spec, control_hz = camera.spec, camera.control_hz
    camera.camera_hz = spec[CAMERA_HZ]
    camera.delay = spec[DELAY_MS] * 1e-3 * control_hz
    camera.jitter = min(spec[JITTER_MS], spec[DELAY_MS]) * 1e-3 * control_hz
    camera.noise[OTHER] = spec[OPPONENT_NOISE_MM] * 1e-3
    camera.noise[THE_PUCK] = spec[NOISE_MM] * 1e-3
    camera.dropout = spec[DROPOUT]
    camera.occlusion = spec[OCCLUSION_MM] * 1e-3
    camera.frames = np.int64(spec[VELOCITY_FRAMES])


@compiled
def derive_rows(cameras):
    """Work out the same for `CAMERA` records (n,)."""
    for i in range(cameras.shape[0]):
        derive(cameras[i])


@compiled
def draw_camera(state, camera, ranges):
    """Draw what has a range of a table's camera, from the camera's own stream.

    Args:
        ranges: (len(FIELDS), 2) least and greatest values; equal ones draw nothing.
    """
    for k in range(ranges.shape[0]):
        low, high = ranges[k, 0], ranges[k, 1]
        if low < high:
            if k == VELOCITY_FRAMES:
                camera.spec[k] = min(math.floor(draw_between(state, low, high + 1.0)), high)
            else:
                camera.spec[k] = draw_between(state, low, high)
    derive(camera)


@inlined
def camera_of(cameras, i):
    """The record of table i."""
    return cameras.camera[i if cameras.camera.shape[0] > 1 else 0]


def make_camera(camera: Camera, num_tables: int, control_hz: float) -> CameraArrays:
    """A camera over so many tables, with room for all frames that can be on their way."""
    ends = camera.ends()
    for name, instead in (("camera_hz", control_hz), ("velocity_frames", 0)):
        ends[name] = (instead, instead) if None in ends[name] else ends[name]
    ranges = np.array([ends[name] for name in FIELDS], np.float64)
    drawn = bool((ranges[:, 0] < ranges[:, 1]).any())
    record, widest = (records(1, CAMERA) for _ in range(2))
    for one, spec in ((record, ranges[:, 0]), (widest, ranges[:, 1])):
        one["spec"], one["control_hz"] = spec, control_hz
        derive_rows(one)
    per_step = float(widest["camera_hz"][0]) / control_hz
    length = math.floor((float(widest["delay"][0] + widest["jitter"][0]) + 1.0) * per_step) + 3
    return CameraArrays(
        np.repeat(record, num_tables) if drawn else record,
        ranges if drawn else ranges[:0],
        records(num_tables, CAMERA_STATE),
        np.zeros((num_tables, length, QUEUE_COLUMNS)),
        np.zeros((num_tables, DISCS, max(int(widest["frames"][0]), 1), 3)),
    )


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
def remember(state, camera, past, disc, time, x, y):
    """Note a seen position."""
    k = state.next[disc]
    past[disc, k, 0] = time
    past[disc, k, 1] = x
    past[disc, k, 2] = y
    state.known[disc] = min(state.known[disc] + 1, camera.frames)
    state.next[disc] = k + 1 if k + 1 < camera.frames else 0


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
            if camera.frames:
                remember(state, camera, past, disc, queue[k, TAKEN], state.seen[disc, 0], state.seen[disc, 1])
            if disc == OTHER:
                new_other = True
            else:
                new_puck = True
    if camera.frames:
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
def start_episode(state, camera, ranges, queue, past, params, observation, now):
    """Begin an episode: its first frame is seen immediately and completely, and nothing of the last episode is kept."""
    if ranges.shape[0] > 0:
        draw_camera(state, camera, ranges)
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
        if camera.frames:
            remember(state, camera, past, disc, 0.0, x, y)
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
    now = np.empty(4 * DISCS)
    for i in range(first, last):
        camera = camera_of(cameras, i)
        state, queue, past = cameras.states[i], cameras.queue[i], cameras.past[i]
        observation = out.observation[player, i]
        if not out.began[i]:
            follow(state, camera, queue, past, observation, now)
            continue
        if out.terminated[i] or out.truncated[i]:  # the end came in the same step
            follow(state, camera, queue, past, out.final_observation[player, i], now)
        start_episode(state, camera, cameras.ranges, queue, past, params_of(parameters, i), observation, now)


@compiled
def start_rows(rows, player, parameters, cameras, out):
    """Let a player's camera begin an episode on each of the given tables, after `reset_rows`."""
    now = np.empty(4 * DISCS)
    for k in range(rows.shape[0]):
        i = rows[k]
        camera, observation = camera_of(cameras, i), out.observation[player, i]
        state, queue, past = cameras.states[i], cameras.queue[i], cameras.past[i]
        start_episode(state, camera, cameras.ranges, queue, past, params_of(parameters, i), observation, now)


@compiled
def show_rows(rows, player, cameras, out):
    """Show what a player's camera has seen of each of the given tables, after `refresh_rows`."""
    for k in range(rows.shape[0]):
        show(cameras.states[rows[k]], out.observation[player, rows[k]])
