"""Distillation: what a student sees, how it imitates a teacher, and how it goes on from there."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces

from agents.conditions import EXACT, Conditions
from agents.files import read_json
from agents.measuring.evaluation import play_task
from agents.models import ModelPlayer, Sight, export_policy, load_player, player_of
from agents.sb3_files import read_model
from agents.sight import PATCH, PATCHES, Centres, StateFromPictures
from agents.training import ppo
from agents.training.distill import SHARES, DistillArgs, build, load_teacher, make_env, make_student, resolve
from agents.training.learning import Falling, seed_tables
from agents.training.noise import set_noise
from agents.training.student import Imitation, Student, imitation_error
from agents.training.student_tables import EXACT_STATE, SEEN, TABLE, StudentTables
from agents.training.train import train
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.trained import trained_policy
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.tables import FULL_SIZE

K = 3
RANGES = {"wall_restitution": (0.7, 0.9), "length": (2.2, 2.4)}
ARGS = DistillArgs(
    num_envs=16, n_steps=8, batch_size=32, n_epochs=1, net_width=16, stack=K, camera="robot", randomize="tables",
    steps=1024, imitation_steps=512, eval_episodes=2, report_episodes=2, video_seconds=0.0, teacher="adept",
)  # fmt: skip
PICTURES = dataclasses.replace(
    ARGS, task="defend", obs_type="grayscale", stack=2, camera=None, randomize=None, steps=256, imitation_steps=128
)
UPDATE = 16 * 8


def tables() -> StudentTables:
    conditions = [EXACT, Conditions(randomize=RANGES, camera={"noise_mm": 5.0})]
    made = StudentTables([ppo.make_tables(ARGS, one, 4) for one in conditions], RANGES)
    made.seed(list(range(8)))
    return made


class TestStudentTables:
    def test_parts_of_an_observation(self) -> None:
        env = tables()
        seen = env.reset()
        for _ in range(5):
            seen, _, _, _ = env.step(np.full((8, 2), 0.5, np.float32))
        assert {name: part.shape for name, part in seen.items()} == {
            SEEN: (8, K, 15),
            EXACT_STATE: (8, 13),
            TABLE: (8, 2),
        }
        assert all(seen[name] in space for name, space in ())
        newest = seen[SEEN][:, -1, :13]
        np.testing.assert_array_equal(newest[:4], seen[EXACT_STATE][:4])
        np.testing.assert_array_equal(newest[4:, :4], seen[EXACT_STATE][4:, :4])  # its own paddle is known
        assert (newest[4:, 8:10] != seen[EXACT_STATE][4:, 8:10]).all()
        np.testing.assert_array_equal(seen[SEEN][:, -1, 13:], 0.5)

    def test_values_of_the_table(self) -> None:
        env = tables()
        drawn = env.reset()[TABLE]
        assert (np.abs(drawn) <= 1.0).all()
        np.testing.assert_allclose(drawn[:4], [[-0.15, 0.62]] * 4, atol=1e-6)  # 0.785 and 2.362
        assert len({tuple(row) for row in drawn[4:].tolist()}) == 4
        assert env.get_attr("table", [0, 5])[1].length == pytest.approx(2.3 + 0.1 * drawn[5, 1])

    def test_every_table_has_its_own_stream(self) -> None:
        env, alone = tables(), ppo.make_tables(ARGS, EXACT, 4)
        alone.seed([0, 1, 2, 3])
        np.testing.assert_array_equal(env.reset()[SEEN][:4], alone.reset())
        for _ in range(200):
            actions = np.ones((8, 2), np.float32)
            seen, rewards, dones, infos = env.step(actions)
            seen_alone, rewards_alone, dones_alone, _ = alone.step(actions[:4])
            np.testing.assert_array_equal(seen[SEEN][:4], seen_alone)
            np.testing.assert_array_equal(rewards[:4], rewards_alone)
            np.testing.assert_array_equal(dones[:4], dones_alone)
            assert not any("terminal_observation" in info for info in infos)
        assert [bool(info) for info in infos] == dones.tolist()

    def test_nothing_can_be_set_or_called(self) -> None:
        with pytest.raises(AttributeError, match="opponent_skill"):
            tables().set_attr("opponent_skill", 0.5)
        with pytest.raises(AttributeError, match="get_state"):
            tables().env_method("get_state")

    def test_shares_of_the_conditions(self) -> None:
        parts: Any = make_env(ARGS).unwrapped
        assert [part.num_envs for part in parts.parts] == [5, 5, 2, 4]
        randomized = [bool(part.table_values(["length"]).std() > 0) for part in parts.parts if part.reset() is not None]
        assert randomized == ["randomize" not in left_out for left_out in SHARES]
        assert sum(SHARES.values()) == pytest.approx(1.0)


def test_values_of_tables() -> None:
    batch = ppo.make_tables(ARGS, EXACT, 3)
    assert batch.table_values(["width", "length"]).tolist() == [[1.144, 2.362]] * 3
    with pytest.raises(ValueError, match=r"names must be one of .*'length'.*, got 'height'"):
        batch.table_values(["height"])


class TestStudent:
    def test_the_error_of_actions_before_clipping(self) -> None:
        labels = torch.tensor([[1.0, -1.0], [1.0, -1.0], [0.2, 0.0], [0.0, 0.0]])
        means = torch.tensor([[3.0, -2.0], [1.0, -1.0], [0.2, 0.0], [0.5, -0.05]], requires_grad=True)
        error = imitation_error(means, labels)
        assert error.item() == pytest.approx((0.5 - 0.05 + 0.5 * 0.05**2 / 0.1) / 8)  # linear from 0.1 on
        error.backward()
        assert means.grad is not None and (means.grad[:3] == 0.0).all() and (means.grad[3] != 0.0).all()

    def test_who_sees_what(self) -> None:
        model = make_student(ARGS)
        seen: dict[str, torch.Tensor] = {
            name: torch.as_tensor(part)
            for name, part in model.env.reset().items()  # type: ignore[union-attr]
        }
        action, value, _ = model.policy(seen, deterministic=True)
        for name, changes_actions in ((SEEN, True), (EXACT_STATE, False), (TABLE, False)):
            other, other_value, _ = model.policy({**seen, name: seen[name] + 0.1}, deterministic=True)
            assert bool((other != action).any()) == changes_actions
            assert bool((other_value != value).any()) != changes_actions

    def test_it_imitates_then_it_does_not(self) -> None:
        model = make_student(dataclasses.replace(ARGS, learning_rate=1e-3, num_envs=64, batch_size=128))
        teacher = trained_policy("adept")
        seed_tables(model.env, list(range(64)))  # type: ignore[arg-type]

        def error() -> float:
            seen: Any = model._last_obs
            labels = torch.as_tensor(teacher(seen[EXACT_STATE]))
            with torch.no_grad():
                means: Any = model.policy.get_distribution(model.policy.obs_to_tensor(seen)[0]).distribution
                return float(imitation_error(means.mean, labels))

        model.learn(64 * 8, callback=Imitation(teacher, 10**6))
        before = error()
        model.learn(60 * 64 * 8, callback=Imitation(teacher, 10**6))
        assert error() < 0.7 * before
        assert model.teacher is None
        log_std = model.policy.state_dict()["log_std"].clone()  # which imitation leaves alone
        model.learn(64 * 8)
        assert (model.policy.state_dict()["log_std"] != log_std).any(), "PPO goes on"

    def test_noise(self) -> None:
        model = make_student(ARGS)
        model.learn(UPDATE)
        set_noise(model, 0.2)
        seen = model.policy.obs_to_tensor(model._last_obs)[0]  # type: ignore[arg-type]
        distribution: Any = model.policy.get_distribution(seen).distribution
        assert distribution.variance.mean().item() ** 0.5 == pytest.approx(0.2, rel=0.01)

    def test_the_exported_policy_acts_as_the_student(self) -> None:
        model = make_student(ARGS)
        model.learn(UPDATE)
        policy = export_policy(model)
        assert policy.stack == K
        seen: Any = model._last_obs
        expected, _ = model.predict(seen, deterministic=True)
        np.testing.assert_allclose(policy(seen[SEEN]), expected, atol=2e-5)


class TestPictures:
    """Students that see grey pictures."""

    def test_who_sees_what(self) -> None:
        model = make_student(PICTURES)
        seen: dict[str, torch.Tensor] = {name: torch.as_tensor(part) for name, part in model.env.reset().items()}  # type: ignore[union-attr]
        assert seen[SEEN].shape == (16, 2, 84, 84) and seen[SEEN].dtype == torch.uint8
        action, value, _ = model.policy(seen, deterministic=True)
        for name, changes_actions in ((SEEN, True), (EXACT_STATE, False)):
            other, other_value, _ = model.policy({**seen, name: seen[name] + 1}, deterministic=True)
            assert bool((other != action).any()) == changes_actions
            assert bool((other_value != value).any()) != changes_actions

    def test_a_run(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """In a task, imitation and then PPO: it plays as the model does, from memory and from its file."""
        monkeypatch.chdir(tmp_path)
        folder = train(dataclasses.replace(PICTURES, name="student", video_seconds=0.1))
        history = json.loads(folder.evaluations.read_text())
        assert {(row["task"], row["episodes"]) for row in history["evaluations"] + history["report"]} == {("defend", 2)}
        assert folder.video.exists() and not folder.policy.exists()

        model = Student.load(folder.model, device="cpu")
        env = make_env(PICTURES)
        seed_tables(env, list(range(16)))
        env.reset()
        for _ in range(8):
            seen: Any = env.step(np.full((16, 2), 0.5, np.float32))[0]
        expected, _ = model.predict(seen, deterministic=True)
        players = player_of(model), load_player("student")
        for player in players:
            assert isinstance(player, ModelPlayer) and player.sight == Sight("grayscale", stack=2)
            np.testing.assert_allclose(player.answer(seen[SEEN]), expected, atol=1e-6)
        assert play_task(players[0], "defend", 4) == play_task(players[1], "defend", 4)

        train(DistillArgs(resume="student", steps=256 + UPDATE))
        assert json.loads(folder.evaluations.read_text())["updates"][-1]["steps"] == 256 + UPDATE

    def test_one_picture_is_not_enough(self) -> None:
        with pytest.raises(ValueError, match=r"--stack .* got 1"):
            resolve(dataclasses.replace(PICTURES, stack=1))

    def test_the_opponent_is_that_of_the_task(self) -> None:
        for task, attended in (("defend", False), ("point", True)):
            env = make_env(dataclasses.replace(PICTURES, task=task))
            before: Any = env.reset()
            for _ in range(3):
                after: Any = env.step(np.zeros((16, 2), np.float32))[0]
            moved = (after[EXACT_STATE][:, 4:6] != before[EXACT_STATE][:, 4:6]).any()
            assert moved == attended


class TestStateFromPictures:
    @pytest.fixture
    def pictures(self) -> np.ndarray:
        """Stacks of two pictures of three tables."""
        env = AirHockeySB3VecEnv(3, obs_type="grayscale", stack=2)
        env.seed(1)
        env.reset()
        for _ in range(20):
            pictures, *_ = env.step(np.ones((3, 2), np.float32))
        return pictures

    def test_centres_of_the_patches_that_differ(self, pictures: np.ndarray) -> None:
        network = Centres(FULL_SIZE, width=5)
        expected, count = np.zeros((3, 2, 15)), 0
        for table, k in np.ndindex(3, 2):
            total, moments = np.zeros(5), np.zeros((2, 5))
            for i, j in np.ndindex(PATCHES, PATCHES):
                area = slice(PATCH * i, PATCH * (i + 1)), slice(PATCH * j, PATCH * (j + 1))
                difference = pictures[table, k][area].astype(float) - network.empty.numpy()[area]
                if difference.any():
                    x, y = j / 10.0 - 1.0, i / 10.0 - 1.0
                    row = torch.tensor([*(difference.flatten() / 128.0), x, y], dtype=torch.float32)
                    weights = network.weigh(row).detach().numpy()
                    total, moments = total + weights, moments + np.outer([x, y], weights)
                    count += 1
            expected[table, k] = np.concatenate([0.1 * total, *(moments / (total + 0.01))])
        assert 6 * 6 < count < 6 * 40, "most of them show the empty table"
        expected[:, 0] = 4.0 * (expected[:, 1] - expected[:, 0])
        seen = network(torch.as_tensor(pictures)).detach().numpy()
        np.testing.assert_allclose(seen, expected.reshape(3, 30), atol=1e-4)

    def test_pictures_of_the_empty_table(self) -> None:
        network = Centres(FULL_SIZE, width=5)
        assert (network(network.empty.expand(2, 3, 84, 84)) == 0.0).all()

    def test_it_learns_where_the_puck_is(self, pictures: np.ndarray) -> None:
        space = spaces.Box(0, 255, (2, 84, 84), np.uint8)
        network, model = StateFromPictures(space), make_student(PICTURES)
        assert network(torch.as_tensor(pictures)).shape == (3, 17)
        as_numbers = network(torch.as_tensor(pictures).float())
        torch.testing.assert_close(as_numbers, network(torch.as_tensor(pictures)))

        seed_tables(model.env, list(range(16)))  # type: ignore[arg-type]

        def error() -> float:
            seen, _ = model.policy.obs_to_tensor(model._last_obs)  # type: ignore[arg-type]
            with torch.no_grad():
                features: Any = model.policy.extract_features(seen)
                return float((features[:, 8:10] - features[:, 17 + 8 : 17 + 10]).abs().mean())

        model.learn(UPDATE, callback=Imitation(trained_policy("adept"), 10**6))
        before = error()
        model.learn(40 * UPDATE, callback=Imitation(trained_policy("adept"), 10**6))
        assert error() < 0.7 * before


class TestRecipe:
    def test_a_run(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        folder = train(dataclasses.replace(ARGS, name="student"))
        policy = load_player("student")
        assert isinstance(policy, MlpPolicy) and policy.stack == K
        history = json.loads(folder.evaluations.read_text())
        assert [row["opponent"] for row in history["evaluations"]] == ["striker"] * len(history["evaluations"])
        assert {row["steps"] for row in history["updates"]} >= {UPDATE, 1024}
        config = read_json(folder.config)
        assert (config["command"], config["teacher"], config["imitation_steps"]) == ("distill", "adept", 512)

        train(DistillArgs(resume="student", steps=1024 + UPDATE))
        assert json.loads(folder.evaluations.read_text())["updates"][-1]["steps"] == 1024 + UPDATE

        begun = dataclasses.replace(ARGS, start="student", camera="slow")
        ours, theirs = (model.policy.state_dict() for model in (build(begun, True).model, build(begun, False).model))
        kept = read_model(folder.model).params["policy"]
        assert all(torch.equal(ours[name], kept[name]) for name in kept)
        assert not all(torch.equal(theirs[name], kept[name]) for name in kept), "a resumed run loads its own"
        with pytest.raises(ValueError, match=r"--start must name .* --net-width 16, --stack \d, "):
            build(dataclasses.replace(begun, net_width=8), True)

    def test_steps(self) -> None:
        args = resolve(DistillArgs(steps=1000, camera="robot"))
        assert (args.imitation_steps, args.warmup_steps) == (500, 0)
        assert resolve(DistillArgs(steps=1000, imitation_steps=0)).imitation_steps == 0

    def test_the_learning_rate_falls_twice(self) -> None:
        first, second = Falling(1.0, to=0.5, ends=0.5), Falling(1.0, to=0.5, begins=0.5)
        assert [first(remaining) for remaining in (1.0, 0.75, 0.5)] == [1.0, 0.75, 0.5]
        assert [second(remaining) for remaining in (0.75, 0.5, 0.25, 0.0)] == [1.0, 1.0, 0.75, 0.5]

    @pytest.mark.parametrize("name", ["striker", "student"])
    def test_who_cannot_teach(self, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        export_policy(make_student(ARGS)).save(tmp_path / "student.npz")
        with pytest.raises(ValueError, match=f"--teacher .* got '{name}"):
            load_teacher(name if name == "striker" else "student.npz")

    def test_the_student_keeps_no_teacher(self, tmp_path: Path) -> None:
        model = make_student(ARGS)
        model.teacher = trained_policy("adept")
        model.save(tmp_path / "model.zip")
        assert Student.load(tmp_path / "model.zip", device="cpu").teacher is None
