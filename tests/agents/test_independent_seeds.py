"""Runs with neighbouring seeds, and the sessions of one run, share none of their random streams."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stable_baselines3.common.callbacks import BaseCallback

from agents.measuring.evaluation import play_points, play_task
from agents.seeding import PURPOSES, table_seeds
from agents.training.learning import seed_learning
from agents.training.ppo import PpoArgs, make_env, make_model
from agents.training.train import train
from agents.training.zoo import ZooArgs
from airhockey_env.game import Game
from airhockey_env.kernel.random_stream import stream_from_seed
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

SMALL = PpoArgs(num_envs=6, n_steps=4, batch_size=8, net_width=8)


class Look(BaseCallback):
    """Keeps the tables' streams and the first actions of a rollout, as they are when learning begins."""

    def __init__(self) -> None:
        super().__init__()
        self.streams: list[int] = []
        self.actions: Any = None

    def _on_rollout_start(self) -> None:
        if not self.streams:
            tables = self.training_env.unwrapped
            assert isinstance(tables, AirHockeySB3VecEnv)
            self.streams = tables._game.states["stream"].tolist()

    def _on_step(self) -> bool:
        if self.actions is None:
            self.actions = self.locals["actions"].copy()
        return True


def looked(seed: int, begun: int = 0, purpose: str = "training") -> Look:
    model, look = make_model(SMALL, make_env(SMALL)), Look()
    model.num_timesteps = begun
    seed_learning(model, make_env(SMALL), purpose, seed)
    model.learn(1, callback=look, reset_num_timesteps=False)
    return look


def test_seeds_of_512_tables_share_nothing() -> None:
    """Regression: seeds 0, 1 and 2 shared 511 and 510 of the streams of 512 tables."""
    drawn = [
        table_seeds(purpose, seed, 512, *part)
        for purpose in PURPOSES
        for seed in range(5)
        for part in ((), (0,), (1,), (16384,))
    ]
    streams = {int(stream_from_seed(seed)) for seeds in drawn for seed in seeds}
    assert len(streams) == 512 * len(drawn)
    assert not streams & {int(stream_from_seed(seed)) for seed in range(2048)}, "nor those of the environments' seeds"


def test_they_are_the_same_on_every_machine() -> None:
    assert table_seeds("training", 0, 2) == table_seeds("training", 0, 3)[:2]
    assert PURPOSES[:3] == ("actions", "practice", "training")
    expected = np.random.SeedSequence(7, spawn_key=(2, 5)).generate_state(2, np.uint64)
    assert table_seeds("training", 7, 2, 5) == expected.tolist()


def test_streams_when_learning_begins() -> None:
    """After Stable-Baselines3 has seeded the tables in its own way."""
    looks = [looked(0), looked(1), looked(2), looked(0, begun=24), looked(0, purpose="practice")]
    for one, other in combinations(looks, 2):
        assert len(set(one.streams)) == SMALL.num_envs
        assert not set(one.streams) & set(other.streams)
    assert looked(1).streams == looks[1].streams


def test_a_resumed_run_explores_in_another_way() -> None:
    """Regression: a model that is loaded draws the disturbances of its first steps again."""
    first, again, resumed = looked(0), looked(0), looked(0, begun=24)
    np.testing.assert_array_equal(first.actions, again.actions)
    assert (first.actions != resumed.actions).any()


@pytest.fixture
def seeded(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, ...]]:
    """The streams that the game's tables are given."""
    given: list[tuple[int, ...]] = []
    seed = Game.seed

    def note(self: Game, *arguments: Any) -> None:
        seed(self, *arguments)
        given.append(tuple(self.states["stream"].tolist()))

    monkeypatch.setattr(Game, "seed", note)
    return given


def test_evaluations_share_nothing(seeded: list[tuple[int, ...]]) -> None:
    for seed in (0, 1):
        for purpose in ("progress", "report", "evaluation"):
            play_points("idle", "idle", 6, seed=seed, purpose=purpose, max_episode_steps=2)
        for task in ("hit", "defend"):
            play_task("idle", task, 3, seed=seed)
    assert len(seeded) == 2 * (3 * 2 + 2)
    assert len({stream for streams in seeded for stream in streams}) == 3 * len(seeded)
    assert not {stream for streams in seeded for stream in streams} & set(looked(0).streams)


def test_commands_seed_learning_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seeded: list[tuple[int, ...]]
) -> None:
    """A run of each command begins on the tables of its seed."""
    monkeypatch.chdir(tmp_path)
    Path("tiny.yml").write_text(
        "AirHockeyHit-v0: {policy: MlpPolicy, n_timesteps: 8, n_envs: 2, n_steps: 4, batch_size: 8}"
    )
    first, brief = {}, {"eval_episodes": 2, "report_episodes": 2, "video_seconds": 0}
    for seed in (0, 1):
        seeded.clear()
        train(ZooArgs(hyperparams=Path("tiny.yml"), seed=seed, name=f"a{seed}", **brief))
        train(
            PpoArgs(
                seed=seed, name=f"p{seed}", steps=16, warmup_steps=8, num_envs=2, n_steps=4, batch_size=8, net_width=8,
                **brief,
            )
        )  # fmt: skip
        wanted = [table_seeds("training", seed, 2, 0), table_seeds("practice", seed, 2, 0)]
        wanted.append(table_seeds("training", seed, 2, 8))
        for seeds in wanted:
            assert tuple(int(stream_from_seed(one)) for one in seeds) in seeded
        first[seed] = {stream for streams in seeded for stream in streams}
    assert not first[0] & first[1]


def test_a_vec_env_takes_one_seed_for_each_table() -> None:
    tables = AirHockeySB3VecEnv(3)
    tables.seed([5, 2**63 + 1, 0])
    tables.reset()
    alone = AirHockeySB3VecEnv(1)
    alone.seed(2**63 + 1)
    np.testing.assert_array_equal(alone.reset()[0], tables._game.observations()[1])
    for wrong in ([1, 2], [1, 2, -3], [1, 2, 0.5], "abc"):
        with pytest.raises(ValueError, match="seed must"):
            tables.seed(wrong)  # type: ignore[arg-type]
