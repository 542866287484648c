"""One step of the game as a recipe: its passes over the tables of a block, one after the other; see `block`."""

from __future__ import annotations

from airhockey_env.compiled import compiled, inlined
from airhockey_env.engine.advance import advance
from airhockey_env.engine.kiss import kiss_time, reaches_edge
from airhockey_env.engine.motion import glide
from airhockey_env.engine.records import Discs
from airhockey_env.engine.tolerances import GAME_CONTACTS
from airhockey_env.kernel.block import (
    TABLES,
    load_discs,
    load_pair,
    load_params,
    load_shared_params,
    params_at,
    room_for_block,
    store_discs,
)
from airhockey_env.kernel.observations import observe, view_at
from airhockey_env.kernel.paddles import drive
from airhockey_env.kernel.parameters import draw_parameters, params_of
from airhockey_env.kernel.rewards import potential, shaping
from airhockey_env.kernel.rules import give, judge, place_puck, play_on
from airhockey_env.kernel.scripted import choose
from airhockey_env.kernel.state import AUTORESET_NEXT_STEP, AUTORESET_SAME_STEP, LEFT, PUCK, RIGHT
from airhockey_env.kernel.tasks import Puck, end_task, start_task


@compiled
def step_rows(
    first, last, states, parameters, game_settings, ranges, drivers, left_actions, right_actions, out
):  # fmt: skip
    """Play one step of the tables `first` to `last` (excluded).

    Args:
        states: (N,) `STATE`; changed in place.
        parameters: (1,) or (N,) `PARAMETERS`.
        game_settings: (1,) `SETTINGS`.
        ranges: of the parameters, where the settings say that they are randomized; see `draw_parameters`.
        drivers: (2, N) int8, which scripted player drives each paddle, or EXTERNAL.
        left_actions, right_actions: (N, 2) float32; read where the driver is EXTERNAL.
        out: `Outputs`; written in place.
    """
    settings = game_settings[0]
    room = room_for_block()
    if parameters.shape[0] == 1:
        load_shared_params(room[0], min(TABLES, last - first), parameters[0])
    for at in range(first, last, TABLES):
        block, n = room[0], min(TABLES, last - at)  # in the loop, which keeps the room: see room_for_block
        load(block, n, at, states, parameters, settings)
        choose(block, n, at, LEFT, states, drivers, left_actions)
        choose(block, n, at, RIGHT, states, drivers, right_actions)
        keep_potentials(block, n, settings)
        drive_paddles(block, n)
        glide_pucks(block, n)
        find_quiet(block, n)
        fly_quiet(block, n)
        play_contacts(block, n, at, states, parameters, out.contacts)
        glide_pucks(block, n)
        judge_tables(block, n, settings)
        serve_again(block, n, at, states, parameters)
        earn(block, n, settings)
        store(block, n, at, states)
        report(block, n, at, out)
        end_episodes(block, n, at, states, parameters, settings, ranges, out)
        observe_rows(at, at + n, states, parameters, settings, out)


@compiled
def load(block, n, first, states, parameters, settings):
    """Copy n tables from number `first` on to the block."""
    for k in range(0, n - 1, 2):
        load_pair(block, k, states[first + k], states[first + k + 1])
    if n % 2:
        load_pair(block, n - 1, states[first + n - 1], states[first + n - 1])
    begins = 1 if settings.autoreset == AUTORESET_NEXT_STEP else 0
    for k in range(n):
        block.begins[k] = begins & block.done[k]
    if parameters.shape[0] > 1:
        for k in range(n):
            load_params(block, k, parameters[first + k])


@compiled
def keep_potentials(block, n, settings):
    """Note the potentials that the shaping terms of this step start from."""
    for player in (LEFT, RIGHT):
        if settings.shaped and settings.observed[player]:
            for k in range(n):
                block.before[player, k] = potential(view_at(block, k, player), params_at(block, k), player)


@compiled
def drive_paddles(block, n):
    """Give the paddles their velocities for the tick."""
    drive_paddle(block, n, LEFT)
    drive_paddle(block, n, RIGHT)


@inlined
def drive_paddle(block, n, player):
    """Give one player's paddles their velocities."""
    p, v, a = block.position, block.velocity, block.action
    for k in range(n):
        x, y, vx, vy = p[player, 0, k], p[player, 1, k], v[player, 0, k], v[player, 1, k]
        ax, ay = a[player, 0, k], a[player, 1, k]
        vx, vy = drive(x, y, vx, vy, ax, ay, block.radius[player, k], player, params_at(block, k))
        v[player, 0, k] = vx
        v[player, 1, k] = vy


@compiled
def glide_pucks(block, n):
    """Slow the pucks down by half a tick of glide."""
    v = block.velocity
    for k in range(n):
        params = params_at(block, k)
        p, q, r, s = params.glide_p, params.glide_q, params.glide_r, params.glide_s
        vx, vy = glide(v[PUCK, 0, k], v[PUCK, 1, k], p, q, r, s, params.puck_speed)
        v[PUCK, 0, k] = vx
        v[PUCK, 1, k] = vy


@inlined
def meets(block, k, player):
    """Whether a player's paddle and the puck touch in this tick."""
    p, v = block.position, block.velocity
    dx, dy = p[player, 0, k] - p[PUCK, 0, k], p[player, 1, k] - p[PUCK, 1, k]
    dvx, dvy = v[player, 0, k] - v[PUCK, 0, k], v[player, 1, k] - v[PUCK, 1, k]
    return kiss_time(dx, dy, dvx, dvy, block.radius[player, k] + block.radius[PUCK, k]) < block.tick[k]


@compiled
def find_quiet(block, n):
    """Find out on which tables nothing touches anything in this tick: where `next_kiss` would find nothing."""
    p, v = block.position, block.velocity
    for k in range(n):
        x, y, vx, vy = p[PUCK, 0, k], p[PUCK, 1, k], v[PUCK, 0, k], v[PUCK, 1, k]
        edge = reaches_edge(x, y, vx, vy, block.radius[PUCK, k], params_at(block, k), block.tick[k])
        left, right = meets(block, k, LEFT), meets(block, k, RIGHT)
        block.quiet[k] = 0 if edge or left or right else 1


@compiled
def fly_quiet(block, n):
    """Where nothing touches anything, the tick is one straight flight."""
    p, v = block.position, block.velocity
    for disc in (LEFT, RIGHT, PUCK):
        for axis in range(2):
            for k in range(n):
                there = p[disc, axis, k] + v[disc, axis, k] * block.tick[k]
                p[disc, axis, k] = there if block.quiet[k] else p[disc, axis, k]


@compiled
def play_contacts(block, n, first, states, parameters, contacts):
    """Let the engine play the tick on the other tables; note who scored, and how many contacts there were."""
    hits = block.hits
    for k in range(n):
        block.point[k] = 0
        block.n_contacts[k] = 0
    for k in range(n):
        if not block.quiet[k] and not block.begins[k]:
            state, params = states[first + k], params_of(parameters, first + k)
            store_discs(block, k, state)
            for disc in range(3):
                hits[disc] = 0
            discs = Discs(state.position, state.velocity, params.radius, params.inverse_mass, hits)
            room = contacts[first + k]
            outcome = advance(discs, params, 0.0, params.tick, GAME_CONTACTS, room, False, None)
            load_discs(block, k, state)
            block.point[k] = outcome.goal
            block.n_contacts[k] = min(outcome.contacts, room.shape[0])


@compiled
def judge_tables(block, n, settings):
    """Keep the scores and clocks, and see which episodes are over."""
    task, points, max_steps = settings.task, settings.points, settings.max_steps
    for k in range(n):
        point = block.point[k]
        left = block.score[LEFT, k] + (1 if point > 0 else 0)
        right = block.score[RIGHT, k] + (1 if point < 0 else 0)
        x, vx, vy = block.position[PUCK, 0, k], block.velocity[PUCK, 0, k], block.velocity[PUCK, 1, k]
        side, clock, crossed, foul = judge(point, x, block.side[k], block.clock[k], block.clock_limit[k])
        terminated, success = end_task(task, points, (left, right), Puck(x, vx, vy, side), point, foul)
        steps = block.steps[k] + 1
        block.score[LEFT, k] = left
        block.score[RIGHT, k] = right
        block.side[k] = side
        block.clock[k] = clock
        block.steps[k] = steps
        block.crossed[k] = 1 if crossed else 0
        block.foul[k] = 1 if foul else 0
        block.terminated[k] = 1 if terminated else 0
        block.truncated[k] = 1 if max_steps > 0 and steps >= max_steps and not terminated else 0
        block.success[k] = 1 if terminated and success else 0


@compiled
def serve_again(block, n, first, states, parameters):
    """Where the puck came to the other side, its plan is drawn; after a point or a foul there is a serve."""
    for k in range(n):
        if (block.crossed[k] or block.foul[k] or block.point[k]) and not block.begins[k]:
            state = states[first + k]
            if block.crossed[k]:
                give(state, block.side[k])
            elif not block.terminated[k]:
                state.side = block.side[k]
                play_on(state, params_of(parameters, first + k), block.point[k], block.foul[k] != 0)
                load_discs(block, k, state)
                block.side[k] = state.side
                block.clock[k] = state.clock


@compiled
def earn(block, n, settings):
    """Work out the rewards."""
    for k in range(n):
        block.reward[LEFT, k] = float(block.point[k])
        block.reward[RIGHT, k] = float(-block.point[k])  # a whole number has no -0
    for player in (LEFT, RIGHT):
        if settings.shaped and settings.observed[player]:
            for k in range(n):
                after = potential(view_at(block, k, player), params_at(block, k), player)
                block.reward[player, k] += shaping(block.before[player, k], after, block.terminated[k] != 0)


@compiled
def store(block, n, first, states):
    """Copy the tables of the block back."""
    for k in range(n):
        state = states[first + k]
        store_discs(block, k, state)
        for player in range(2):
            state.score[player] = block.score[player, k]
        state.steps = block.steps[k]
        state.clock = block.clock[k]
        state.side = block.side[k]
        state.done = block.terminated[k] + block.truncated[k]


@inlined
def report(block, n, first, out):
    """Write what the step came to."""
    for player in (LEFT, RIGHT):
        column = out.reward[player, first : first + n]
        for k in range(n):
            column[k] = block.reward[player, k]
    _report(block.point, out.point, n, first)
    _report(block.n_contacts, out.n_contacts, n, first)
    _report(block.foul, out.foul, n, first)
    _report(block.success, out.success, n, first)
    _report(block.terminated, out.terminated, n, first)
    _report(block.truncated, out.truncated, n, first)


@inlined
def _report(column, out, n, first):
    rows = out[first : first + n]
    for k in range(n):
        rows[k] = column[k]


@inlined
def end_episodes(block, n, first, states, parameters, settings, ranges, out):
    """Begin the next episode where one was over before this step, or is over and another begins in the same one."""
    began = out.began[first : first + n]
    for k in range(n):
        over = (
            block.terminated[k] + block.truncated[k] if settings.autoreset == AUTORESET_SAME_STEP else block.begins[k]
        )
        began[k] = over != 0
    for k in range(n):
        if began[k]:
            i = first + k
            state, params = states[i], params_of(parameters, i)
            if settings.autoreset == AUTORESET_SAME_STEP:
                keep_final(state, params, settings, out, i)
            else:
                forget_step(out, i)
            begin(state, params, settings, ranges, 0)


@inlined
def observe_rows(first, last, states, parameters, settings, out):
    """Write what tables look like."""
    for i in range(first, last):
        observe_table(states[i], params_of(parameters, i), settings, out, i)


@inlined
def begin(state, params, settings, ranges, side):
    """Start the table's next episode; where the task begins with a serve, by `side` (0: drawn at random)."""
    state.steps = 0
    state.score[0] = 0
    state.score[1] = 0
    state.done = False
    for player in (LEFT, RIGHT):
        state.wander[player, 0] = 0.0
        state.wander[player, 1] = 0.0
    if settings.randomized:
        draw_parameters(state, params, ranges)
    start_task(state, params, settings.task, side)


@inlined
def forget_step(out, i):
    """Nothing has happened on table i since its episode began, or since its state was set."""
    out.point[i] = 0
    out.foul[i] = False
    out.success[i] = False
    out.reward[LEFT, i] = 0.0
    out.reward[RIGHT, i] = 0.0
    out.terminated[i] = False
    out.truncated[i] = False
    out.n_contacts[i] = 0


@inlined
def keep_final(state, params, settings, out, i):
    """Keep what the end of an episode looked like, which is about to be replaced by the next one's beginning."""
    for player in (LEFT, RIGHT):
        if settings.observed[player]:
            observe(state, params, player, out.final_observation, i)
    out.final_score[i, 0], out.final_score[i, 1] = state.score[0], state.score[1]
    if settings.randomized:
        for k in range(params.spec.shape[0]):  # assigning a slice would take seconds to compile
            out.final_spec[i, k] = params.spec[k]


@inlined
def observe_table(state, params, settings, out, i):
    """Write what table i looks like: the observations of its players, and its score."""
    for player in (LEFT, RIGHT):
        if settings.observed[player]:
            observe(state, params, player, out.observation, i)
    out.score[i, 0], out.score[i, 1] = state.score[0], state.score[1]


@compiled
def reset_rows(rows, sides, puck, states, parameters, game_settings, ranges, out):
    """Begin an episode on each of the given tables, with a serve by `sides[k]` (0: drawn at random).

    Args:
        rows: (n,) int64, numbers of tables.
        sides: (n,) int64.
        puck: (5,), where the puck begins in place of where the task puts it; see `place_puck`.
        states, parameters, game_settings, ranges, out: as in `step_rows`.
    """
    settings = game_settings[0]
    for k in range(rows.shape[0]):
        i = rows[k]
        state, params = states[i], params_of(parameters, i)
        begin(state, params, settings, ranges, sides[k])
        place_puck(state, params, puck)
        forget_step(out, i)
        out.began[i] = True
        observe_table(state, params, settings, out, i)


@compiled
def refresh_rows(rows, states, parameters, game_settings, out):
    """Bring the outputs of the given tables up to date after their states were changed from outside."""
    settings = game_settings[0]
    for k in range(rows.shape[0]):
        i = rows[k]
        observe_table(states[i], params_of(parameters, i), settings, out, i)
