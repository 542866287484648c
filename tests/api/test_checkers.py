"""What Gymnasium and Stable-Baselines3 demand of an environment, as their own checkers see it."""

from __future__ import annotations

import dataclasses
import inspect
import re
from itertools import cycle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as check_for_gymnasium
from gymnasium.wrappers.vector import NormalizeObservation, RecordEpisodeStatistics
from stable_baselines3.common.env_checker import check_env as check_for_sb3

from airhockey_env import PRESETS, AirHockeyEnv
from airhockey_env.cameras import CAMERAS
from airhockey_env.game import OBS_TYPES
from airhockey_env.kernel.scripted import SCRIPTED
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.tables import FULL_SIZE
from tests.helpers import IDS, pursue, shown

pytestmark = [pytest.mark.filterwarnings("error")]

SMALL = (64, 48)
ARGUMENTS = [
    {},
    *({"task": name} for name in TASKS),
    *({"opponent": name} for name in sorted(SCRIPTED)),
    {"opponent": pursue},
    *({"opponent_skill": skill} for skill in (0.0, 0.5, 1)),
    *({"table": name} for name in PRESETS),
    {"table": dataclasses.replace(FULL_SIZE, length=2.0, puck_mass=0.02)},
    *({"reward": name} for name in ("sparse", "shaped")),
    *({"control_hz": rate} for rate in (10, 50, 240)),
    {"max_episode_steps": 30},
    *({"camera": name} for name in CAMERAS),
    {"action_delay_ms": 12},
    *({"stack": 6, "obs_type": name} for name in OBS_TYPES),
    {"randomize": {"puck_radius": (0.03, 0.045), "drag_linear": (0.0, 0.5)}},
    {"render_mode": "rgb_array", "render_size": SMALL},
]
COVERED = {name for arguments in ARGUMENTS for name in arguments} | {"obs_type", "continuous"}  # see the next


def test_every_argument_is_checked():
    assert IDS
    assert set(inspect.signature(AirHockeyEnv).parameters) == COVERED


@pytest.mark.parametrize("continuous", [True, False])
@pytest.mark.parametrize("obs_type", OBS_TYPES)
@pytest.mark.parametrize("name", IDS)
def test_checkers_have_no_complaint_of_any_kind_of_observation_and_action(name, obs_type, continuous):
    """Nothing is skipped. (For vector environments neither library has a checker: see below, and test_parity.)"""
    env = gym.make(
        name, obs_type=obs_type, continuous=continuous, render_mode="rgb_array", render_size=SMALL,
        disable_env_checker=True,
    ).unwrapped  # fmt: skip
    check_for_gymnasium(env)
    if obs_type == "grayscale":
        # Stable-Baselines3 wants images to have an axis of channels, as AirHockeySB3VecEnv gives them; Gymnasium's own
        # grayscale images have none. Any other warning is an error still.
        with pytest.warns(UserWarning, match=r"^Your observation\s+has an unconventional shape"):
            check_for_sb3(env)
    else:
        check_for_sb3(env)
    env.close()


@pytest.mark.parametrize(("name", "arguments"), list(zip(cycle(IDS), ARGUMENTS)), ids=shown)
def test_checkers_have_no_complaint_of_any_argument(name, arguments):
    arguments = {"render_size": SMALL, **arguments}  # the checker renders in every mode
    env = gym.make(name, disable_env_checker=True, **arguments).unwrapped
    check_for_gymnasium(env)
    if len(env.observation_space.shape) not in (1, 3):
        with pytest.warns(UserWarning, match=r"^Your observation\s+has an unconventional shape"):
            check_for_sb3(env, warn=True)
    else:
        check_for_sb3(env, warn=True, skip_render_check=env.render_mode is None)
    env.close()


@pytest.mark.parametrize("name", IDS)
def test_make_by_module_wraps_without_complaint(name):
    env = gym.make(f"airhockey_env:{name}")
    check_for_gymnasium(env.unwrapped)
    env.reset(seed=0)
    for _ in range(20):
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if terminated or truncated:
            env.reset()
    assert env.spec.id == name
    env.close()


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
def test_vector_environment_says_what_it_is(name, mode):
    envs = gym.make_vec(name, num_envs=3, autoreset_mode=mode)
    assert type(envs.unwrapped).__module__.startswith("airhockey_env")
    assert envs.metadata["autoreset_mode"] == gym.vector.AutoresetMode(mode)
    assert envs.spec.id == name
    assert envs.num_envs == 3
    observations, _ = envs.reset(seed=0)
    assert observations in envs.observation_space
    assert envs.observation_space.shape == (3, *envs.single_observation_space.shape)
    observations, rewards, terminated, truncated, infos = envs.step(envs.action_space.sample())
    assert observations in envs.observation_space
    assert [array.dtype for array in (rewards, terminated, truncated)] == [np.float64, np.bool_, np.bool_]
    assert [array.shape for array in (rewards, terminated, truncated)] == [(3,)] * 3
    assert isinstance(infos, dict)
    envs.close()
    assert envs.closed


@pytest.mark.parametrize("name", IDS)
def test_gymnasiums_vector_wrappers_work(name):
    envs = NormalizeObservation(RecordEpisodeStatistics(gym.make_vec(name, num_envs=3, max_episode_steps=9)))
    envs.reset(seed=0)
    for _ in range(8):
        *_, infos = envs.step(envs.action_space.sample())
        assert "episode" not in infos
    *_, infos = envs.step(envs.action_space.sample())
    assert infos["episode"]["l"].tolist() == [9, 9, 9]


@pytest.mark.parametrize("name", IDS)
def test_returned_arrays_are_the_callers(name):
    """What a step returned stays as it was when the environment goes on."""
    single, batch = gym.make(name), gym.make_vec(name, num_envs=2)
    for env in (single, batch):
        env.action_space.seed(1)
        kept = [env.reset(seed=0)[0], *(env.step(env.action_space.sample())[0] for _ in range(5))]
        copies = [array.copy() for array in kept]
        env.step(env.action_space.sample())
        assert all((array == copied).all() for array, copied in zip(kept, copies, strict=True))
        assert not any(np.shares_memory(kept[-1], array) for array in kept[:-1])


# The observation table in the docstring


def documented_observations() -> list[tuple[int, str, str]]:
    rows = re.findall(r"^ *\| (\d+) \| (.*?) \| (.*?) \|$", AirHockeyEnv.__doc__, flags=re.MULTILINE)
    return [(int(index), what, scale) for index, what, scale in rows]


def truth(env, what: str, scale: str) -> float:
    """The documented number, worked out from positions, velocities and the table alone."""
    table = env.table
    scales = {
        "half length": 0.5 * table.length,
        "half width": 0.5 * table.width,
        "paddle's greatest speed": table.paddle_speed,
        "puck's greatest speed": table.puck_speed,
    }
    piece, velocity, axis = re.fullmatch(r"(own paddle|opponent's paddle|puck)( velocity)? (x|y)", what).groups()
    disc = ("own paddle", "opponent's paddle", "puck").index(piece)
    values = env.velocities if velocity else env.positions
    return values[disc, "xy".index(axis)] / scales[scale]


def test_observation_table_in_the_docstring_is_true():
    rows = documented_observations()
    assert [index for index, _, _ in rows] == list(range(13))
    *motion, (_, clock, clock_scale) = rows
    assert clock.startswith("shot clock") and clock_scale == "7 s"
    for table in ("full_size", "challenge"):
        env = AirHockeyEnv(opponent="random", table=table)
        observation, _ = env.reset(seed=3)
        rng = np.random.default_rng(0)
        for step in range(200):
            observation, _, over, _, _ = env.step(pursue(observation[None])[0] if step % 2 else rng.uniform(-1, 1, 2))
            expected = [truth(env, what, scale) for _, what, scale in motion]
            np.testing.assert_allclose(observation[:12], expected, rtol=1e-6, atol=1e-7)
            if over:
                observation, _ = env.reset()
