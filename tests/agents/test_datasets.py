"""Episodes for data sets: each begins again from its seed or state and plays to the bit, without Minari."""

from __future__ import annotations

import itertools
import math
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import DependencyNotInstalled

from agents.conditions import Conditions
from agents.datasets import episodes as playing
from agents.datasets.describing import default_id
from agents.datasets.episodes import Episode, play_episodes, until
from agents.datasets.human import load_replays, replayed_episodes, setting_of
from agents.datasets.replaying import begin_episode
from agents.datasets.scores import Scores
from agents.datasets.settings import Setting, env_id
from agents.datasets.storage import check_minari
from agents.models import ModelPlayer, Sight, load_player
from airhockey_env.cameras import ROBOT
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.replay import RecordReplay, Replay
from airhockey_env.tables import CHALLENGE, TABLES
from tests.helpers import same, save_match, some_policy

POINT = Setting("point", "striker")


def chase_late(seen: np.ndarray) -> np.ndarray:
    """Towards where the puck is from where the paddle was: actions (N, 2) for two observations, (N, 26)."""
    return 3.0 * (seen[:, 21:23] - seen[:, 0:2])


SETTINGS = {
    "point": POINT,
    "hit": Setting("hit", "idle"),
    "defend": Setting("defend", "idle"),
    "another opponent and table": Setting("point", "goalie", Conditions(CHALLENGE), opponent_skill=0.5),
    "camera, stack and delay": Setting(
        "point", "adept", Conditions(camera=ROBOT, action_delay_ms=(5.0, 30.0)), stack=4
    ),
    "drawn tables": Setting("defend", "idle", Conditions(randomize=dict(TABLES))),
    "another rate": Setting("hit", "idle", control_hz=25.0),
}
PLAYERS = {
    "uniform": None,
    "expert": load_player("expert"),
    "a policy that sees a stack": some_policy(stack=3),
    "a model that sees stacked states": ModelPlayer(
        lambda seen: 3.0 * (seen[:, 21:23] - seen[:, 0:2]), Sight("state", 2)
    ),
}


def assert_plays_again(episode: Episode, setting: Setting) -> None:
    """Play an episode in the environment that the setting's spec makes in another process."""
    env = gymnasium.make(EnvSpec.from_json(setting.spec.to_json()))
    about: dict[str, Any] = {"seed": episode.seed}
    if episode.state is not None:
        about = {"state": np.frombuffer(episode.state.tobytes(), np.uint8)}
    assert same(begin_episode(env, about), episode.observations[0])
    over = False
    for k, action in enumerate(episode.actions):
        assert not over and env.action_space.contains(action)
        observation, reward, terminated, truncated, _ = env.step(action)
        over = terminated or truncated
        assert same(observation, episode.observations[k + 1]) and reward == episode.rewards[k]
    assert over and terminated == episode.terminated


@pytest.mark.parametrize("player", PLAYERS)
@pytest.mark.parametrize("name", SETTINGS)
def test_episodes_play_again_to_the_bit(name: str, player: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(playing, "TABLES", 5)  # so that most of these follow another episode on their table
    setting = SETTINGS[name]
    for episode in itertools.islice(play_episodes(PLAYERS[player], setting, 0), 12):
        assert len(episode) <= setting.max_episode_steps
        assert_plays_again(episode, setting)


def test_episodes_do_not_depend_on_the_number_of_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = list(itertools.islice(play_episodes(PLAYERS["expert"], POINT, 3), 20))
    assert len({episode.seed for episode in expected}) == 20
    for tables in (1, 7):
        monkeypatch.setattr(playing, "TABLES", tables)
        for episode, again in zip(expected, play_episodes(PLAYERS["expert"], POINT, 3), strict=False):
            assert all(map(same, episode[:5], again[:5]))
    other = next(play_episodes(PLAYERS["expert"], POINT, 4))
    assert other.seed not in {episode.seed for episode in expected}


def test_memory_bounds_the_number_of_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = next(play_episodes(PLAYERS["expert"], POINT, 0))
    monkeypatch.setattr(playing, "MOST_BYTES", 1)
    assert all(map(same, expected[:5], next(play_episodes(PLAYERS["expert"], POINT, 0))[:5]))


@pytest.mark.parametrize(("steps", "count"), [(1, 1), (4, 1), (5, 2), (8, 2), (9, 3)])
def test_until_takes_as_many_episodes_as_the_steps_need(steps: int, count: int) -> None:
    one = Episode(np.zeros((5, 13), np.float32), np.zeros((4, 2), np.float32), np.zeros(4), True, 0)
    assert len(list(until(steps, itertools.repeat(one)))) == count


@pytest.mark.parametrize("task", TASKS)
def test_ids_of_tasks(task: str) -> None:
    spec = gymnasium.spec(env_id(task))
    assert spec.kwargs.get("task", "point") == task
    assert Setting(task, TASKS[task].opponent).spec.max_episode_steps == spec.max_episode_steps


def test_default_ids() -> None:
    assert default_id("expert", POINT) == "airhockey/point/expert-v0"
    assert default_id("adept", SETTINGS["hit"]) == "airhockey/hit/medium-v0"
    assert default_id("uniform", Setting("point", "runs/own.1/policy.npz"), ["robot"]) == (
        "airhockey/point/random-own_1-robot-v0"
    )


def test_normalised_scores() -> None:
    scores = Scores(random=-1.0, expert=0.5)
    assert [scores.normalised(score) for score in (-1.0, 0.5, -0.25)] == [0.0, 1.0, 0.5]
    assert math.isnan(Scores(1.0, 1.0).normalised(1.0))


def test_without_minari_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "minari", None)
    with pytest.raises(DependencyNotInstalled, match=r'"\.\[data\]"'):
        check_minari("This needs")


class TestHuman:
    @pytest.fixture
    def saved(self, tmp_path: Path) -> Path:
        """The replay of a match, as the page saves it, that was left in its last point."""
        return save_match(tmp_path / "match.npz", "striker", skill=0.5)

    def test_points_of_a_match_play_again_to_the_bit(self, saved: Path) -> None:
        replays = load_replays("--replays", [saved, saved])
        setting = setting_of(replays)
        assert (setting.task, setting.opponent, setting.opponent_skill) == ("point", "striker", 0.5)
        assert setting.control_hz == replays[0].control_hz
        points = list(replayed_episodes(replays, setting))
        assert len(points) == 6
        assert 0 < sum(map(len, points)) < 2 * len(replays[0])
        for point in points:
            assert point.terminated and np.flatnonzero(point.rewards).tolist() == [len(point) - 1]
            assert_plays_again(point, setting)

    def test_a_trained_opponent_cannot_be_repeated(self, tmp_path: Path) -> None:
        path = save_match(tmp_path / "expert.npz", "expert", skill=1.0, points=1)
        with pytest.raises(ValueError, match=r"expert\.npz"):
            setting_of(load_replays("--replays", [path]))

    def test_all_are_of_one_environment(self, saved: Path, tmp_path: Path) -> None:
        other = save_match(tmp_path / "other.npz", "goalie", skill=0.5, points=1)
        with pytest.raises(ValueError, match=r"other\.npz.*match\.npz"):
            setting_of(load_replays("--replays", [saved, other]))

    def test_discrete_actions_are_refused(self, tmp_path: Path) -> None:
        env = RecordReplay(gymnasium.make("AirHockey-v0", continuous=False), tmp_path / "discrete.npz")
        env.reset(seed=0)
        env.step(3)
        env.close()
        with pytest.raises(ValueError, match="discrete"):
            setting_of([Replay.load(tmp_path / "discrete.npz")])

    def test_a_match_without_a_complete_point(self, tmp_path: Path) -> None:
        replays = load_replays("--replays", [save_match(tmp_path / "short.npz", "striker", skill=1.0, points=0)])
        with pytest.raises(ValueError, match=r"short\.npz"):
            list(replayed_episodes(replays, setting_of(replays)))

    def test_a_damaged_replay_is_refused(self, saved: Path) -> None:
        replay = Replay.load(saved)
        replay.actions[:] *= -1.0
        with pytest.raises(ValueError, match="play"):
            list(replayed_episodes([replay], setting_of([replay])))
