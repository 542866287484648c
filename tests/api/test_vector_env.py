"""What the native batch has in common with Gymnasium's SyncVectorEnv, besides the games themselves."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from airhockey_env.table_view import NAMES
from airhockey_env.vector_env import AirHockeyVectorEnv
from tests.helpers import COPIES, random_actions, same

N = 3
SMALL = {"render_mode": "rgb_array", "render_size": (64, 48)}


def pair(mode=AutoresetMode.NEXT_STEP, **arguments):
    """The native batch, and single environments in a SyncVectorEnv."""
    arguments = {"max_episode_steps": 12, **arguments}
    native = gym.make_vec("AirHockey-v0", N, autoreset_mode=mode, **arguments)
    sync = gym.make_vec("AirHockey-v0", N, "sync", vector_kwargs={"autoreset_mode": mode}, **arguments)
    for envs in (native, sync):
        envs.reset(seed=3)
    return native, sync


def play(envs, steps, seed=0):
    for actions in random_actions(seed, steps, N):
        _, _, terminated, truncated, _ = envs.step(actions)
        if envs.metadata["autoreset_mode"] == AutoresetMode.DISABLED and (terminated | truncated).any():
            envs.reset(options={"reset_mask": terminated | truncated})


@pytest.mark.parametrize("arguments", [SMALL, {"randomize": {"width": (1.0, 1.2)}}], ids=["fixed", "randomized"])
def test_call_and_get_attr(arguments):
    native, sync = pair(**arguments)
    for envs in (native, sync):
        play(envs, 20)
    names = [name for name in NAMES if name not in ("metadata", "unwrapped", "opponent_index", "set_opponents")]
    for name in names:
        if name not in ("set_state", "set_opponent_skill", *(() if arguments is SMALL else ("render",))):
            found, wanted = native.call(name), sync.call(name)
            assert isinstance(found, tuple) and same(found, wanted), name
            assert same(native.get_attr(name), wanted), name
    assert native.call("set_opponent_skill", 0.25) == sync.call("set_opponent_skill", skill=0.25) == (None,) * N
    assert native.get_attr("opponent_skill") == sync.get_attr("opponent_skill") == (0.25,) * N
    state = native.get_attr("get_state")[1]
    for envs in (native, sync):
        envs.call("set_state", state)
    assert same(native.get_attr("positions"), sync.get_attr("positions"))
    with pytest.raises(AttributeError, match="'nothing'"):
        native.call("nothing")
    with pytest.raises(AttributeError, match="'add_opponent'"):
        native.call("add_opponent", "idle")


@pytest.mark.parametrize("values", [0.5, [0.1, 0.2, 0.3], (0.3, 0.2, 1)], ids=repr)
def test_set_attr(values):
    native, sync = pair()
    for envs in (native, sync):
        envs.set_attr("opponent_skill", values)
    assert native.get_attr("opponent_skill") == sync.get_attr("opponent_skill")
    for actions in random_actions(1, 30, N):
        assert same(native.step(actions)[:4], sync.step(actions)[:4])


@pytest.mark.parametrize(
    "values", [2, [0.1, 0.2], [0.1, 0.2, 0.3, 0.4], [0.1, 0.2, "x"], np.array([0.5]), None], ids=repr
)
def test_set_attr_with_bad_values_changes_nothing(values):
    native, sync = pair()
    for envs in (native, sync):
        with pytest.raises(ValueError, match=r"opponent_skill|alues"):
            envs.set_attr("opponent_skill", values)
    assert native.get_attr("opponent_skill") == (1.0,) * N


@pytest.mark.parametrize("name", ["positions", "table", "render_mode", "nothing", "num_envs"])
def test_set_attr_is_never_without_effect(name):
    native, _ = pair()
    with pytest.raises(AttributeError, match=f"'{name}'"):
        native.set_attr(name, [1, 2, 3])


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("copy", COPIES)
def test_lists_of_pictures(mode, copy):
    native, sync = pair(mode, **{**SMALL, "render_mode": "rgb_array_list"})
    assert native.render_mode == sync.render_mode == "rgb_array_list"
    assert native.render_mode in native.metadata["render_modes"]
    native = COPIES[copy](native)
    lengths = set()
    for seed, steps in enumerate((0, 5, 9, 1, 0, 30)):
        for envs in (native, sync):
            play(envs, steps, seed)
        found, wanted = native.render(), sync.render()
        assert isinstance(found, tuple) and same(found, wanted)
        lengths |= {len(film) for film in found}
    assert {0, 1} < lengths
    for envs in (native, sync):
        play(envs, 3)
    assert same(native.call("render"), sync.call("render"))


def test_a_batch_that_could_not_be_made_can_be_closed():
    """As Gymnasium 1.2 does when it is deleted."""
    envs = AirHockeyVectorEnv.__new__(AirHockeyVectorEnv)
    envs.close()
    assert envs.closed
