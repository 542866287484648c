"""Minari: datasets with infos, whose environment is recovered and replays to the bit."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import gymnasium as gym
import minari
import numpy as np
import pytest

from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.tables import PRESETS
from tests.helpers import same

ID = "airhockey_env:AirHockey-v0"
HEAVY = dataclasses.replace(PRESETS["full_size"], puck_mass=0.02)
VARIANTS: dict[str, dict[str, Any]] = {
    "as it is": {},
    "a table's fields": {"table": dataclasses.asdict(HEAVY)},
    "a table": {"table": HEAVY},
    "an opponent's file": {"opponent": "policy.npz"},
    "drawn tables": {"randomize": {"width": (1.0, 1.2)}},
    "discrete": {"continuous": False, "reward": "shaped", "control_hz": 25},
    "pictures": {"obs_type": "rgb"},
}


@pytest.mark.parametrize("name", VARIANTS)
def test_a_dataset_replays_to_the_bit(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    monkeypatch.chdir(tmp_path)
    MlpPolicy([np.ones((2, 13), np.float32)], [np.zeros(2, np.float32)]).save("policy.npz")
    env = gym.make(ID, max_episode_steps=30, **VARIANTS[name])
    env = minari.DataCollector(env, record_infos=True, jpeg_encoding=False)
    for seed in range(3):
        env.reset(seed=seed)
        over = False
        while not over:
            *_, terminated, truncated, _ = env.step(env.action_space.sample())
            over = terminated or truncated
    env.create_dataset("airhockey/test-v0", algorithm_name="noise", description="A test.", code_permalink="none")
    dataset = minari.load_dataset("airhockey/test-v0")
    assert dataset.total_episodes == 3
    recovered = dataset.recover_environment()
    for seed, episode in enumerate(dataset.iterate_episodes()):
        assert_replays(recovered, seed, episode)


def assert_replays(env: gym.Env, seed: int, episode: minari.EpisodeData) -> None:
    observation, info = env.reset(seed=seed)
    for step, action in enumerate(episode.actions):
        assert same(observation, episode.observations[step])
        assert_info(info, episode.infos, step)
        observation, reward, terminated, truncated, info = env.step(action)
        assert (reward, terminated, truncated) == (
            episode.rewards[step],
            episode.terminations[step],
            episode.truncations[step],
        )
    assert same(observation, episode.observations[-1])
    assert_info(info, episode.infos, -1)


def assert_info(info: dict[str, Any], recorded: dict[str, Any], step: int) -> None:
    assert info.keys() == recorded.keys()
    for key, value in info.items():
        if isinstance(value, dict):
            assert_info(value, recorded[key], step)
        else:
            assert same(np.asarray(value), np.asarray(recorded[key][step]))
