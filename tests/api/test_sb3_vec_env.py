"""The whole interface of Stable-Baselines3's VecEnv, beside a DummyVecEnv of single environments."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecMonitor, VecNormalize

from airhockey_env import AirHockeyEnv
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.table_view import NAMES
from tests.helpers import random_actions, same

N = 4
SMALL = {"render_mode": "rgb_array", "render_size": (64, 48)}
RANDOMIZE = {"randomize": {"width": (1.0, 1.2), "puck_radius": (0.03, 0.045)}}
VARIANTS = [{}, {"obs_type": "rgb"}, {"task": "hit"}, {**RANDOMIZE, "reward": "shaped"}]
INDICES = [None, 0, 3, -1, [np.int64(2)], [1], [0, 2], (3, 0), range(1, 3), np.array([2, 1]), [-1, 1], [1, 1], []]
OPTIONS = [{"serve": "left"}, {}, {"puck_velocity": [0.5, 0.25]}, {"serve": "left"}]


def pair(**arguments):
    """Ours, and Stable-Baselines3's own around single environments of the same arguments."""
    arguments = {"max_episode_steps": 25, **arguments}
    theirs = DummyVecEnv([lambda: AirHockeyEnv(**arguments)] * N)
    return AirHockeySB3VecEnv(N, **arguments), theirs


def begun(steps=30, **arguments):
    """Both, under way."""
    envs = pair(**arguments)
    for env in envs:
        env.seed(5)
        env.reset()
    for actions in random_actions(5, steps, N):
        for env in envs:
            env.step(actions)
    return envs


def both(ours, theirs, ask):
    """What both answer, or the kinds of their errors."""
    answers = []
    for env in (ours, theirs):
        try:
            answers.append(ask(env))
        except (IndexError, TypeError, AttributeError, ValueError) as error:
            answers.append(type(error))
    return answers


@pytest.mark.parametrize("arguments", VARIANTS, ids=str)
def test_games_and_infos(arguments):
    ours, theirs = pair(**arguments)
    assert ours.num_envs == theirs.num_envs and ours.unwrapped is ours
    assert ours.observation_space == theirs.observation_space and ours.action_space == theirs.action_space
    assert len(ours.reset_infos) == N and not any(ours.reset_infos)
    assert ours.seed(3) == theirs.seed(3) == [3, 4, 5, 6]
    assert same(ours.reset(), theirs.reset())
    ends = 0
    for actions in random_actions(3, 60, N):
        found, wanted = ours.step(actions), theirs.step(actions)
        assert same(found[:3], wanted[:3]) and [part.dtype for part in found[:3]] == [p.dtype for p in wanted[:3]]
        for i in np.flatnonzero(found[2]):
            ends += 1
            for name, value in found[3][i].items():
                assert same(value, wanted[3][i][name]), name
        for mine, other in zip(ours.reset_infos, theirs.reset_infos, strict=True):
            assert {"score", "is_success"} <= mine.keys()
            assert all(same(mine[name], other[name]) for name in mine)
    assert ends >= N


def test_options_and_seeds_are_of_the_next_reset_alone():
    ours, theirs = pair()
    for options in (OPTIONS, OPTIONS[0], {}, None):
        for env in (ours, theirs):
            env.seed(8)
            env.set_options(options)
        for _ in range(2):
            assert same(ours.reset(), theirs.reset())


def test_tables_of_equal_options_begin_in_one_call(monkeypatch):
    envs = AirHockeySB3VecEnv(N)
    calls = []
    begin = envs._game.begin
    monkeypatch.setattr(envs._game, "begin", lambda rows, options: (calls.append(rows), begin(rows, options)))
    envs.reset()
    assert same(calls, [np.arange(N)])
    envs.set_options({"serve": "right"})
    envs.reset()
    assert same(calls[1:], [np.arange(N)])
    envs.set_options(OPTIONS)
    envs.reset()
    assert same(calls[2:], [np.array([0, 3]), np.array([1]), np.array([2])])


@pytest.mark.parametrize("indices", INDICES, ids=repr)
@pytest.mark.parametrize("arguments", [SMALL, {**SMALL, **RANDOMIZE}], ids=["fixed", "randomized"])
def test_attributes_of_tables(arguments, indices):
    ours, theirs = begun(**arguments)
    shared = [name for name in NAMES if hasattr(AirHockeyEnv, name) and name not in ("metadata", "unwrapped")]
    assert {"positions", "velocities", "table", "opponent_skill", "render_mode"} <= set(shared)
    for name in shared:
        assert ours.has_attr(name) and theirs.has_attr(name)
        found, wanted = ours.get_attr(name, indices), theirs.get_attr(name, indices)
        assert len(found) == len(wanted)
        if callable(getattr(AirHockeyEnv, name)):
            continue
        assert same(found, wanted), name
    for method in ("observe", "render", "get_state"):
        assert same(ours.env_method(method, indices=indices), theirs.env_method(method, indices=indices)), method
    assert ours.env_is_wrapped(Monitor, indices) == theirs.env_is_wrapped(Monitor, indices)


def test_all_that_is_a_tables_own_can_be_asked_for():
    own = {name for kind in AirHockeyEnv.__mro__ if kind.__module__.startswith("airhockey_env") for name in vars(kind)}
    assert {name for name in own if not name.startswith("_")} - set(NAMES) == {"reset", "step", "close"}


@pytest.mark.parametrize("indices", INDICES, ids=repr)
def test_methods_on_some_tables_leave_the_others_alone(indices):
    ours, theirs = begun(opponent="striker")
    for env in (ours, theirs):
        assert env.env_method("set_opponent_skill", 0.25, indices=indices) == [None] * len(
            env.get_attr("table", indices)
        )
    assert ours.get_attr("opponent_skill") == theirs.get_attr("opponent_skill")
    for env in (ours, theirs):
        env.set_attr("opponent_skill", 0.5, indices)
    assert ours.get_attr("opponent_skill") == theirs.get_attr("opponent_skill")
    for env in (ours, theirs):
        env.env_method("set_state", theirs.env_method("get_state", indices=2)[0], indices=indices)
    for actions in random_actions(6, 40, N):
        assert same(ours.step(actions)[:3], theirs.step(actions)[:3])


@pytest.mark.parametrize("indices", [4, -5, [0, 4], [-5], 2**70])
def test_tables_that_are_not_there(indices):
    ours, theirs = begun(1)
    before = ours.env_method("get_state")
    for ask in (
        lambda env: env.get_attr("positions", indices),
        lambda env: env.set_attr("opponent_skill", 0.5, indices),
        lambda env: env.env_method("set_opponent_skill", 0.5, indices=indices),
        lambda env: env.env_is_wrapped(Monitor, indices),
    ):
        assert both(ours, theirs, ask) == [IndexError, IndexError]
        with pytest.raises(IndexError, match=r"^indices "):
            ask(ours)
    assert same(before, ours.env_method("get_state"))


def test_a_number_of_numpy_is_a_number():
    ours, _ = begun(1)
    assert same(ours.get_attr("positions", np.int64(2)), ours.get_attr("positions", 2))


@pytest.mark.parametrize("indices", [1.0, "1", ["1"], [0.0], [None], [[0]], True, [True, False]], ids=repr)
def test_what_is_no_number_of_a_table(indices):
    ours, _ = begun(1)
    for ask in (
        lambda: ours.get_attr("positions", indices),
        lambda: ours.set_attr("opponent_skill", 0.5, indices),
        lambda: ours.env_method("get_state", indices=indices),
        lambda: ours.env_is_wrapped(Monitor, indices),
    ):
        with pytest.raises(TypeError, match=r"^indices "):
            ask()


@pytest.mark.parametrize(
    "name", ["nothing", "step", "reset", "_game", "num_envs", "opponents", "set_opponent", "add_opponent", "get_attr"]
)
def test_what_no_table_has_is_refused(name):
    ours, _ = begun(1)
    assert not ours.has_attr(name)
    for ask in (ours.get_attr, ours.env_method, lambda name: ours.set_attr(name, 1)):
        with pytest.raises(AttributeError, match=f"'{name}'"):
            ask(name)


@pytest.mark.parametrize("name", ["positions", "table", "render_mode", "opponent_index", "get_state"])
def test_nothing_is_set_without_effect(name):
    ours, _ = begun(1)
    with pytest.raises(AttributeError, match=f"'{name}'"):
        ours.set_attr(name, ours.get_attr(name)[0])


@pytest.mark.parametrize("skill", [-0.1, 1.1, None, "1", [0.5], [0.5] * N, np.array([0.5])], ids=repr)
def test_a_bad_skill_changes_nothing(skill):
    ours, theirs = begun(1)
    for ask in (
        lambda env: env.env_method("set_opponent_skill", skill),
        lambda env: env.set_attr("opponent_skill", skill),
    ):
        assert both(ours, theirs, ask) == [ValueError, ValueError]
        with pytest.raises(ValueError, match=r"^opponent_skill "):
            ask(ours)
    assert ours.get_attr("opponent_skill") == [1.0] * N


def test_pictures():
    ours, theirs = begun(**SMALL)
    assert same(ours.get_images(), theirs.get_images())
    assert same(ours.render(), theirs.render()) and same(ours.render("rgb_array"), theirs.render("rgb_array"))
    assert ours.render_mode == theirs.render_mode == "rgb_array"
    assert ours.metadata["render_fps"] == theirs.metadata["render_fps"] == 50
    ours, theirs = begun()
    for env in (ours, theirs):
        with pytest.warns(UserWarning, match="render"):
            assert env.render() is None
        with pytest.warns(UserWarning, match="rgb_array"):
            assert env.get_images() == [None] * N
        assert env.get_attr("render_mode") == [env.render_mode] * N == [None] * N
        env.close()


def test_wrappers_hand_on_what_is_asked():
    def wrapped(env):
        return VecFrameStack(VecNormalize(VecMonitor(env)), 2)

    ours, theirs = (wrapped(env) for env in pair())
    for env in (ours, theirs):
        env.seed(2)
        env.reset()
    for actions in random_actions(2, 40, N):
        assert same(ours.step(actions)[:3], theirs.step(actions)[:3])
    assert same(ours.get_attr("positions", [2, -1]), theirs.get_attr("positions", [2, -1]))
    ours.env_method("set_opponent_skill", 0.5, indices=1)
    assert ours.get_attr("opponent_skill") == [1.0, 0.5, 1.0, 1.0]
    ours.set_opponents(0)  # a method of the batch
    assert ours.getattr_depth_check("set_opponents", already_found=False) is None
    assert ours.env_is_wrapped(gym.Wrapper) == [False] * N


def test_what_is_written_into_an_info_is_gone_in_the_next_step():
    """The dicts of steps that end no episode are used again as long as they are empty."""
    envs = AirHockeySB3VecEnv(3)
    envs.reset()
    actions = np.zeros((3, 2), np.float32)
    _, _, _, infos = envs.step(actions)
    infos[1]["mine"] = 1
    _, _, _, later = envs.step(actions)
    assert later == [{}, {}, {}]
    assert infos == [{}, {"mine": 1}, {}]
    assert len({id(info) for info in later}) == 3
    del infos[1:]
    assert len(envs.step(actions)[3]) == 3
