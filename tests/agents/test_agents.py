"""Agents: evaluation, policies without torch, and the files of a run."""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from collections import deque
from importlib import import_module
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import tyro
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

import airhockey_env  # noqa: F401  registers
from agents.features import relative_features
from agents.files import read_json, write_json
from agents.measuring import evaluation
from agents.measuring.evaluation import Result, TaskResult, play_points, play_task, wilson_interval
from agents.models import export_policy, load_player
from agents.options import check_ranges, read_count
from agents.plots import from_zero, steps_unit, time_unit, with_interval
from agents.seeding import table_seeds
from agents.training import ppo
from agents.training.curves import print_curves
from agents.training.learning import Falling, ProgressBar
from agents.training.ppo import PpoArgs, Practice, make_env, make_model
from agents.training.report import draw_training, print_results
from airhockey_env.actions import DIRECTIONS
from airhockey_env.files import replace
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.tables import FULL_SIZE
from tests.helpers import some_observations, some_policy

SMALL = PpoArgs(num_envs=4, n_steps=4, batch_size=8, net_width=16)


class TestWilsonInterval:
    @pytest.mark.parametrize(
        ("successes", "trials", "low", "high"),
        # R. G. Newcombe, Statistics in Medicine 17 (1998), table I, method 3.
        [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
    )
    def test_published_values(self, successes: int, trials: int, low: float, high: float) -> None:
        assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=5e-5)

    def test_mirror(self) -> None:
        low, high = wilson_interval(3, 17)
        assert wilson_interval(14, 17) == pytest.approx((1.0 - high, 1.0 - low))

    def test_without_trials_nothing_is_known(self) -> None:
        assert wilson_interval(0, 0) == (0.0, 1.0)

    def test_it_stays_from_0_to_1(self) -> None:
        for trials in (1, 2, 1000, 10**9):
            for successes in (0, trials // 2, trials):
                low, high = wilson_interval(successes, trials)
                assert 0.0 <= low <= successes / trials <= high <= 1.0


class TestPlayPoints:
    def test_counts_add_up_and_repeat(self) -> None:
        result = play_points("striker", "goalie", 30, seed=4)
        assert result.points == 30
        assert result.opponent == "goalie"
        assert 0.0 < result.seconds <= 30.0
        assert play_points("striker", "goalie", 30, seed=4) == result
        assert play_points("striker", "goalie", 30, seed=5) != result

    def test_an_odd_number_is_rounded_up(self) -> None:
        assert play_points("random", "idle", 5, max_episode_steps=20).points == 6

    def test_equal_players_are_equal(self) -> None:
        result = play_points("striker", "striker", 600)
        assert abs(result.wins - result.losses) < 4.0 * math.sqrt(result.wins + result.losses)

    def test_nobody_moves_nobody_wins(self) -> None:
        assert play_points("idle", "idle", 8) == Result("idle", 0, 0, 8, 30.0)

    @pytest.mark.parametrize("opponent", ["goalie", "striker", "random"])
    def test_a_callable_plays_both_sides_as_a_scripted_player_does(self, opponent: str) -> None:
        def idle(observations: NDArray[np.float32]) -> NDArray[np.float32]:
            assert observations.dtype == np.float32
            return np.zeros((len(observations), 2), np.float32)

        assert play_points(idle, opponent, 20) == play_points("idle", opponent, 20)

    def test_every_point_has_its_own_table(self, monkeypatch: pytest.MonkeyPatch) -> None:
        whole = play_points("striker", "striker", 22)
        monkeypatch.setattr(evaluation, "TABLES_AT_ONCE", 4)
        assert play_points("striker", "striker", 22) == whole

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [
            ({"opponent": "nobody"}, r"^opponent .*nobody"),
            ({"policy": "nobody"}, r"^policy .*nobody"),
            ({"points": 0}, "^points "),
            ({"opponent_skill": 1.5}, r"^opponent_skill .*1\.5"),
        ],
    )
    def test_bad_arguments(self, arguments: dict, message: str) -> None:
        with pytest.raises(ValueError, match=message):
            play_points(**{"policy": "idle", "opponent": "idle", "points": 2, **arguments})

    def test_a_policy_that_answers_nonsense(self) -> None:
        with pytest.raises(ValueError, match="finite"):
            play_points(lambda seen: np.full((len(seen), 2), np.nan, np.float32), "idle", 2)


class TestPlayTask:
    @pytest.mark.parametrize("task", ["hit", "defend"])
    def test_counts_are_those_of_the_registered_environment(self, task: str) -> None:
        env = gym.make(f"AirHockey{task.capitalize()}-v0")
        successes = failures = timeouts = steps = 0
        for seed in table_seeds("evaluation", 0, 8, TASKS[task].number):
            env.reset(seed=seed)
            over = False
            while not over:
                _, _, terminated, truncated, info = env.step(np.zeros(2, np.float32))
                over = terminated or truncated
                steps += 1
            successes += info["is_success"]
            failures += terminated and not info["is_success"]
            timeouts += not terminated
        assert play_task("idle", task, 8) == TaskResult(task, successes, failures, timeouts, steps / 8 / 50)

    def test_a_callable_plays_as_a_scripted_player_does(self) -> None:
        def idle(observations: NDArray[np.float32]) -> NDArray[np.float32]:
            return np.zeros((len(observations), 2), np.float32)

        assert play_task(idle, "defend", 20) == play_task("idle", "defend", 20)

    def test_every_episode_has_its_own_table(self, monkeypatch: pytest.MonkeyPatch) -> None:
        whole = play_task("striker", "hit", 22)
        monkeypatch.setattr(evaluation, "TABLES_AT_ONCE", 4)
        assert play_task("striker", "hit", 22) == whole

    @pytest.mark.parametrize(
        ("arguments", "message"),
        [({"task": "point"}, "^task "), ({"episodes": 0}, "^episodes "), ({"policy": "nobody"}, "^policy ")],
    )
    def test_bad_arguments(self, arguments: dict, message: str) -> None:
        with pytest.raises(ValueError, match=message):
            play_task(**{"policy": "idle", "task": "hit", "episodes": 2, **arguments})


class TestResult:
    def test_shares(self) -> None:
        result = Result("goalie", wins=6, losses=2, draws=4, seconds=3.5)
        assert (result.points, result.win_rate, result.decided) == (12, 0.5, 0.75)
        data = result.as_dict()
        assert data["win_rate_95"] == list(wilson_interval(6, 12))
        assert data["decided_win_rate_95"] == list(wilson_interval(6, 8))

    def test_printed_in_80_columns(self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("COLUMNS", "80")
        print_results([Result("goalie", 10000, 0, 0, 29.9), Result("striker", 0, 0, 10000, 30.0)], "full_size table")
        printed = capsys.readouterr().out
        assert "100.0% (100.0-100.0)" in printed
        assert "none" in printed
        assert all(len(line) <= 80 for line in printed.splitlines())


class TestMlpPolicy:
    @pytest.mark.parametrize("outputs", [2, 9])
    @pytest.mark.parametrize("activation", ["tanh", "relu"])
    def test_save_and_load(self, tmp_path: Path, outputs: int, activation: str) -> None:
        policy = some_policy(outputs, activation)
        path = tmp_path / "policy.npz"
        policy.save(path)
        loaded = MlpPolicy.load(path)
        np.testing.assert_array_equal(loaded(some_observations()), policy(some_observations()))
        assert loaded.activation == activation
        assert [file.name for file in tmp_path.iterdir()] == ["policy.npz"]

    def test_actions(self) -> None:
        continuous, discrete = some_policy(2)(some_observations()), some_policy(9)(some_observations())
        assert continuous.shape == discrete.shape == (200, 2)
        assert continuous.dtype == discrete.dtype == np.float32
        assert (np.abs(continuous) <= 1.0).all()
        assert {tuple(action) for action in discrete} <= {tuple(direction) for direction in DIRECTIONS}

    @pytest.mark.parametrize("keep", [0.0, 0.3, 0.9, 0.999])
    def test_a_file_that_was_cut_off(self, tmp_path: Path, keep: float) -> None:
        path = tmp_path / "policy.npz"
        some_policy().save(path)
        path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])
        with pytest.raises(ValueError, match=r"policy\.npz does not hold a policy"):
            MlpPolicy.load(path)

    def test_other_files(self, tmp_path: Path) -> None:
        path = tmp_path / "other.npz"
        for write in (
            lambda: path.write_bytes(b"PK\x05\x06" + bytes(18)),
            lambda: np.savez(path, weight_0=np.zeros((2, 13))),
            lambda: np.savez(path, weight_0=np.zeros((2, 12)), bias_0=np.zeros(2), activation="tanh"),
            lambda: np.savez(path, weight_0=np.zeros((2, 13)), bias_0=np.zeros(2), activation="sine"),
            lambda: np.savez(path, weight_0=np.array(["x"], dtype=object), bias_0=np.zeros(2), activation="tanh"),
        ):
            write()
            with pytest.raises(ValueError, match="does not hold a policy"):
                MlpPolicy.load(path)
        for write in (lambda: path.write_text("not a policy"), lambda: np.save(path, np.zeros((2, 13)))):
            write()
            with pytest.raises(ValueError, match=r"a policy: it is not an \.npz file as MlpPolicy\.save writes it$"):
                MlpPolicy.load(path)
        with pytest.raises(FileNotFoundError):
            MlpPolicy.load(tmp_path / "none.npz")

    @pytest.mark.parametrize(
        ("shapes", "activation", "message"),
        [
            ([], "tanh", "weights must be one or more arrays .*, got none"),
            ([(8, 13), (2, 7)], "tanh", "layer 1 must have weights"),
            ([(3, 13)], "tanh", "2 or 9 outputs"),
            ([(2, 13)], "sine", "activation must be one of"),
        ],
    )
    def test_layers_that_do_not_fit(self, shapes: list[tuple[int, int]], activation: str, message: str) -> None:
        weights = [np.zeros(shape, np.float32) for shape in shapes]
        with pytest.raises(ValueError, match=message):
            MlpPolicy(weights, [np.zeros(shape[0], np.float32) for shape in shapes], activation)

    def test_rows_do_not_depend_on_each_other(self) -> None:
        policy, seen = some_policy(), some_observations()
        together = policy(seen)
        for rows in (slice(0, 1), slice(3, 5), slice(7, 200)):
            np.testing.assert_array_equal(policy(seen[rows]), together[rows])
        np.testing.assert_array_equal(policy(np.asfortranarray(seen)), together)

    def test_it_is_the_network(self) -> None:
        for activation, function in (("tanh", np.tanh), ("relu", lambda x: np.maximum(x, 0.0))):
            policy, x = some_policy(2, activation), some_observations().astype(np.float64)
            for weight, bias in zip(policy.weights[:-1], policy.biases[:-1], strict=True):
                x = function(x @ weight.T + bias)
            expected = np.clip(x @ policy.weights[-1].T + policy.biases[-1], -1.0, 1.0)
            np.testing.assert_allclose(policy(some_observations()), expected, atol=2e-6)

    def test_tanh(self) -> None:
        x = np.concatenate([np.linspace(-12.0, 12.0, 2001), np.geomspace(1e-30, 1.0, 500)]).astype(np.float32)
        weight, bias = np.zeros((1, 13), np.float32), np.zeros(1, np.float32)
        weight[0, 0] = 1.0
        last = np.array([[1.0], [0.0]], np.float32)
        policy = MlpPolicy([weight, last], [bias, np.zeros(2, np.float32)])
        seen = np.zeros((len(x), 13), np.float32)
        seen[:, 0] = x
        np.testing.assert_allclose(policy(seen)[:, 0], np.tanh(x.astype(np.float64)), rtol=5e-7)

    def test_it_keeps_its_own_weights(self) -> None:
        weights, biases = [np.ones((2, 13), np.float32)], [np.zeros(2, np.float32)]
        policy = MlpPolicy(weights, biases)
        weights[0][:], biases[0][:] = 5.0, 5.0
        assert (policy.weights[0] == 1.0).all()
        assert (policy.biases[0] == 0.0).all()

    def test_it_plays_as_an_opponent(self) -> None:
        policy = some_policy()
        single = gym.make("AirHockey-v0", opponent=policy)
        batch = gym.make_vec("AirHockey-v0", num_envs=3, opponent=policy)
        single.reset(seed=1)
        batch.reset(seed=1)
        for _ in range(30):
            one, *_ = single.step(np.zeros(2, np.float32))
            many, *_ = batch.step(np.zeros((3, 2), np.float32))
            np.testing.assert_array_equal(one, many[0])
        assert np.abs(one[6:8]).max() > 0.0


class TestStableBaselines3:
    @pytest.fixture(params=[False, True], ids=["", "foresight"])
    def model(self, request):
        import torch

        args = dataclasses.replace(SMALL, foresight=request.param)
        model = make_model(args, make_env(args))
        with torch.no_grad():  # an untrained network hardly moves
            for weights in model.policy.parameters():
                weights.add_(0.3 * torch.randn(weights.shape, generator=torch.Generator().manual_seed(1)))
        return model

    def test_the_exported_policy_acts_as_the_model(self, model, tmp_path: Path) -> None:
        observations = some_observations()
        expected, _ = model.predict(observations, deterministic=True)
        assert expected.std() > 0.1
        np.testing.assert_allclose(export_policy(model)(observations), expected, atol=1e-5)
        model.save(tmp_path / "model.zip")
        player = load_player(str(tmp_path / "model.zip"))
        assert isinstance(player, MlpPolicy)
        np.testing.assert_allclose(player(observations), expected, atol=1e-5)

    def test_a_discrete_policy(self) -> None:
        from stable_baselines3 import PPO

        from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

        env = AirHockeySB3VecEnv(4, continuous=False)
        model = PPO("MlpPolicy", env, n_steps=4, batch_size=8, seed=2, device="cpu")
        chosen, _ = model.predict(some_observations(), deterministic=True)
        np.testing.assert_array_equal(export_policy(model)(some_observations()), DIRECTIONS[chosen])

    @pytest.mark.parametrize("keep", [0.0, 0.5, 0.99])
    def test_a_model_that_was_cut_off(self, model, tmp_path: Path, keep: float) -> None:
        path = tmp_path / "model.zip"
        model.save(path)
        path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])
        with pytest.raises(ValueError, match=r"model\.zip does not hold a model"):
            load_player(str(path))

    def test_a_model_with_damage_inside(self, model, tmp_path: Path) -> None:
        path = tmp_path / "model.zip"
        model.save(path)
        data = bytearray(path.read_bytes())
        data[len(data) // 3 : len(data) // 2] = bytes(len(data) // 2 - len(data) // 3)
        path.write_bytes(data)
        with pytest.raises(ValueError, match=r"model\.zip does not hold a model"):
            load_player(str(path))

    def test_a_model_that_foresees_on_no_table(self, tmp_path: Path) -> None:
        args = dataclasses.replace(SMALL, foresight=True)
        model = make_model(args, make_env(args))
        model.policy.features_extractor.table.fill_(-1.0)
        model.save(tmp_path / "model.zip")
        with pytest.raises(ValueError, match=r"model\.zip does not hold a player.*length"):
            load_player(str(tmp_path / "model.zip"))

    def test_the_features_show_the_puck_from_the_paddle(self) -> None:
        env = gym.make("AirHockey-v0").unwrapped
        seen, _ = env.reset(seed=0)
        features = relative_features(FULL_SIZE) @ seen
        paddle, _, puck = env.positions
        np.testing.assert_allclose(features[13:15], 6.0 * (puck - paddle), atol=1e-5)
        np.testing.assert_allclose(features[15:17], (env.velocities[2] - env.velocities[0]) / 5.0, atol=1e-5)

    def test_the_features_of_a_stack(self) -> None:
        env = gym.make("AirHockey-v0", stack=3, camera="robot")
        env.reset(seed=0)
        for action in ([1.0, 0.5], [-0.5, 0.25], [0.125, 1.0]):
            seen, *_ = env.step(np.array(action, np.float32))
        features = (relative_features(FULL_SIZE, 3) @ seen.ravel()).reshape(3, 19)
        rows = seen[:, :13] @ relative_features(FULL_SIZE).T
        np.testing.assert_allclose(features[2, :17], rows[2], atol=1e-5)
        np.testing.assert_allclose(features[:2, :17], 4.0 * (rows[1:] - rows[:-1]), atol=1e-4)
        np.testing.assert_array_equal(features[:, 17:], [[1.0, 0.5], [-0.5, 0.25], [0.125, 1.0]])


class TestPlayers:
    def test_names_folders_and_files(self, tmp_path: Path) -> None:
        assert load_player("goalie") == "goalie"
        some_policy().save(tmp_path / "policy.npz")
        for name in (tmp_path, tmp_path / "policy.npz"):
            assert isinstance(load_player(str(name)), MlpPolicy)

    def test_a_run_is_known_by_its_name(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        Path("runs/mine").mkdir(parents=True)
        some_policy().save("runs/mine/policy.npz")
        assert isinstance(load_player("mine"), MlpPolicy)

    @pytest.mark.parametrize("name", ["nobody", "", "runs/none", "none.zip"])
    def test_what_is_none_of_these(self, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        with pytest.raises(FileNotFoundError, match="MODEL must be"):
            load_player(name)


class TestFiles:
    def test_a_failure_leaves_the_old_file(self, tmp_path: Path) -> None:
        path = tmp_path / "file"
        path.write_text("old")

        def fail(part: Path) -> None:
            part.write_text("half of the n")
            raise OSError("no space left")

        with pytest.raises(OSError, match="no space"):
            replace(path, fail)
        assert path.read_text() == "old"
        assert list(tmp_path.iterdir()) == [path]

    def test_an_interrupt_leaves_the_old_file(self, tmp_path: Path) -> None:
        path = tmp_path / "file"
        path.write_text("old")

        def interrupt(part: Path) -> None:
            part.write_text("half of the n")
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            replace(path, interrupt)
        assert path.read_text() == "old"
        assert list(tmp_path.iterdir()) == [path]

    def test_success_replaces_it(self, tmp_path: Path) -> None:
        path = tmp_path / "file"
        path.write_text("old")
        replace(path, lambda part: part.write_text("new"))
        assert path.read_text() == "new"
        assert list(tmp_path.iterdir()) == [path]

    def test_json(self, tmp_path: Path) -> None:
        path = tmp_path / "file.json"
        write_json(path, {"numbers": [1, 2.5, math.nan, math.inf], "pair": (True, None)})
        expected = {"numbers": [1, 2.5, None, None], "pair": [True, None]}
        assert json.loads(path.read_text(), parse_constant=pytest.fail) == expected
        assert read_json(path) == expected

    @pytest.mark.parametrize("damaged", [b"", b"{", b"\xff\xfe\x00"])
    def test_damaged_json(self, damaged: bytes, tmp_path: Path) -> None:
        path = tmp_path / "file.json"
        path.write_bytes(damaged)
        with pytest.raises(ValueError, match=r"file\.json is not a JSON file"):
            read_json(path)


class TestReport:
    @pytest.mark.parametrize("number", [0, 1, 30])
    @pytest.mark.parametrize(
        "row", [Result("striker", 0, 0, 3, 30.0).as_dict(), {"success_rate": 0.5, "success_rate_95": [0.4, 0.6]}]
    )
    def test_the_picture_of_a_run_of_any_length(self, row: dict, number: int, tmp_path: Path) -> None:
        history = {
            "practice": number * 50,
            "evaluations": [{"steps": k, "seconds": float(k), **row} for k in range(number)],
            "updates": [{"steps": k * 100, "seconds": k / 2.0, "entropy": 2.8} for k in range(number)],
            "report": [],
        }
        write_json(tmp_path / "evaluations.json", history)
        for kept in (history, read_json(tmp_path / "evaluations.json")):  # as of a run that is resumed
            draw_training(kept, "PPO", tmp_path / "training.png")
            assert (tmp_path / "training.png").read_bytes().startswith(b"\x89PNG")


class TestAxes:
    def test_one_point_is_not_blown_up(self) -> None:
        """Regression: the axis of a run with one evaluation went from 0.104 to 0.114 minutes."""
        axis = Figure().subplots()
        with_interval(axis, [0.109], [0.5], [(0.2, 0.8)], "red", "one")
        from_zero(axis, 0.109)
        assert axis.get_xlim() == pytest.approx((0.0, 1.05 * 0.109))
        (lines,) = [part for part in axis.collections if isinstance(part, LineCollection)]
        np.testing.assert_allclose(lines.get_segments(), [[(0.109, 0.2), (0.109, 0.8)]])

    @pytest.mark.parametrize(
        ("most", "scale", "label"),
        [(0, 1, "steps"), (999, 1, "steps"), (1000, 1e3, "thousand steps"), (2e6, 1e6, "million steps")],
    )  # fmt: skip
    def test_units(self, most: float, scale: float, label: str) -> None:
        assert steps_unit(most) == (scale, label)
        assert [time_unit(seconds)[1] for seconds in (0.0, 119.0, 120.0)] == ["seconds", "seconds", "minutes"]

    def test_curves_fit_80_columns(self, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("COLUMNS", "80")
        rows = [{"steps": 20_004_864, "seconds": 6123.4, **Result("expert", 10_000, 10_000, 10_000, 5.0).as_dict()}]
        print_curves({f"run-with-a-name-{k}": {"seed": 12345, "evaluations": rows} for k in range(2)})
        printed = capsys.readouterr().out
        assert all(len(line) <= 80 for line in printed.splitlines())
        for word in ("run-with-a-name-1", "million", "minutes", "decided", "20.0", "102.1", "10000", "50.0%"):
            assert word in printed


def test_the_progress_bar_ends_at_100_percent(monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: Stable-Baselines3 rounds up to whole rollouts, and the bar went on."""
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    bar = ProgressBar()
    model = make_model(SMALL, make_env(SMALL))
    model.learn(18, callback=bar)
    assert model.num_timesteps == 32
    assert (bar.bar.n, bar.bar.total) == (18, 18)
    model.learn(4, callback=bar, reset_num_timesteps=False)
    assert (bar.bar.n, bar.bar.total) == (36, 36)


@pytest.mark.parametrize(
    ("steps", "successes", "episodes", "goes_on"),
    [(99, 0, 10, True), (100, 0, 10, False), (99, 8, 10, False), (99, 7, 10, True), (99, 9, 9, True)],
)
def test_practice_ends_by_steps_or_by_success(steps: int, successes: int, episodes: int, goes_on: bool) -> None:
    model = make_model(SMALL, make_env(SMALL, "hit", ["idle"]))
    model.ep_success_buffer = deque([True] * successes + [False] * (episodes - successes), maxlen=10)
    practice = Practice(100, success=0.8)
    practice.init_callback(model)
    model.num_timesteps = steps
    assert practice.on_step() == goes_on != practice.over


@pytest.mark.parametrize(
    ("text", "count"),
    [("0", 0), ("1000000", 10**6), ("1_000_000", 10**6), ("1e6", 10**6), ("1E6", 10**6), ("1M", 10**6), ("20k", 20_000),
     ("1.5M", 1_500_000), ("2.5e3", 2500), ("-3", -3), ("1e18", 10**18), ("1B", 10**9), (" 7 ", 7)],
)  # fmt: skip
def test_counts(text: str, count: int) -> None:
    assert read_count(text) == count


@pytest.mark.parametrize(
    "text",
    ["", "many", "1.5", "1e-1", "1e19", "1e999", "inf", "nan", "k", "1kk", "1_", "0x10", "1 000", "1.0001k"],
)
def test_what_is_no_count(text: str) -> None:
    with pytest.raises(ValueError, match="must be"):
        read_count(text)


@pytest.mark.parametrize(
    ("script", "option"),
    [("train_ppo", "--steps"), ("train_ppo", "--eval-episodes"), ("train_self_play", "--snapshot-every"),
     ("train", "--report-episodes"), ("evaluate", "--episodes"), ("ladder", "--points"), ("scorecard", "--episodes"),
     ("play", "--points"), ("torture", "--steps"), ("benchmark", "--rounds")],
)  # fmt: skip
def test_commands_take_counts(
    script: str, option: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = import_module(f"scripts.{script}")
    got: list[Any] = []
    monkeypatch.setattr(module, "run_command", lambda name, kind, *_: got.append(tyro.cli(kind)))
    model = ["idle"] if script in ("evaluate", "scorecard") else []
    monkeypatch.setattr(sys, "argv", [script, *model, option, "1.2k"])
    module.main()
    assert getattr(got[0], option[2:].replace("-", "_")) == 1200
    monkeypatch.setattr(sys, "argv", [script, *model, option, "1.5"])
    with pytest.raises(SystemExit):
        module.main()
    assert option in capsys.readouterr().err


def test_ranges_name_the_option() -> None:
    check_ranges(PpoArgs(), n_steps=(1, math.inf), gamma=(0, 1))
    with pytest.raises(ValueError, match=r"^--n-steps must be a number from 1 .*, got 0$"):
        check_ranges(PpoArgs(n_steps=0), n_steps=(1, math.inf))
    with pytest.raises(ValueError, match=r"^--steps must be a number from 1 .*, got 1000"):
        check_ranges(PpoArgs(steps=10**400), steps=(1, math.inf))
    with pytest.raises(ValueError, match=r"^--gamma must be a number from 0 to 1, got nan$"):
        check_ranges(PpoArgs(gamma=math.nan), gamma=(0, 1))
    with pytest.raises(ValueError, match=r"^--learning-rate must be a number from 0 .*, got inf$"):
        check_ranges(PpoArgs(learning_rate=math.inf), learning_rate=(0, math.inf))


def test_the_learning_rate_falls_after_practice() -> None:
    """Regression: with a small budget it had fallen before practice had taught anything."""
    remaining = (1.0, 0.5, 0.25, 0.0)
    assert list(map(Falling(1e-3), remaining)) == pytest.approx([1e-3, 5e-4, 2.5e-4, 0.0])
    assert list(map(Falling(1e-3, to=0.02), remaining)) == pytest.approx([1e-3, 5.1e-4, 2.65e-4, 2e-5])
    assert list(map(Falling(1e-3, to=0.02, begins=0.5), remaining)) == pytest.approx([1e-3, 1e-3, 5.1e-4, 2e-5])


def test_the_learning_rate_stays_in_a_run_of_practice_alone() -> None:
    """Regression: it divided by zero when the last rollout went beyond the steps of the run."""
    assert list(map(Falling(1e-3, to=0.02, begins=1.0), (1.0, 0.5, 0.0, -0.1))) == [1e-3] * 4


@pytest.mark.parametrize(
    ("steps", "practice"), [(None, 4_000_000), (20_000_000, 4_000_000), (3_000_000, 1_500_000), (1, 0)]
)
def test_practice_takes_half_of_the_steps_at_most(steps: int | None, practice: int) -> None:
    assert ppo.resolve(PpoArgs(steps=steps)).warmup_steps == practice
    assert ppo.resolve(PpoArgs(steps=steps, warmup_steps=7)).warmup_steps == 7
