"""Models that see pictures or stacks of observations, at the table as in their training."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.vec_env import VecEnv, VecFrameStack, VecTransposeImage

from agents.conditions import Conditions
from agents.measuring.evaluation import play_points, play_task
from agents.models import ModelPlayer, ModelPolicy, Sight, in_one_game, join, load_player
from agents.training.train import train
from agents.training.zoo import HYPERPARAMS, ZooArgs
from airhockey_env.cameras import ROBOT
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT
from airhockey_env.live.match import START_PAUSE, LiveMatch
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.helpers import Call

pytestmark = pytest.mark.filterwarnings("ignore:rich is experimental")


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tiny run of scripts.train that sees three rgb pictures."""
    folder = tmp_path_factory.mktemp("pictures")
    text = (HYPERPARAMS / "ppo_pixels.yml").read_text()
    for name, value in (("n_envs", 2), ("n_steps", 4), ("batch_size", 8), ("n_epochs", 1)):
        before = next(line for line in text.splitlines() if line.startswith(f"  {name}:"))
        text = text.replace(before, f"  {name}: {value}")
    (folder / "tiny.yml").write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        args = ZooArgs(
            env="AirHockeyDefend-v0", obs_type="rgb", hyperparams=Path("tiny.yml"), name="tiny", steps=8,
            eval_episodes=2, report_episodes=2, video_seconds=0,
        )  # fmt: skip
        train(args)
    return folder / "runs" / "tiny"


def assert_it_sees(env: VecEnv, game: Game, given: list[np.ndarray]) -> None:
    """Assert that the model that plays on the left is `given` what `env`, with its actions, shows."""
    expected, ended = env.reset(), 0
    for _ in range(90):
        game.step()
        assert given[-1].dtype == expected.dtype
        np.testing.assert_array_equal(given[-1], expected)
        expected, _, dones, _ = env.step(game.pools[LEFT].last_actions)
        ended += int(dones.sum())
    assert ended > 3


@pytest.mark.parametrize(("obs_type", "frames"), [("rgb", 3), ("grayscale", 2), ("grayscale", 1), ("state", 4)])
@pytest.mark.parametrize("first", [True, False])
def test_a_model_sees_what_its_training_shows(obs_type: str, frames: int, first: bool) -> None:
    """At episodes' ends too; `first`: pictures are transposed before they are stacked, which is what scripts.train
    does, or after that, as Stable-Baselines3 does by itself."""
    arguments = {"task": "defend", "opponent": "idle", "max_episode_steps": 40}
    env: VecEnv = AirHockeySB3VecEnv(3, obs_type=obs_type, **arguments)
    transpose = (lambda env: env) if obs_type == "state" else VecTransposeImage
    env = VecFrameStack(transpose(env), frames) if first else transpose(VecFrameStack(env, frames))
    env.seed(5)
    given: list[np.ndarray] = []

    def answer(seen: np.ndarray) -> np.ndarray:
        given.append(seen.copy())
        return np.full((len(seen), 2), 0.3, np.float32)

    policy = ModelPolicy(ModelPlayer(answer, Sight(obs_type, frames)))
    game = Game(
        3, left=policy, right="idle", task="defend", max_episode_steps=40, autoreset_mode=AutoresetMode.SAME_STEP
    )
    policy.join(game)
    game.reset(seed=5)
    assert_it_sees(env, game, given)


@pytest.mark.parametrize(("obs_type", "stack"), [("grayscale", 3), ("state", 4)])
def test_a_model_sees_the_stacks_of_its_training(obs_type: str, stack: int) -> None:
    """With a camera, and at episodes' ends too."""
    arguments = {"task": "defend", "opponent": "idle", "max_episode_steps": 40, "camera": "robot"}
    env = AirHockeySB3VecEnv(3, obs_type=obs_type, stack=stack, **arguments)
    env.seed(5)
    given: list[np.ndarray] = []

    def answer(seen: np.ndarray) -> np.ndarray:
        given.append(seen.copy())
        return np.full((len(seen), 2), 0.3, np.float32)

    policy = ModelPolicy(ModelPlayer(answer, Sight(obs_type, stack=stack)))
    conditions = Conditions(camera=ROBOT)
    game = Game(
        3, left=policy, right="idle", task="defend", max_episode_steps=40, autoreset_mode=AutoresetMode.SAME_STEP,
        **conditions.game_arguments(LEFT),
    )  # fmt: skip
    policy.join(game)
    game.reset(seed=5)
    assert_it_sees(env, game, given)


@pytest.mark.parametrize(("obs_type", "algo"), [("grayscale", "ppo"), ("state", "sac"), ("state", "ppo")])
def test_a_run_with_a_stack_plays_as_it_was_trained(
    obs_type: str, algo: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    args = ZooArgs(
        algo=algo, env="AirHockeyDefend-v0", obs_type=obs_type, name="tiny", steps=8, stack=3, camera="robots",
        eval_episodes=2, report_episodes=2, video_seconds=0,
    )  # fmt: skip
    folder = train(args)
    model = {"ppo": PPO, "sac": SAC}[algo].load(folder.model, device="cpu")
    env = AirHockeySB3VecEnv(4, task="defend", opponent="idle", obs_type=obs_type, stack=3)
    env.seed(2)
    seen = env.reset()
    for _ in range(20):
        seen, *_ = env.step(np.full((4, 2), 0.5, np.float32))
    expected = model.predict(seen, deterministic=True)[0]
    for file in [folder.model] if obs_type == "grayscale" else [folder.model, folder.policy]:
        player = load_player(str(file))
        if isinstance(player, ModelPlayer):
            assert player.sight == Sight(obs_type, stack=3)
            np.testing.assert_allclose(player.answer(seen), expected, atol=1e-5)
        else:
            assert player.stack == 3
            np.testing.assert_allclose(player(seen), expected, atol=1e-5)


def test_the_evaluation_plays_what_the_model_predicts(pictures: Path) -> None:
    player = load_player(str(pictures))
    assert isinstance(player, ModelPlayer)
    assert player.sight == Sight("rgb", frames=3)
    model = PPO.load(pictures / "model.zip", device="cpu")
    answer, rows = player.answer, []

    def checked(seen: np.ndarray) -> np.ndarray:
        actions = answer(seen)
        np.testing.assert_array_equal(actions, model.predict(seen, deterministic=True)[0])
        rows.append(len(seen))
        return actions

    checking = ModelPlayer(checked, player.sight)
    result = play_task(checking, "defend", 2)
    assert result == play_task(player, "defend", 2) and result.episodes == 2
    assert set(rows) == {2}, "both episodes at once"
    rows.clear()
    against = play_points(checking, checking, 2, max_episode_steps=20)
    assert against.points == 2
    assert set(rows) == {1}


def test_both_sides_see_their_own_picture() -> None:
    """On a table that is the same from both sides, mirrored games give mirrored views."""
    seen: dict[str, list[np.ndarray]] = {"left": [], "right": []}

    def player(side: str) -> ModelPolicy:
        def answer(frames: np.ndarray) -> np.ndarray:
            seen[side].append(frames.copy())
            return np.zeros((len(frames), 2), np.float32)

        return ModelPolicy(ModelPlayer(answer, Sight("rgb")))

    left, right = player("left"), player("right")
    game = Game(1, left=left, right=right)
    left.join(game), right.join(game)
    game.reset(seed=0)
    game.step()
    (one,), (other,) = seen["left"], seen["right"]
    assert not np.array_equal(one, other), "the puck is on one side"
    own = (one == np.array([255, 138, 156], np.uint8)[:, None, None]).all(axis=1)
    theirs = (other == np.array([255, 138, 156], np.uint8)[:, None, None]).all(axis=1)
    assert own.any()
    np.testing.assert_array_equal(own[..., 6:, :], theirs[..., 6:, :])  # each has itself on the left, below the clock


def test_the_commands_take_a_run_of_pictures(pictures: Path, tmp_path: Path, call: Call) -> None:
    call("evaluate", str(pictures), "--task", "defend", "--episodes", "2", "--json", "task.json")
    assert json.loads((tmp_path / "task.json").read_text())["results"][0]["episodes"] == 2
    call("ladder", "--only", str(pictures), "idle", "--points", "2", "--json", "ladder.json")
    rated = json.loads((tmp_path / "ladder.json").read_text())["ratings"]
    assert {row["player"] for row in rated} == {"tiny", "idle"}
    call("record_video", str(pictures), "--task", "hit", "--seconds", "0.2", "--out", "hit.gif")
    call("record_video", "idle", "--opponent", str(pictures), "--seconds", "0.2", "--out", "match.gif")
    assert (tmp_path / "hit.gif").read_bytes().startswith(b"GIF")
    assert (tmp_path / "match.gif").read_bytes().startswith(b"GIF")


def test_it_plays_against_a_person(pictures: Path) -> None:
    player = in_one_game(load_player(str(pictures)))
    match = LiveMatch(player, seed=0)
    join(match.game, player)
    match.restart(0.0)
    before = match.positions[1].copy()
    match.advance(START_PAUSE, (0.0, 0.0))
    for k in range(1, 8):
        match.advance(START_PAUSE + 0.05 * k, (0.0, 0.0))
    assert np.isfinite(match.positions).all()
    assert not np.array_equal(match.positions[1], before), "it has moved"


def test_channels_that_may_be_both_are_not_guessed(pictures: Path, tmp_path: Path) -> None:
    alone = tmp_path / "model.zip"
    alone.write_bytes((pictures / "model.zip").read_bytes())
    with pytest.raises(ValueError, match=r"9 channels, which may be rgb or grayscale.*obs_type"):
        load_player(str(alone))
    for kind, frames in (("rgb", 3), ("grayscale", 9)):
        (tmp_path / "config.json").write_text(json.dumps({"obs_type": kind}))
        player = load_player(str(alone))
        assert isinstance(player, ModelPlayer)
        assert player.sight == Sight(kind, frames=frames)
    for config in ('{"obs_type": "sound"}', "{", "[" * 100_000):
        (tmp_path / "config.json").write_text(config)
        with pytest.raises(ValueError, match=r"config\.json"):
            load_player(str(alone))


def test_a_plain_model_and_a_function_by_command(tmp_path: Path, call: Call) -> None:
    env = AirHockeySB3VecEnv(2, continuous=False)
    PPO("MlpPolicy", VecFrameStack(env, 2), n_steps=4, batch_size=8, device="cpu").save(tmp_path / "mine.zip")
    (tmp_path / "my_chaser.py").write_text("def chase(seen):\n    return 5 * (seen[:, 8:10] - seen[:, 0:2])\n")
    printed = call("evaluate", "mine.zip", "--opponent", "my_chaser:chase", "--episodes", "2")
    assert "my_chaser:chase" in printed
    call("record_video", "my_chaser:chase", "--task", "hit", "--seconds", "0.1", "--out", "hit.gif")
