"""Two players at one table: what PettingZoo demands, parity with the other faces, and the symmetry of the sides."""

from __future__ import annotations

import importlib
import inspect
import math
import re
import sys
import warnings
from collections import Counter
from functools import partial

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled, ResetNeeded

from airhockey_env import AirHockeyEnv
from airhockey_env.actions import DIRECTIONS
from airhockey_env.game import OBS_TYPES
from airhockey_env.kernel.state import LEFT, RIGHT
from airhockey_env.tables import PRESETS
from tests.helpers import COPIES, begin, pursue, random_actions, same, snapshot, turned

pytest.importorskip("pettingzoo")

from pettingzoo.utils import aec_to_parallel

from airhockey_env.parallel_env import AGENTS, TASKS, AirHockeyParallelEnv, env, parallel_env, raw_env

with warnings.catch_warnings():  # on importing its own old environments
    warnings.simplefilter("ignore", DeprecationWarning)
    from pettingzoo.test import api_test, max_cycles_test, parallel_api_test, parallel_seed_test, render_test, seed_test
    from pettingzoo.test.save_obs_test import test_save_obs as save_obs_test
    from pettingzoo.test.state_test import state_test

SMALL = (64, 48)
PICTURES = {"render_mode": "rgb_array", "render_size": SMALL}
STILL = {agent: np.zeros(2, np.float32) for agent in AGENTS}

# A puck past the right paddle that is in the goal in the second step at 50 Hz, and its mirror image.
SHOT = {"puck_position": (1.0, 0.1), "puck_velocity": (5.0, 0.0)}
SHOT_BACK = {"puck_position": (-1.0, -0.1), "puck_velocity": (-5.0, 0.0)}

VARIANTS = [
    {},
    {"continuous": False},
    {"reward": "shaped"},
    {"stack": 3, "action_delay_ms": (5, 40), "camera": "robots"},
    {"stack": 2, "obs_type": "grayscale", "max_episode_steps": 30},
    {"task": "match", "max_episode_steps": -1},
    *({"table": name} for name in PRESETS),
    *({"control_hz": rate} for rate in (10, 240)),
    {**PICTURES, "max_episode_steps": 9},
    {"randomize": {"puck_radius": (0.03, 0.045), "length": (2.0, 2.6)}},
]


@pytest.fixture(autouse=True)
def _windows_are_not_shown(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setenv("PYGAME_HIDE_SUPPORT_PROMPT", "1")


def players(seed, steps, continuous=True):
    """Functions from observations to actions, one a step: both drawn, or one or both chasing the puck."""
    drawn = random_actions(seed, steps, 2, continuous)
    modes = np.random.default_rng(seed).integers(4, size=steps // 50 + 1)

    def choose(step):
        def actions(observations):
            chosen = dict(zip(AGENTS, drawn[step], strict=True))
            for k, agent in enumerate(AGENTS):
                if modes[step // 50] & (1 + k):
                    chase = pursue(observations[agent][None])[0]
                    angle = math.atan2(chase[1], chase[0])
                    chosen[agent] = chase if continuous else 1 + round(angle / (math.pi / 4)) % 8
            return chosen

        return actions

    return [choose(step) for step in range(steps)]


# What PettingZoo demands


@pytest.mark.parametrize("continuous", [True, False])
@pytest.mark.parametrize("obs_type", OBS_TYPES)
@pytest.mark.parametrize("task", TASKS)
def test_pettingzoo_has_no_complaint_of_any_kind_of_observation_and_action(task, obs_type, continuous, capsys):
    pytest.importorskip("pygame")
    arguments = {"task": task, "obs_type": obs_type, "continuous": continuous, "max_episode_steps": 40}
    parallel_api_test(parallel_env(**arguments))
    parallel_seed_test(lambda: parallel_env(**arguments))
    render_test(lambda render_mode: env(render_mode=render_mode, render_size=SMALL, control_hz=240, **arguments))


@pytest.mark.parametrize("arguments", VARIANTS, ids=str)
def test_pettingzoo_has_no_complaint(arguments, capsys):
    parallel_api_test(parallel_env(**arguments), num_cycles=1600)
    parallel_seed_test(lambda: parallel_env(**arguments))
    seed_test(lambda: env(**arguments), num_cycles=300)  # unlike the one before, it plays more than a step
    state_test(env(**arguments), parallel_env(**arguments), num_cycles=100)


# The agents' names are part of the interface.
@pytest.mark.filterwarnings("ignore:We recommend agents to be named:UserWarning")
@pytest.mark.parametrize("arguments", [{}, {"continuous": False, "reward": "shaped"}, {"task": "match"}], ids=str)
def test_pettingzoo_has_no_complaint_agent_by_agent(arguments, capsys):
    api_test(env(**arguments), num_cycles=400)


@pytest.mark.parametrize("task", TASKS)
def test_pettingzoo_has_no_complaint_of_its_limit(task):
    """Its own test takes a module; PettingZoo calls the argument `max_cycles`."""

    class Module:
        parallel_env = staticmethod(partial(parallel_env, task=task))
        env = staticmethod(partial(env, task=task))

    max_cycles_test(Module)
    for make in (parallel_env, env, raw_env):
        assert make(max_cycles=9).unwrapped.state_space == parallel_env().state_space
        with pytest.raises(ValueError, match=r"^max_cycles must be "):
            make(max_cycles=0)
        with pytest.raises(ValueError, match="max_episode_steps"):
            make(max_cycles=9, max_episode_steps=9)


def test_pettingzoo_saves_pictures(tmp_path, monkeypatch):
    pytest.importorskip("PIL")
    monkeypatch.chdir(tmp_path)
    for obs_type in ("rgb", "grayscale"):
        save_obs_test(env(obs_type=obs_type))
        assert len(list(tmp_path.rglob("*.png"))) == 2


def test_it_says_what_it_is():
    game = parallel_env(control_hz=30)
    assert str(game) == game.metadata["name"] == "air_hockey_v0"
    assert game.metadata["is_parallelizable"] and game.metadata["render_fps"] == 30
    assert game.metadata["render_modes"] == ["human", "rgb_array"]
    assert game.possible_agents == ["left", "right"] and game.max_num_agents == 2
    assert game.agents == [] and game.num_agents == 0
    assert game.unwrapped is game and aec_to_parallel(env()).unwrapped.possible_agents == ["left", "right"]
    for agent in AGENTS:
        assert game.observation_space(agent) == AirHockeyEnv().observation_space
        assert game.action_space(agent) == AirHockeyEnv().action_space
    assert game.observation_space("left") is not game.observation_space("right")  # each is seeded for itself
    assert game.action_space("left") is not game.action_space("right")
    assert parallel_env(continuous=False).action_space("right") == gym.spaces.Discrete(9)
    assert parallel_env(obs_type="rgb").observation_space("right").shape == (84, 84, 3)


def test_arguments_are_those_of_the_single_environment():
    ours = inspect.signature(AirHockeyParallelEnv).parameters
    theirs = inspect.signature(AirHockeyEnv).parameters
    assert set(ours) <= set(theirs)
    for name, parameter in ours.items():
        if name != "max_episode_steps":
            assert parameter.default == theirs[name].default, name
    assert ours["max_episode_steps"].default is None
    documented = re.findall(r"^ *\| `(\w+)` \|.*\| `?\"?(.*?)\"?`? \|$", AirHockeyParallelEnv.__doc__, re.MULTILINE)
    assert documented == [(name, str(parameter.default)) for name, parameter in ours.items()]


def test_the_example_in_the_docstring_runs():
    (code,) = re.findall(r"```python\n(.*?)```", inspect.cleandoc(AirHockeyParallelEnv.__doc__), re.DOTALL)
    scope: dict = {}
    exec(code, scope)
    assert scope["env"].agents == []
    assert any(scope["terminations"].values()) or any(scope["truncations"].values())


def test_without_pettingzoo_the_error_names_the_extra(monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "pettingzoo"]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, "airhockey_env.parallel_env")
    with pytest.raises(DependencyNotInstalled, match=r'pip install "airhockey-env\[multiagent\]"'):
        importlib.import_module("airhockey_env.parallel_env")


# Parity with the other faces


PARITY = [
    {},
    {"reward": "shaped"},
    {"continuous": False},
    {"task": "match", "table": "ideal", "reward": "shaped", "control_hz": 24},
    {"table": "challenge", "continuous": False, "control_hz": 120.5},
    *(
        {"task": task, "obs_type": obs_type, "continuous": continuous, "randomize": {"width": (1.0, 1.2)}}
        for task in TASKS
        for obs_type in OBS_TYPES
        for continuous in (True, False)
    ),
]


@pytest.mark.parametrize("arguments", PARITY, ids=str)
def test_left_agent_is_the_player_of_the_single_environment(arguments):
    """With an opponent that does what the right agent does; and that sees what the right agent sees."""
    told: list[np.ndarray] = []
    right_seen: list[np.ndarray] = []

    def right(seen):
        right_seen.append(seen[0].copy())
        return told[-1]

    limit, steps = 300, 1500
    game = AirHockeyParallelEnv(max_episode_steps=limit, **arguments)
    single = AirHockeyEnv(opponent=right, max_episode_steps=limit, **arguments)
    continuous = arguments.get("continuous", True)
    observations, infos = game.reset(seed=8)
    assert same((observations["left"], infos["left"]), single.reset(seed=8))
    seen: Counter[str] = Counter()
    for choose in players(3, steps, continuous):
        states = game._game.out
        actions = choose({"left": states.observation[LEFT, 0], "right": states.observation[RIGHT, 0]})
        told.append(np.array([actions["right"]]) if continuous else DIRECTIONS[[actions["right"]]])
        right_view = states.observation[RIGHT, 0].copy()
        observations, rewards, terminations, truncations, infos = game.step(actions)
        ours = (observations["left"], rewards["left"], terminations["left"], truncations["left"], infos["left"])
        assert same(ours, single.step(actions["left"]))
        assert same(right_seen[-1], right_view)
        assert same(game.get_state(), single.get_state())
        assert (game.positions == single.positions).all() and (game.velocities == single.velocities).all()
        assert same(game.state(), states.observation[LEFT, 0])
        assert same(game.contacts, single.contacts)
        seen["contacts"] += len(game.contacts)
        seen["goals"] += abs(round(rewards["left"])) == 1
        if not game.agents:
            seen["ends"] += 1
            observations, infos = game.reset()
            assert same((observations["left"], infos["left"]), single.reset())
    assert seen["contacts"] > 30 and min(seen["goals"], seen["ends"]) > 2


def test_options_are_those_of_the_single_environment():
    game, single = AirHockeyParallelEnv(), AirHockeyEnv()
    for options in ({"serve": "left"}, {"serve": "right"}, SHOT, None, {}):
        expected, _ = single.reset(seed=4, options=options)
        observations, _ = game.reset(seed=4, options=options)
        assert same(observations["left"], expected)
    assert same(game.reset(seed=4, options={"options": 1})[0]["left"], expected)  # what PettingZoo's tests pass
    assert game.reset(4, {"serve": "right"})[0]["right"][8] < 0.0  # PettingZoo allows places


# Both sides are the same game


def swapped(results):
    return {"left": results["right"], "right": results["left"]}


@pytest.mark.parametrize("continuous", [True, False])
@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize(
    ("task", "reward", "rate"), [("point", "shaped", 50), ("match", "shaped", 12), ("match", "sparse", 50)]
)
def test_the_game_turned_by_180_degrees_is_the_game_with_the_players_swapped(task, reward, rate, name, continuous):
    arguments = {"task": task, "table": name, "reward": reward, "control_hz": rate, "continuous": continuous}
    game, mirror = (AirHockeyParallelEnv(max_episode_steps=900, **arguments) for _ in range(2))
    observations, _ = game.reset(seed=6)
    mirror.reset(seed=7)
    mirror.set_state(turned(game.get_state()))
    assert same(swapped(mirror.observe()), observations)
    seen: Counter[str] = Counter()
    for choose in players(5, 3000, continuous):
        actions = choose(observations)
        side = int(game.get_state()["side"][0])
        observations, rewards, terminations, truncations, infos = game.step(actions)
        theirs = mirror.step(swapped(actions))
        assert same(swapped(theirs[0]), observations)
        assert same(swapped(theirs[1]), rewards)
        assert same((swapped(theirs[2]), swapped(theirs[3])), (terminations, truncations))
        for agent, other in (AGENTS, AGENTS[::-1]):
            assert same(infos[agent]["score"], theirs[4][other]["score"])
            assert infos[agent]["is_success"] is theirs[4][other]["is_success"]
            assert infos[agent]["foul"] is theirs[4][other]["foul"]
        contacts, reflected = game.contacts, mirror.contacts
        assert len(contacts) == len(reflected)
        for field in ("x", "y", "nx", "ny"):
            assert (contacts[field] == -reflected[field]).all()
        assert same(contacts["impulse"], reflected["impulse"]) and same(contacts["time"], reflected["time"])
        if game.agents:
            expected = turned(game.get_state())
            ours = mirror.get_state()
            for field in expected.dtype.names:
                assert (ours[field] == expected[field]).all(), field
        if reward == "sparse":
            assert rewards["left"] == -rewards["right"] and rewards["left"] in (-1.0, 0.0, 1.0)
        seen["contacts"] += len(contacts)
        seen["crossings"] += side != int(game.get_state()["side"][0])
        for agent in AGENTS:
            seen[agent] += infos[agent]["is_success"]
        seen["points"] += abs(round(rewards["left"]))
        if not game.agents:
            observations, _ = game.reset()
            mirror.set_state(turned(game.get_state()))
    assert seen["contacts"] > 200 and seen["crossings"] > 20 and seen["points"] > 5
    assert task == "match" or min(seen["left"], seen["right"]) > 1


def test_pictures_show_the_own_side_too():
    game, mirror = (AirHockeyParallelEnv(obs_type="rgb") for _ in range(2))
    game.reset(seed=2)
    mirror.reset(seed=3)
    mirror.set_state(turned(game.get_state()))
    for actions in random_actions(2, 100, 2):
        actions = dict(zip(AGENTS, actions, strict=True))
        assert same(swapped(mirror.step(swapped(actions))[0]), game.step(actions)[0])


def test_shaped_rewards_are_of_both_sides_and_do_not_cancel():
    game = AirHockeyParallelEnv(reward="shaped")
    game.reset(seed=0, options={"serve": "right"})
    assert game.step({"left": np.zeros(2), "right": np.ones(2)})[1]["right"] != 0.0
    rewards = game.step({"left": np.zeros(2), "right": np.array([1.0, 0.0])})[1]
    assert rewards["right"] > rewards["left"]  # one's paddle gets nearer to the puck on its side, the other's rests
    assert rewards["right"] != -rewards["left"]


# Ends of episodes


@pytest.mark.parametrize(("options", "winner"), [(SHOT, "left"), (SHOT_BACK, "right")])
@pytest.mark.parametrize("limit", [2, 3, None])
def test_a_goal_terminates_for_both(options, winner, limit):
    game = AirHockeyParallelEnv(max_episode_steps=limit)
    _, infos = game.reset(seed=0, options=options)
    assert game.agents == ["left", "right"]
    assert [infos[agent]["is_success"] for agent in AGENTS] == [False, False]
    observations, rewards, terminations, truncations, infos = game.step(STILL)
    assert game.agents == ["left", "right"] and rewards == {"left": 0.0, "right": 0.0}
    observations, rewards, terminations, truncations, infos = game.step(STILL)
    assert game.agents == []
    assert set(observations) == set(infos) == set(AGENTS)
    loser = {"left": "right", "right": "left"}[winner]
    assert rewards == {winner: 1.0, loser: -1.0}
    assert terminations == {"left": True, "right": True} and truncations == {"left": False, "right": False}
    assert infos[winner]["score"].tolist() == [1, 0] and infos[loser]["score"].tolist() == [0, 1]
    assert infos[winner]["is_success"] is True and infos[loser]["is_success"] is False
    _, infos = game.reset()
    assert [infos[agent]["is_success"] for agent in AGENTS] == [False, False]


@pytest.mark.parametrize("asked", [{}, {"max_episode_steps": 7}])
def test_the_time_limit_truncates_for_both(asked):
    game = AirHockeyParallelEnv(**asked)
    game.reset(seed=0)
    for step in range(1, asked.get("max_episode_steps", 1500) + 1):
        assert game.agents == ["left", "right"]
        _, _, terminations, truncations, infos = game.step(STILL)
        assert truncations == dict.fromkeys(AGENTS, step == asked.get("max_episode_steps", 1500))
        assert terminations == dict.fromkeys(AGENTS, False)
        assert not any(infos[agent]["is_success"] for agent in AGENTS)
    assert game.agents == []


def test_after_the_end():
    game = AirHockeyParallelEnv(max_episode_steps=1)
    for over in (False, True):
        for actions in [STILL] if over else [STILL, {}]:
            with pytest.raises(ResetNeeded):
                game.step(actions)
        if not over:
            with pytest.raises(ResetNeeded):
                game.state()
            game.reset(seed=0)
            game.step(STILL)
    before = snapshot(game)
    assert game.step({}) == ({}, {}, {}, {}, {})
    assert same(snapshot(game), before)
    assert game.state() in game.state_space


def test_a_match_is_first_to_seven():
    game = AirHockeyParallelEnv(task="match", max_episode_steps=-1, reward="sparse")
    game.reset(seed=1)
    state = AirHockeyParallelEnv(task="match")
    state.reset(seed=0, options=SHOT)
    shot = state.get_state()
    for point in range(1, 8):
        shot["score"] = game.get_state()["score"]
        game.set_state(shot)
        game.step(STILL)
        _, rewards, terminations, _, infos = game.step(STILL)
        assert rewards == {"left": 1.0, "right": -1.0}
        assert infos["right"]["score"].tolist() == [0, point]
        assert terminations["right"] is (point == 7) and game.agents == ([] if point == 7 else ["left", "right"])
        assert infos["left"]["is_success"] is (point == 7)


# States and copies


def test_agents_follow_the_state():
    game = AirHockeyParallelEnv()
    never = game.get_state()
    game.reset(seed=0, options=SHOT)
    running = game.get_state()
    game.step(STILL)
    game.step(STILL)
    over = game.get_state()
    for state, agents in ((running, ["left", "right"]), (over, []), (running, ["left", "right"]), (never, [])):
        game.set_state(state)
        assert game.agents == agents


def test_what_is_returned_is_the_callers():
    game = AirHockeyParallelEnv()
    observations, _ = game.reset(seed=0)
    agents = game.agents
    kept = {agent: observations[agent].copy() for agent in AGENTS}
    for _ in range(5):
        game.step({agent: np.ones(2, np.float32) for agent in AGENTS})
    assert same(observations, kept)
    game.positions[:] = game.velocities[:] = game.state()[:] = math.nan
    agents.clear()
    assert np.isfinite(game.positions).all() and np.isfinite(game.state()).all()
    game.reset()
    assert game.agents == ["left", "right"] == game.possible_agents


# Pictures


def test_rendering():
    game = AirHockeyParallelEnv(render_mode="rgb_array", render_size=SMALL)
    game.reset(seed=0)
    assert game.render().shape == (48, 64, 3)
    game.close()
    game.close()
    with pytest.warns(UserWarning, match="render_mode"):
        assert AirHockeyParallelEnv().render() is None


def test_a_window_opens_and_closes():
    pytest.importorskip("pygame")
    game = AirHockeyParallelEnv(render_mode="human", render_size=SMALL, control_hz=240)
    game.reset(seed=0)
    game.step(STILL)
    assert game.render() is None
    COPIES["pickle"](game).close()
    game.close()


# Bad input: what all APIs refuse is in test_bad_input


@pytest.mark.parametrize("task", ["hit", "defend", "Point", None, 1, ["point"]], ids=str)
def test_tasks_for_one_player_are_refused(task):
    with pytest.raises(ValueError, match=r"^task "):
        AirHockeyParallelEnv(task=task)


FINE = np.zeros(2, np.float32)
INCOMPLETE = [
    None, 3, [], FINE, [FINE, FINE], {}, {"left": FINE}, {"right": FINE},
    {"left": FINE, "right": FINE, "middle": FINE}, {"left": FINE, "Right": FINE}, {0: FINE, 1: FINE},
]  # fmt: skip


@pytest.mark.parametrize("actions", INCOMPLETE, ids=str)
def test_an_action_for_each_agent(actions):
    game = begin(AirHockeyParallelEnv())
    before = snapshot(game)
    with pytest.raises(ValueError, match=r"^actions .*'left', 'right'"):
        game.step(actions)
    assert same(snapshot(game), before)


def test_unknown_agents():
    game = AirHockeyParallelEnv()
    for space in (game.observation_space, game.action_space):
        with pytest.raises(KeyError, match="middle"):
            space("middle")


def test_wrappers_draw_from_a_generator_that_the_seed_determines():
    """SuperSuit's `frame_skip_v0` asks for `np_random`, as PettingZoo's own environments have it."""
    game = AirHockeyParallelEnv()
    drawn = []
    for seed in (0, 1, 0):
        game.reset(seed=seed)
        drawn.append(game.np_random.integers(2**63))
    assert drawn[0] == drawn[2] != drawn[1]
    game = AirHockeyParallelEnv()
    game.reset()
    assert game.np_random.integers(2**63) >= 0
