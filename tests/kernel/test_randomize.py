"""Tables drawn anew for every episode."""

from __future__ import annotations

import dataclasses

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers.vector import DictInfoToList
from hypothesis import given, settings
from hypothesis import strategies as st

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv, TableSpec
from airhockey_env.kernel.parameters import make_parameters
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.tables import FIELDS, FULL_SIZE, check_randomize
from tests.helpers import random_actions, same

RANGES = {"puck_radius": (0.03, 0.045), "length": (2.0, 2.6), "drag_linear": (0.0, 0.4), "paddle_speed": (3.0, 6.0)}


def test_fields_are_those_of_a_spec_in_their_order():
    parameters = make_parameters(FULL_SIZE, 50)
    assert tuple(field.name for field in dataclasses.fields(TableSpec)) == FIELDS
    assert parameters["spec"].shape == (1, len(FIELDS))
    assert TableSpec(*parameters["spec"][0].tolist()) == FULL_SIZE


def test_every_episode_of_every_table_has_its_own_table_within_the_ranges():
    envs = AirHockeyVectorEnv(300, randomize=RANGES, max_episode_steps=3)
    seen = []
    _, infos = envs.reset(seed=0)
    seen.append(infos["table"])
    for actions in random_actions(0, 8, 300):
        *_, infos = envs.step(actions)
    seen.append(infos["table"])  # third episode
    for table in seen:
        for name, (low, high) in RANGES.items():
            assert ((table[name] >= low) & (table[name] < high)).all()
            assert len(np.unique(table[name])) == 300
            assert table[name].min() < low + 0.1 * (high - low) < high - 0.1 * (high - low) < table[name].max()
    assert not set(seen[0]["length"]) & set(seen[1]["length"])
    assert envs.table[7].length == seen[1]["length"][7]
    assert envs.table[7].width == FULL_SIZE.width


def test_the_table_holds_for_an_episode_and_is_what_is_played_on():
    env = gym.make("AirHockey-v0", randomize=RANGES, opponent="idle", max_episode_steps=40)
    _, info = env.reset(seed=3)
    table = env.unwrapped.table
    assert info["table"] == {name: getattr(table, name) for name in RANGES}
    plain = gym.make("AirHockey-v0", table=table, opponent="idle", max_episode_steps=40)
    plain.reset(seed=3)
    start = plain.unwrapped.get_state()
    drawn = env.unwrapped.get_state()
    start[:] = drawn["state"]
    plain.unwrapped.set_state(start)
    for actions in random_actions(4, 40, 1):
        ours, theirs = env.step(actions[0]), plain.step(actions[0])
        assert same(ours[0], theirs[0])
        assert ours[1:4] == theirs[1:4]
        assert ours[4]["table"] == info["table"]
    assert env.reset()[1]["table"] != info["table"]


def test_stable_baselines_infos_name_the_table_of_the_episode_that_ended():
    envs = AirHockeySB3VecEnv(4, randomize=RANGES, max_episode_steps=5)
    envs.seed(0)
    envs.reset()
    before = envs._game.randomized_values()
    for actions in random_actions(5, 5, 4):
        _, _, dones, infos = envs.step(actions)
    assert dones.all()
    for i, info in enumerate(infos):
        assert info["table"] == {name: before[name][i] for name in RANGES}


@pytest.mark.parametrize(
    ("randomize", "field"),
    [
        ({"goal_with": (0.2, 0.3)}, "goal_with"),
        *(({"length": value}, "length") for value in ((2.6, 2.0), (2.0, np.inf), 2.0, "ab")),
        ({"puck_mass": (0.0, 0.1)}, "puck_mass"),
        ({"wall_restitution": (0.5, 1.1)}, "wall_restitution"),
        ({"puck_radius": (0.03, 0.2)}, "goal_width"),
        ({"goal_width": (0.3, 1.1)}, "goal_width"),
        ({"paddle_speed": (3.0, 13.0)}, "puck_speed"),
        ({"width": (0.5, 1.0), "goal_width": (0.3, 0.6)}, "goal_width"),
    ],
)
def test_impossible_ranges_name_the_field(randomize, field):
    with pytest.raises(ValueError, match=rf"^randomize.*{field}"):
        AirHockeyEnv(randomize=randomize)


def test_the_puck_cannot_be_placed_on_a_table_that_is_not_known_yet():
    env = AirHockeyEnv(randomize=RANGES)
    env.reset(seed=0)
    before = env.get_state()
    with pytest.raises(ValueError, match=r"puck_position.*randomize"):
        env.reset(seed=1, options={"puck_position": (0.0, 0.0)})
    assert env.get_state().tobytes() == before.tobytes()


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_ranges_that_are_allowed_allow_only_tables(data):
    """The check looks at four tables; every corner and every draw must be a table then."""
    names = data.draw(st.lists(st.sampled_from(FIELDS), min_size=1, max_size=5, unique=True))
    share = st.floats(0.5, 1.6)
    randomize = {}
    for name in names:
        ends = sorted(data.draw(share) * (getattr(FULL_SIZE, name) or 0.1) for _ in range(2))
        randomize[name] = tuple(ends)
    try:
        check_randomize(FULL_SIZE, randomize)
    except ValueError:
        return
    for _ in range(20):
        part = {
            name: low + data.draw(st.sampled_from([0.0, 0.5, 1.0])) * (high - low)
            for name, (low, high) in randomize.items()
        }
        dataclasses.replace(FULL_SIZE, **part)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_gymnasiums_wrapper_makes_lists_of_the_infos(mode):
    """Regression: an info was no array, which `DictInfoToList` demands."""
    batch = AirHockeyVectorEnv(5, max_episode_steps=20, autoreset_mode=mode, randomize=RANGES)
    envs = DictInfoToList(batch)
    envs.reset(seed=0)
    for actions in random_actions(0, 200, 5):
        *_, infos = envs.step(actions)
        assert [info["table"]["puck_radius"] for info in infos] == [table.puck_radius for table in batch.table]
