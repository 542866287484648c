"""The policies that ship: by name everywhere, the same bits in every face, and each in its place in the order."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest

import airhockey_env
from agents.conditions import Conditions
from agents.measuring.evaluation import OPPONENTS, play_points, play_task
from airhockey_env import AirHockeyVectorEnv
from airhockey_env.cameras import resolve_camera
from airhockey_env.kernel.state import observation_shape
from airhockey_env.opponents.players import NAMES
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.trained import TRAINED, trained_policy
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.helpers import random_actions


def test_the_names() -> None:
    assert TRAINED == ("adept", "expert", "robust")
    assert OPPONENTS == NAMES == ("idle", "random", "goalie", "striker", "adept", "expert", "robust")
    assert [trained_policy(name).stack for name in TRAINED] == [1, 1, 8]


@pytest.mark.parametrize("name", TRAINED)
class TestByName:
    def test_it_is_small_and_moves(self, name: str) -> None:
        policy = trained_policy(name)
        assert isinstance(policy, MlpPolicy)
        assert sum(weight.nbytes for weight in policy.weights) < 300 * 1024
        shape = (100, *observation_shape(policy.stack))
        seen = np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)
        assert policy(seen).std() > 0.1

    def test_every_face_plays_the_same_bits(self, name: str) -> None:
        actions = random_actions(3, 300, 5)
        batch = AirHockeyVectorEnv(5, opponent=name)
        pool = AirHockeyVectorEnv(5, opponent=["striker", name])
        pool.set_opponents(1)
        sb3 = AirHockeySB3VecEnv(5, opponent=name)
        single = gym.make("AirHockey-v0", opponent=name)
        sb3.seed(7)
        single.reset(seed=8)
        first = [batch.reset(seed=7)[0], pool.reset(seed=7)[0], sb3.reset()]
        np.testing.assert_array_equal(first[0], first[1])
        np.testing.assert_array_equal(first[0], first[2])
        alone = True
        for step in actions:
            seen, _, terminated, truncated, _ = batch.step(step)
            other, *_ = pool.step(step)
            np.testing.assert_array_equal(seen, other)
            if alone:
                one, _, over, out, _ = single.step(step[1])
                np.testing.assert_array_equal(one, seen[1])
                alone = not (over or out)
            if (terminated | truncated).any():
                break  # the autoreset modes differ from here on
            np.testing.assert_array_equal(sb3.step(step)[0], seen)
        assert np.abs(seen[:, 6:8]).max() > 0.0, "it moves"

    def test_copies_play_on(self, name: str) -> None:
        env = airhockey_env.AirHockeyEnv(opponent=name)
        env.reset(seed=1)
        for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
            here = copy.deepcopy(env)
            for _ in range(50):
                np.testing.assert_array_equal(twin.step(np.ones(2))[0], here.step(np.ones(2))[0])

    def test_a_game_by_itself(self, name: str) -> None:
        """By its name it plays as its weights do, on either side."""
        by_name, by_weights = play_points(name, "goalie", 20), play_points(trained_policy(name), "goalie", 20)
        assert by_name == by_weights
        assert play_points("striker", name, 20).wins == play_points("striker", trained_policy(name), 20).wins
        assert play_task(name, "hit", 20) == play_task(trained_policy(name), "hit", 20)


def test_a_name_that_does_not_ship() -> None:
    with pytest.raises(ValueError, match=r"opponent must be one of .*'expert', 'robust'.* got 'master'"):
        airhockey_env.AirHockeyEnv(opponent="master")


def test_without_torch() -> None:
    code = (
        "import sys, gymnasium, airhockey_env\n"
        "env = gymnasium.make('AirHockey-v0', opponent='expert')\n"
        "env.reset(seed=0)\n"
        "for _ in range(20): env.step(env.action_space.sample())\n"
        "assert 'torch' not in sys.modules and 'stable_baselines3' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)


@pytest.mark.parametrize(("weaker", "stronger"), [("random", "goalie"), ("idle", "striker"), *pairwise(NAMES[2:-1])])
def test_the_order(weaker: str, stronger: str) -> None:
    """Deterministic, so no test that fails by chance: the points are those of these seeds."""
    result = play_points(stronger, weaker, 400, seed=11)
    assert result.wins > 1.5 * result.losses


@pytest.mark.parametrize("camera", ["robot", "slow"])
def test_cameras_harm_robust_less_than_expert(camera: str) -> None:
    conditions = Conditions(camera=resolve_camera(camera).fields())
    played = [play_points(name, "striker", 400, seed=11, conditions=conditions) for name in ("expert", "robust")]
    assert played[1].decided > played[0].decided + 0.05
