"""States that are put back: what is seen of them, through every face."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.parallel_env import AGENTS, AirHockeyParallelEnv
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.helpers import pursue, random_actions, same, shown

VARIANTS = [
    {},
    {"obs_type": "rgb"},
    {"obs_type": "grayscale", "reward": "shaped"},
    {"randomize": {"width": (1.0, 1.2), "goal_width": (0.3, 0.5)}},
    {"randomize": {"width": (1.0, 1.2), "goal_width": (0.3, 0.5)}, "obs_type": "rgb"},
]
ROWS = 5


def moments(env, reset, step, steps=90, every=4):
    """(state, the observations that `reset` or `step` returned in it) now and then; both may be of many tables."""
    first = reset()
    seen = [(env.get_state(), first)]
    for k in range(steps):
        observations = step(k)
        assert same(env.observe(), observations)
        if k % every == 0:
            seen.append((env.get_state(), observations))
    return seen


def batch(make, **arguments):
    """Moments of a batch, and another one of the same kind that has played something else."""
    envs, other = make(ROWS, **arguments), make(ROWS, **arguments)
    drawn = random_actions(1, 90, ROWS)
    if make is AirHockeySB3VecEnv:
        envs.seed(3)
        other.seed(8)
        found = moments(envs, envs.reset, lambda k: envs.step(drawn[k])[0])
        other.reset()
    else:
        found = moments(envs, lambda: envs.reset(seed=3)[0], lambda k: envs.step(drawn[k])[0])
        other.reset(seed=8)
    return found, other


@pytest.mark.parametrize("arguments", VARIANTS, ids=shown)
def test_one_table(arguments):
    env, other = (AirHockeyEnv(task="match", **arguments) for _ in range(2))
    drawn = random_actions(1, 90, 1)[:, 0]
    found = moments(env, lambda: env.reset(seed=3)[0], lambda k: env.step(drawn[k])[0])
    assert len({observation.tobytes() for _, observation in found}) > 15
    for state, observation in reversed(found):
        other.set_state(state)
        assert same(other.observe(), observation)
        assert other.observe() in other.observation_space


@pytest.mark.parametrize("arguments", VARIANTS, ids=shown)
def test_two_players(arguments):
    env, other = (AirHockeyParallelEnv(task="match", **arguments) for _ in range(2))
    drawn = random_actions(1, 90, 2)
    found = moments(env, lambda: env.reset(seed=3)[0], lambda k: env.step(dict(zip(AGENTS, drawn[k], strict=True)))[0])
    for state, observations in reversed(found):
        other.set_state(state)
        assert same(other.observe(), observations)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("arguments", [*VARIANTS, {"opponent": pursue}], ids=shown)
def test_a_batch(arguments, mode):
    found, other = batch(AirHockeyVectorEnv, autoreset_mode=mode, max_episode_steps=33, **arguments)
    for state, observations in reversed(found):
        other.set_state(state)
        assert same(other.observe(), observations)
    for chosen in ([3, 1], np.array([4]), 2, [0, 1, 2, 3, 4]):
        kept, (state, observations) = other.observe(), found[5]
        rows = np.atleast_1d(chosen)
        other.set_state(state[rows], chosen)
        assert same(other.observe(chosen), observations[rows])
        rest = np.setdiff1d(np.arange(ROWS), rows)
        assert same(other.observe()[rest], kept[rest])


@pytest.mark.parametrize("arguments", VARIANTS, ids=shown)
def test_a_batch_for_stable_baselines(arguments):
    found, other = batch(AirHockeySB3VecEnv, max_episode_steps=33, **arguments)
    for state, observations in reversed(found):
        other.set_state(state)
        assert same(other.observe(), observations)
    assert same(other.observe([2]), found[0][1][2:3])
    assert same(np.stack(other.env_method("observe")), found[0][1])


def test_what_is_returned_is_the_callers():
    for env in (AirHockeyEnv(), AirHockeyVectorEnv(2), AirHockeyVectorEnv(2, obs_type="rgb")):
        first = env.reset(seed=0)[0].copy()
        env.observe()[:] = 0
        assert same(env.observe(), first)


def test_there_is_nothing_to_see_before_an_episode():
    game = AirHockeyParallelEnv()
    for env in (AirHockeyEnv(), game, AirHockeyVectorEnv(2), AirHockeySB3VecEnv(2)):
        with pytest.raises(ResetNeeded, match="before observe"):
            env.observe()
        env.reset()
        env.observe()
    envs = AirHockeyVectorEnv(2)
    envs.reset(seed=0, options={"reset_mask": np.array([True, False])})
    assert envs.observe([0]).shape == (1, 13)
    with pytest.raises(ResetNeeded, match="before observe"):
        envs.observe([1])
