"""The opponents: what they may do, how strong they are, and what a callable one sees."""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
import pytest

from airhockey_env import PRESETS, AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.compiled import records
from airhockey_env.game import Game
from airhockey_env.kernel.block import BLOCK, TABLES, load_shared_params
from airhockey_env.kernel.observations import observe
from airhockey_env.kernel.scripted import EXTERNAL, SCRIPTED, choose
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.kernel.step import load
from tests.helpers import pursue, random_actions

LIMIT = 1500


class Duel(NamedTuple):
    """Shares of the points of a duel, for the left player."""

    wins: float
    losses: float
    draws: float


@functools.cache
def duel(left: str, right: str, table: str = "full_size", points: int = 600, skill: float = 1.0) -> Duel:
    """Two scripted players against each other, one point a table; `skill` is the right one's. Seeds are fixed."""
    game = Game(points, table=table, left=left, right=right, right_skill=skill, max_episode_steps=LIMIT)
    game.reset(seed=0)
    result = np.zeros(points)
    for _ in range(LIMIT):
        game.states["done"] = False  # tables that are over go on, and are not looked at any more
        game.step()
        ended = game.out.terminated & (result == 0.0)
        result[ended] = game.out.point[ended]
        if result.all():
            break
    return Duel((result > 0.0).mean(), (result < 0.0).mean(), (result == 0.0).mean())


def test_scripted_players_are_the_documented_ones():
    assert {"idle", "random", "goalie", "striker"} <= set(SCRIPTED)
    assert EXTERNAL not in SCRIPTED.values()


def actions_of(game, name):
    """The actions (N, 2) of a scripted player who drove all right paddles of the game as it is."""
    n, states, block = game.num_tables, game.states.copy(), records(1, BLOCK)[0]
    drivers, unused = np.full((2, n), SCRIPTED[name], np.int8), np.zeros((n, 2), np.float32)
    if len(game.parameters) == 1:
        load_shared_params(block, TABLES, game.parameters[0])
    actions = []
    for first in range(0, n, TABLES):
        some = min(TABLES, n - first)
        load(block, some, first, states, game.parameters, game.settings[0])
        choose(block, some, first, RIGHT, states, drivers, unused)
        actions.append(block["action"][RIGHT, :, :some].T.copy())
    return np.concatenate(actions)


@pytest.mark.parametrize("name", sorted(SCRIPTED))
@pytest.mark.parametrize("table", PRESETS)
@pytest.mark.parametrize("skill", [0.0, 0.4, 1.0])
def test_actions_are_in_range(name, table, skill):
    """A finite action no longer than the skill, from whatever state; all of it is used at times."""
    game = Game(200, table=table, right=name, right_skill=skill, max_episode_steps=200)
    game.reset(seed=0)
    longest, drawn = 0.0, random_actions(1, 120, 200)
    for step in range(120):
        chase = pursue(game.out.observation[LEFT]).astype(np.float32)
        game.step(np.where(np.arange(200)[:, None] % 2 == 0, chase, drawn[step]))
        if step % 10 == 0:
            actions = actions_of(game, name)
            assert np.isfinite(actions).all()
            longest = max(longest, np.hypot(*actions.T).max())
    assert longest <= skill * (1.0 + 1e-12)
    # A goalie has no way to go on which it could become fast, and brake.
    assert longest >= (0.3 if name == "goalie" else 0.5) * skill or name == "idle"
    assert longest == 0.0 or name != "idle"


@pytest.mark.parametrize("table", ["full_size", "challenge"])
def test_striker_beats_goalie_and_random(table):
    goalie, random = duel("striker", "goalie", table), duel("striker", "random", table)
    assert goalie.wins > 2.5 * goalie.losses and goalie.wins > 0.4
    assert random.wins > 10.0 * random.losses and random.wins > 0.9


def test_striker_beats_goalie_and_random_on_a_table_without_losses():
    """There the puck never slows down, and luck decides more."""
    goalie, random = duel("striker", "goalie", "ideal"), duel("striker", "random", "ideal")
    assert goalie.wins > goalie.losses + 0.08
    assert random.wins > 3.0 * random.losses


@pytest.mark.parametrize("table", PRESETS)
def test_goalie_beats_random(table):
    result = duel("goalie", "random", table)
    assert result.wins > 1.3 * result.losses and result.wins > result.losses + 0.08


@pytest.mark.parametrize("table", ["full_size", "challenge"])
def test_two_strikers_are_a_fair_and_lively_game(table):
    result = duel("striker", "striker", table, points=3000)
    assert result.draws < 0.2
    assert abs(result.wins - result.losses) < 4.0 / 3000**0.5  # neither side of the table is the better one


@pytest.mark.parametrize("table", ["full_size", "challenge"])
def test_striker_scores_few_own_goals(table):
    result = duel("striker", "idle", table)  # who never shoots
    assert result.losses < 0.08 and result.wins > 0.85


@pytest.mark.parametrize("name", ["random", "goalie", "striker"])
def test_skill_0_freezes_a_player(name):
    env = AirHockeyEnv(opponent=name, opponent_skill=0.0)
    env.reset(seed=1)
    home = env.positions[RIGHT]
    for actions in random_actions(1, 200, 1):
        over = env.step(actions[0])[2]
        if over:
            env.reset()
        assert (env.positions[RIGHT] == home).all() and (env.velocities[RIGHT] == 0.0).all()


@pytest.mark.parametrize("name", ["random", "goalie", "striker"])
def test_skill_limits_speed(name):
    fastest = []
    for skill in (0.2, 0.6, 1.0):
        envs = AirHockeyVectorEnv(50, opponent=name, opponent_skill=skill)
        envs.reset(seed=1)
        speeds = []
        for actions in random_actions(1, 300, 50):
            envs.step(actions)
            speeds.append(np.linalg.norm(envs.velocities[:, RIGHT], axis=1).max())
        fastest.append(max(speeds))
        assert fastest[-1] <= skill * envs.table.paddle_speed * (1.0 + 1e-9)
    assert fastest[0] < fastest[1] < fastest[2] + 1e-9


def test_little_skill_is_weak():
    assert duel("striker", "striker", skill=0.2).wins > 0.8


# Opponents from outside


@pytest.mark.parametrize("num_envs", [1, 5])
def test_what_a_callable_sees_and_does(num_envs):
    seen = []

    def opponent(observations):
        assert type(observations) is np.ndarray and observations.dtype == np.float32
        assert observations.shape == (num_envs, 13)
        assert not observations.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            observations[0, 0] = 0.0
        seen.append(observations.copy())
        return pursue(observations)

    envs = AirHockeyVectorEnv(num_envs, opponent=opponent)
    envs.reset(seed=4)
    for step, actions in enumerate(random_actions(3, 150, num_envs)):
        before, places = envs.get_state(), envs.positions
        envs.step(actions)
        assert len(seen) == step + 1  # asked once a step, for all tables
        expected = np.zeros((2, num_envs, 13), np.float32)
        for i in range(num_envs):
            observe(before[i], envs._game.parameters[0], RIGHT, expected, i)
        assert (seen[-1] == expected[RIGHT]).all()
        np.testing.assert_allclose(seen[-1][:, 8] * envs.table.length, -2.0 * places[:, PUCK, 0], atol=1e-6)


def test_a_callable_drives_the_paddle_from_its_own_side():
    """Forward for the right-hand player is -x, and its left is -y."""
    for action, direction in (([1.0, 0.0], (-1.0, 0.0)), ([0.0, 1.0], (0.0, -1.0)), ([-0.5, 0.0], (1.0, 0.0))):
        env = AirHockeyEnv(opponent=lambda seen, action=action: [action])
        env.reset(seed=1, options={"puck_position": (-0.5, 0.4)})
        env.step([0.0, 0.0])
        np.testing.assert_allclose(env.velocities[RIGHT], np.array(direction) * 0.6, atol=1e-12)


def test_a_callable_may_answer_with_a_list_and_is_clipped():
    wild = AirHockeyEnv(opponent=lambda seen: [[40.0, -3.0]])
    tame = AirHockeyEnv(opponent=lambda seen: np.array([[1.0, -1.0]], np.float64))
    for env in (wild, tame):
        env.reset(seed=1)
    for _ in range(30):
        assert (wild.step([0.0, 0.0])[0] == tame.step([0.0, 0.0])[0]).all()


def test_a_scripted_player_as_a_callable_would_play_the_same():
    """What a callable is shown, and what becomes of its answer, is what the scripted players work with."""
    scripted = Game(20, right="goalie")

    def goalie(seen):
        return actions_of(shadow, "goalie")

    shadow = Game(20, right=goalie)
    for game in (scripted, shadow):
        game.reset(seed=0)
    for actions in random_actions(2, 60, 20):
        scripted.states["done"] = shadow.states["done"] = False
        scripted.step(actions)
        shadow.step(actions)
        np.testing.assert_allclose(scripted.out.observation[LEFT], shadow.out.observation[LEFT], atol=1e-4)
