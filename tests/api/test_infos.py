"""What infos hold: arrays and scalars of fixed shape and dtype, so that libraries can stack and convert them."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.engine.records import CONTACT
from airhockey_env.kernel.state import CONTACT_ROWS, PUCK
from airhockey_env.parallel_env import AirHockeyParallelEnv
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.tables import PRESETS
from tests.helpers import COPIES, IDS, random_actions, same

RANGES = {"puck_radius": (0.03, 0.045), "drag_linear": (0.0, 0.5)}
KEYS = {"score": ((2,), np.int32), "foul": ((), bool), "is_success": ((), bool)}
DRAWN = dict.fromkeys(RANGES, ((), np.float64))


def layout(info: dict[str, Any]) -> dict[str, Any]:
    """Shapes and dtypes by keys; fails on what is no array or scalar.

    A flag is a Python bool: NumPy's would be put into an array of objects by Gymnasium's SyncVectorEnv, and be refused
    by its NumpyToTorch.
    """
    found: dict[str, Any] = {}
    for key, value in info.items():
        if isinstance(value, dict):
            found[key] = layout(value)
        else:
            assert isinstance(value, (np.ndarray, np.float64, bool)), key
            found[key] = (np.shape(value), np.asarray(value).dtype)
    return found


@pytest.mark.parametrize("randomize", [None, RANGES])
@pytest.mark.parametrize("name", IDS)
def test_every_info_of_a_single_environment_has_the_same_layout(name: str, randomize: Any) -> None:
    expected = KEYS | ({"table": DRAWN} if randomize else {})
    env = gym.make(name, randomize=randomize, max_episode_steps=40)
    for seed in range(4):
        assert layout(env.reset(seed=seed)[1]) == expected
        over = False
        while not over:
            *_, terminated, truncated, info = env.step(env.action_space.sample())
            assert layout(info) == expected
            over = terminated or truncated


@pytest.mark.parametrize("randomize", [None, RANGES])
def test_every_info_of_two_players_has_the_same_layout(randomize: Any) -> None:
    expected = KEYS | ({"table": DRAWN} if randomize else {})
    env = AirHockeyParallelEnv(randomize=randomize, max_episode_steps=40)
    infos = [env.reset(seed=0)[1]]
    while env.agents:
        infos.append(env.step({agent: env.action_space(agent).sample() for agent in env.agents})[-1])
    assert all(layout(info[agent]) == expected for info in infos for agent in ("left", "right"))


@pytest.mark.parametrize("randomize", [None, RANGES])
@pytest.mark.parametrize("mode", AutoresetMode)
def test_every_info_of_a_batch_is_the_vector_form_of_it(mode: AutoresetMode, randomize: Any) -> None:
    n = 6

    def vector_form(keys: dict[str, Any]) -> dict[str, Any]:
        values = {key: ((n, *shape), dtype) for key, (shape, dtype) in keys.items()}
        return {**values, **{f"_{key}": ((n,), np.bool_) for key in keys}}

    expected = vector_form(KEYS)
    if randomize:
        expected |= {"table": vector_form(DRAWN), "_table": ((n,), np.bool_)}
    envs = AirHockeyVectorEnv(n, autoreset_mode=mode, randomize=randomize, max_episode_steps=30)
    assert layout(envs.reset(seed=0)[1]) == expected
    finals = 0
    for actions in random_actions(0, 100, n):
        *_, terminated, truncated, infos = envs.step(actions)
        if "final_info" in infos:
            finals += 1
            assert layout(infos.pop("final_info")) == expected
            assert infos.pop("_final_info").dtype == infos.pop("_final_obs").dtype == np.bool_
            infos.pop("final_obs")
        assert layout(infos) == expected
        done = terminated | truncated
        if mode == AutoresetMode.DISABLED and done.any():
            assert layout(envs.reset(options={"reset_mask": done})[1]) == expected
    assert (finals > 0) == (mode == AutoresetMode.SAME_STEP)


@pytest.mark.parametrize("mode", AutoresetMode)
def test_a_foul_is_told_on_its_step_in_every_api(mode: AutoresetMode) -> None:
    """7 s at 50 Hz are 350 ticks; the next one is too many. The puck lies out of reach of the idle players."""
    still = np.zeros(2, np.float32)
    sides = []
    single, batch = AirHockeyEnv(opponent="idle"), AirHockeyVectorEnv(2, opponent="idle", autoreset_mode=mode)
    both = AirHockeyParallelEnv()
    for env in (single, batch, both):
        env.reset(seed=0, options={"serve": "left"})
    for step in range(1, 360):
        info, infos = single.step(still)[-1], batch.step(np.stack([still] * 2))[-1]
        told = both.step({"left": still, "right": still})[-1]
        fouls = [info["foul"], *infos["foul"], told["left"]["foul"], told["right"]["foul"]]
        assert fouls == [step == 351] * 5
        sides.append(single.observe()[8] < 0.0)
    assert sides[349] and not sides[350]  # the other side serves


def test_a_foul_that_ends_an_episode_is_in_its_last_info() -> None:
    still = np.zeros((1, 2), np.float32)
    arguments = {"task": "hit", "opponent": "idle", "max_episode_steps": 500}
    same_step = AirHockeyVectorEnv(1, autoreset_mode="SameStep", **arguments)
    sb3 = AirHockeySB3VecEnv(1, **arguments)
    same_step.reset(seed=0)
    sb3.reset()
    for _ in range(351):
        *_, infos = same_step.step(still)
        *_, details = sb3.step(still)
    assert infos["final_info"]["foul"].tolist() == [True] and infos["foul"].tolist() == [False]
    assert details[0]["foul"] is True


# Contacts


def test_contacts_of_a_batch_are_rows_and_their_number() -> None:
    n = 8
    envs = AirHockeyVectorEnv(n, opponent="striker")
    observations, _ = envs.reset(seed=0)
    most = 0
    for _ in range(300):
        chase = 5.0 * (observations[:, 8:10] - observations[:, :2])
        observations, *_ = envs.step(chase)
        contacts, count = envs.contacts, envs.n_contacts
        assert (contacts.shape, contacts.dtype, count.shape, count.dtype) == (
            (n, CONTACT_ROWS),
            CONTACT,
            (n,),
            np.int32,
        )
        recorded = np.arange(CONTACT_ROWS) < count[:, np.newaxis]
        assert (contacts["impulse"][recorded] > 0.0).all()
        assert not contacts[~recorded].view(np.uint8).any()
        most = max(most, int(count.max()))
    assert most > 1


def test_contacts_are_copies() -> None:
    env = AirHockeyEnv(opponent="idle")
    env.reset(seed=0, options={"puck_position": (-0.5, 0.0), "puck_velocity": (-9.0, 0.0)})
    while not len(env.contacts):
        env.step(np.zeros(2, np.float32))
    contacts = env.contacts
    assert type(contacts) is np.ndarray and (contacts["a"][0], contacts["b"][0]) == (0, PUCK)
    kept = contacts.copy()
    contacts["impulse"] = -1.0
    assert same(env.contacts, kept)
    env.step(np.zeros(2, np.float32))
    assert (contacts["impulse"] == -1.0).all()


@pytest.mark.parametrize("table", PRESETS)
def test_a_state_that_was_put_back_has_no_contacts(table: str) -> None:
    env = AirHockeyEnv(opponent="idle", table=table)
    env.reset(seed=0, options={"puck_position": (-0.5, 0.0), "puck_velocity": (-9.0, 0.0)})
    before, hits = env.get_state(), []
    while not (hits and len(hits[-1])):
        env.step(np.zeros(2, np.float32))
        hits.append(env.contacts)
    env.set_state(before)
    assert len(env.contacts) == 0
    for expected in hits:
        env.step(np.zeros(2, np.float32))
        assert same(env.contacts, expected)
    env.set_state(env.get_state())
    assert len(env.contacts) == 0


def test_an_automatic_reset_in_the_same_step_leaves_the_contacts_of_the_last_step() -> None:
    """The puck flies at the own paddle, reaches it in the second step, and that is the episode's last."""
    envs = AirHockeyVectorEnv(2, opponent="idle", autoreset_mode="SameStep", max_episode_steps=2)
    single = AirHockeyEnv(opponent="idle")
    options = {"puck_position": (-0.5, 0.0), "puck_velocity": (-9.0, 0.0)}
    envs.reset(seed=0, options=options)
    single.reset(seed=0, options=options)
    for _ in range(2):
        single.step(np.zeros(2, np.float32))
        truncated = envs.step(np.zeros((2, 2), np.float32))[3]
    assert truncated.all() and len(single.contacts) == 1
    assert same(envs.contacts[1, : envs.n_contacts[1]], single.contacts)


# What converters and stackers of other libraries need


@pytest.mark.parametrize("obs_type", ["state", "grayscale"])
def test_final_observations_are_objects_for_gymnasium_and_numbers_for_dlpack(obs_type: str) -> None:
    envs = AirHockeyVectorEnv(3, autoreset_mode="SameStep", max_episode_steps=20, obs_type=obs_type)
    envs.reset(seed=[0, 1, 2])
    for step in range(5):
        envs.step(envs.action_space.sample())
        if step == 1:  # so that not all end at once
            envs.reset(options={"reset_mask": np.array([False, True, False])})
    infos: dict[str, Any] = {}
    while "final_obs" not in infos:
        infos = envs.step(np.zeros((3, 2), np.float32))[-1]
    final = infos["final_obs"]
    assert infos["_final_obs"].tolist() == [True, False, True]
    assert final.dtype == object and [one is None for one in final] == [False, True, False]
    shape, dtype = envs.single_observation_space.shape, envs.single_observation_space.dtype
    converted = np.from_dlpack(final)
    assert (converted.shape, converted.dtype) == ((3, *shape), dtype)
    assert same(converted[[0, 2]], np.stack([final[0], final[2]])) and not converted[1].any()
    for copied in COPIES.values():
        assert same(np.from_dlpack(copied(final)), converted)
    with pytest.raises(BufferError):
        np.from_dlpack(final[1:2])


def test_a_mask_may_be_another_librarys_array() -> None:
    class Foreign:
        def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
            return np.array([False, True])

    envs = AirHockeyVectorEnv(2)
    kept = envs.reset(seed=0)[0]
    observations, infos = envs.reset(options={"reset_mask": Foreign()})
    assert infos["_score"].tolist() == [False, True]
    assert same(observations[0], kept[0]) and not same(observations[1], kept[1])
