"""Hostile play, compiled: two paddles that do to the puck what no fair player would, with all laws checked."""

from __future__ import annotations

import hashlib
from typing import NamedTuple

import numpy as np

from airhockey_env.compiled import records
from airhockey_env.game import Game
from airhockey_env.kernel.parameters import params_of, spec_of
from airhockey_env.kernel.random_stream import draw
from airhockey_env.kernel.state import LEFT, OBSERVATION_SIZE, RIGHT, STATE
from airhockey_env.kernel.step import begin, step_rows
from airhockey_env.replay import arguments_of
from airhockey_env.saved_states import state_dtype
from tests.torture.cases import Case, encode_state
from tests.torture.compiled_here import compiled_here
from tests.torture.laws import (
    DRAWN,
    FAILURES,
    FINE,
    POINTS,
    RANGES,
    check_step,
    in_ranges,
    new_tally,
)
from tests.torture.players import MODES, ambush, hostile_action
from tests.torture.tables import RANDOMIZED, table_of

EPISODE = 200
"""Steps after which a randomized episode ends at the latest; 3 points end it too."""


class Report(NamedTuple):
    """What a run of hostile play came to."""

    steps: int
    worst: float  # m, the deepest overlap seen, of whatever kind
    paddle_contacts: int
    edge_contacts: int
    crowded: int  # steps with as many contacts as are kept, or more
    pinned: int  # steps that ended with the puck touching a paddle and an edge
    points: int
    drawn: int  # tables that `randomize` drew
    digest: str  # of all tables at the end
    case: Case | None  # what reproduces the failure, if there was one

    @property
    def failure(self) -> str:
        """The law that was broken, or "" if none was."""
        return "" if self.case is None else self.case.law


@compiled_here
def _end(state, tally):
    """Keep the score of an episode."""
    tally[POINTS] += state.score[0] + state.score[1]
    state.score[0] = 0
    state.score[1] = 0


@compiled_here
def _play(states, parameters, game_settings, ranges, drivers, out, modes, whims, steps, before, actions, tally):
    """Play hostile steps on every table; stops at the first failure.

    Args:
        before: (N,) `STATE`, those before the last step at the end.
        actions: (2, N, 2) float32, as a caller of the game gives them; those of the last step at the end.

    Returns the number of the failure and of the table.
    """
    room = np.zeros((2, 1, OBSERVATION_SIZE), np.float32)
    settings = game_settings[0]
    n = states.shape[0]
    for step in range(steps):
        for i in range(n):
            state, params = states[i], params_of(parameters, i)
            if settings.randomized and (step == 0 or state.done):
                _end(state, tally)
                before[i] = state
                begin(state, params, settings, ranges, 0)
                tally[DRAWN] += 1
                if not in_ranges(params, ranges):
                    return RANGES, i
            for player in (LEFT, RIGHT):
                if draw(state) < 0.03:
                    modes[i, player] = int(MODES * draw(state))
                    whims[i, player] = draw(state)
                ax, ay = hostile_action(state, params, player, modes[i, player], whims[i, player])
                actions[player, i, 0], actions[player, i, 1] = ax, ay
            if draw(state) < 0.01:
                ambush(state, params)
            before[i] = state
        step_rows(0, n, states, parameters, game_settings, ranges, drivers, actions[LEFT], actions[RIGHT], out)
        for i in range(n):
            told = out.reward[LEFT, i], out.terminated[i], out.truncated[i]
            kept = out.contacts[i], out.n_contacts[i]
            failure = check_step(
                before[i], states[i], params_of(parameters, i), settings, *kept, *told, room, tally
            )  # fmt: skip
            if failure != FINE:
                return failure, i
    for i in range(n):
        _end(states[i], tally)
    return FINE, 0


def play_hostile(name: str, control_hz: float, steps: int, seed: int, tables: int = 16) -> Report:
    """At least `steps` hostile steps on a table of `TABLES` at a control rate, spread over `tables` games."""
    arguments = table_of(name, seed, control_hz)
    if name == RANDOMIZED:
        arguments |= {"points": 3, "max_episode_steps": EPISODE}
    else:
        arguments |= {"points": 2**30}  # one episode
    game = Game(tables, task="match", control_hz=control_hz, right=None, autoreset_mode="Disabled", **arguments)
    game.reset(seed * tables)
    each = -(-steps // tables)
    before, actions, tally = records(tables, STATE), np.zeros((2, tables, 2), np.float32), new_tally()
    modes, whims = np.zeros((tables, 2), np.int64), np.zeros((tables, 2))
    fixed = (game.states, game.parameters, game.settings, game.ranges, game._drivers, game.out)
    number, i = _play(*fixed, modes, whims, each, before, actions, tally)
    case = None
    if number != FINE:
        case = _case_of(game, number, i, before[i : i + 1], actions[:, i])
    else:
        for params in game.parameters:
            spec_of(params)  # raises an error if it is no table
    digest = hashlib.sha256(game.states.tobytes() + tally.tobytes()).hexdigest()[:32]
    worst, *counts = tally.tolist()
    paddle, edge, crowded, pinned, points, drawn = map(int, counts)
    return Report(each * tables, worst, paddle, edge, crowded, pinned, points, drawn, digest, case)


def _case_of(game: Game, number: int, i: int, before: np.ndarray, actions: np.ndarray) -> Case:
    """The one step, or start of an episode, in which table i broke a law."""
    state = before
    if game.randomized:
        state = np.zeros(1, state_dtype(True, None))
        state["state"], state["parameters"] = before, game.parameters[i]
    step = {"do": "step", "actions": actions[:1].tolist(), "others": actions[1:].tolist()}
    last = {"do": "reset"} if number == RANGES else step
    operations = [{"do": "state", "state": encode_state(state)}, last]
    return Case("game", arguments_of(game), operations, FAILURES[number])
