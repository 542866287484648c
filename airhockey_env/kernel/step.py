"""One step of the game as a recipe: for one table, and for the rows of a batch."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from airhockey_env.compiled import compiled, inlined
from airhockey_env.engine.advance import advance
from airhockey_env.engine.motion import glide
from airhockey_env.engine.records import Discs
from airhockey_env.engine.tolerances import GAME_CONTACTS
from airhockey_env.kernel.observations import observe
from airhockey_env.kernel.paddles import drive
from airhockey_env.kernel.parameters import draw_parameters, params_of
from airhockey_env.kernel.rewards import earn, potentials
from airhockey_env.kernel.rules import judge, place_puck, play_on
from airhockey_env.kernel.scripted import EXTERNAL, scripted_action
from airhockey_env.kernel.state import AUTORESET_NEXT_STEP, AUTORESET_SAME_STEP, LEFT, PUCK, RIGHT
from airhockey_env.kernel.tasks import end_task, start_task


class Result(NamedTuple):
    """What one step came to on one table; see `Outputs`."""

    point: int
    foul: bool
    left_reward: float
    right_reward: float
    terminated: bool
    truncated: bool
    success: bool
    n_contacts: int


ROOM = np.dtype([("hits", np.int32, (3,))])
"""Room for the engine to work in. It is a record, because numba counts the references to other arrays in every call."""


@inlined
def step_table(state, params, settings, left_x, left_y, right_x, right_y, contacts, hits):
    """Play one step of one table.

    Args:
        left_x, left_y, right_x, right_y: the players' actions, each as that player sees the table.
        contacts: (CONTACT_ROWS,) `CONTACT`; written.
        hits: (3,) int32, room for the engine's counts.
    """
    before = potentials(state, params, settings)
    drive(state, params, LEFT, left_x, left_y)
    drive(state, params, RIGHT, right_x, right_y)
    goal, n_contacts = play_tick(state, params, contacts, hits)
    point, foul = judge(state, params, goal)
    terminated, success = end_task(state, settings, point, foul)
    if not terminated:
        play_on(state, params, point, foul)
    left_reward, right_reward = earn(state, params, settings, point, terminated, before)
    state.steps += 1
    truncated = settings.max_steps > 0 and state.steps >= settings.max_steps and not terminated
    state.done = terminated or truncated
    return Result(point, foul, left_reward, right_reward, terminated, truncated, terminated and success, n_contacts)


@inlined
def play_tick(state, params, contacts, hits):
    """The paddles have their velocities: let the engine play one tick.

    Returns (side of the goal line that the puck crossed, or 0; number of contacts that were written).
    """
    discs = Discs(state.position, state.velocity, params.radius, params.inverse_mass, hits)
    for disc in range(3):
        hits[disc] = 0
    p, q, r, s = params.glide_p, params.glide_q, params.glide_r, params.glide_s
    glide(discs, PUCK, p, q, r, s, params.puck_speed)
    outcome = advance(discs, params, 0.0, params.tick, GAME_CONTACTS, contacts, False, None)
    glide(discs, PUCK, p, q, r, s, params.puck_speed)
    return outcome.goal, min(outcome.contacts, contacts.shape[0])


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
def action_of(state, params, player, driver, x, y):
    """A player's action: (x, y) of the caller or a policy, or that of the scripted player who drives this paddle."""
    if driver == EXTERNAL:
        return float(x), float(y)
    return scripted_action(state, params, player, driver)


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
    room = np.zeros(1, ROOM)
    for i in range(first, last):
        state, params, hits = states[i], parameters[i if parameters.shape[0] > 1 else 0], room[0].hits
        if state.done and settings.autoreset == AUTORESET_NEXT_STEP:
            begin(state, params, settings, ranges, 0)
            forget_step(out, i)
            out.began[i] = True
        else:
            left_x, left_y = action_of(state, params, LEFT, drivers[LEFT, i], left_actions[i, 0], left_actions[i, 1])
            right_x, right_y = action_of(
                state, params, RIGHT, drivers[RIGHT, i], right_actions[i, 0], right_actions[i, 1]
            )
            result = step_table(
                state, params, settings, left_x, left_y, right_x, right_y, out.contacts[i], hits
            )  # fmt: skip
            out.point[i] = result.point
            out.foul[i] = result.foul
            out.success[i] = result.success
            out.reward[LEFT, i] = result.left_reward
            out.reward[RIGHT, i] = result.right_reward
            out.terminated[i] = result.terminated
            out.truncated[i] = result.truncated
            out.n_contacts[i] = result.n_contacts
            out.began[i] = False
            if state.done and settings.autoreset == AUTORESET_SAME_STEP:
                keep_final(state, params, settings, out, i)
                begin(state, params, settings, ranges, 0)
                out.began[i] = True
        observe_table(state, params, settings, out, i)


@inlined
def report(result, out, i):
    """Write the result of a step of table i."""
    out.point[i] = result.point
    out.foul[i] = result.foul
    out.success[i] = result.success
    out.reward[LEFT, i] = result.left_reward
    out.reward[RIGHT, i] = result.right_reward
    out.terminated[i] = result.terminated
    out.truncated[i] = result.truncated
    out.n_contacts[i] = result.n_contacts


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
    if settings.observed[LEFT]:
        observe(state, params, LEFT, out.final_observation, i)
    if settings.observed[RIGHT]:
        observe(state, params, RIGHT, out.final_observation, i)
    out.final_score[i, 0], out.final_score[i, 1] = state.score[0], state.score[1]
    if settings.randomized:
        out.final_spec[i, :] = params.spec


@inlined
def observe_table(state, params, settings, out, i):
    """Write what table i looks like: the observations of its players, and its score."""
    if settings.observed[LEFT]:
        observe(state, params, LEFT, out.observation, i)
    if settings.observed[RIGHT]:
        observe(state, params, RIGHT, out.observation, i)
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
