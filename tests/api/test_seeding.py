"""Seeds and random streams: what a seed decides, and whose stream goes on without one."""

from __future__ import annotations

from functools import partial

import gymnasium as gym
import numpy as np
import pytest

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.kernel.scripted import SCRIPTED
from airhockey_env.parallel_env import AirHockeyParallelEnv
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.helpers import play, same

BIG = [2**31, 2**32 + 1, 2**63, 2**64, 2**64 + 1, 10**40]


@pytest.mark.parametrize("make", [AirHockeyParallelEnv, *(partial(AirHockeyEnv, opponent=o) for o in SCRIPTED)])
def test_a_seed_decides_everything_whatever_was_played_before(make):
    """Regression: the present action of the random opponent outlived the episode."""
    first, second = make(), make()
    runs = [(env.reset(seed=12345), play(env, 300)) for env in (first, second, first)]
    assert same(runs[0], runs[1]) and same(runs[0], runs[2])


def test_large_seeds_are_told_apart():
    starts = {AirHockeyEnv().reset(seed=seed)[0].tobytes() for seed in [0, 1, *BIG]}
    assert len(starts) == len(BIG) + 2


def test_different_seeds_differ_and_resets_without_a_seed_go_on():
    env = AirHockeyEnv()
    episodes = [env.reset(seed=3)[0]] + [env.reset()[0] for _ in range(20)]
    assert len({episode.tobytes() for episode in episodes}) == 21
    assert same(episodes, [env.reset(seed=3)[0]] + [env.reset()[0] for _ in range(20)])
    assert len({env.reset(seed=seed)[0].tobytes() for seed in range(200)}) == 200


def test_without_any_seed_runs_differ():
    def starts(make):
        return [make().reset() for _ in range(2)]

    assert not same(*(start[0] for start in starts(AirHockeyEnv)))
    assert not same(*(start[0] for start in starts(AirHockeyParallelEnv)))
    for first, second in (
        (start[0] for start in starts(lambda: AirHockeyVectorEnv(100))),
        starts(lambda: AirHockeySB3VecEnv(100)),
    ):
        assert len({row.tobytes() for row in (*first, *second)}) == 200


def test_numpy_integers_are_seeds_too():
    env, envs = AirHockeyEnv(), AirHockeyVectorEnv(2)
    assert same(env.reset(seed=np.int64(7)), env.reset(seed=7))
    assert same(envs.reset(seed=np.array([7, 8]))[0], envs.reset(seed=[7, 8])[0])


def test_gymnasiums_generator_is_seeded():
    env, envs = AirHockeyEnv(), AirHockeyVectorEnv(2)
    for one in (env, envs):
        one.reset(seed=11)
        assert one.np_random_seed == 11
        assert one.np_random.bit_generator.state == gym.utils.seeding.np_random(11)[0].bit_generator.state


@pytest.mark.parametrize("seed", [0, 2**64 - 1])
def test_batch_seeds_count_up(seed):
    envs = AirHockeyVectorEnv(3)
    singles = np.stack([AirHockeyEnv().reset(seed=seed + i)[0] for i in range(3)])
    assert same(envs.reset(seed=seed)[0], singles)
    assert same(envs.reset(seed=[seed, seed + 1, seed + 2])[0], singles)


def test_none_in_a_list_lets_the_stream_go_on():
    envs = AirHockeyVectorEnv(3)
    envs.reset(seed=1)
    mixed = envs.reset(seed=[50, None, 2**70])[0]
    single = AirHockeyEnv()
    single.reset(seed=2)
    assert same(mixed[1], single.reset()[0])
    assert same(mixed[0], AirHockeyEnv().reset(seed=50)[0])
    assert same(mixed[2], AirHockeyEnv().reset(seed=2**70)[0])


def test_none_in_the_first_list_is_drawn():
    first, second = AirHockeyVectorEnv(2).reset(seed=[4, None])[0], AirHockeyVectorEnv(2).reset(seed=[4, None])[0]
    assert same(first[0], second[0]) and not same(first[1], second[1])


def test_stable_baselines_seed_is_for_the_next_reset():
    sb3 = AirHockeySB3VecEnv(3)
    assert list(sb3.seed(8)) == [8, 9, 10]
    first, second = sb3.reset(), sb3.reset()
    assert not same(first, second)
    sb3.seed(8)
    assert same(sb3.reset(), first) and same(sb3.reset(), second)
    assert same(first, AirHockeyVectorEnv(3).reset(seed=8)[0])
