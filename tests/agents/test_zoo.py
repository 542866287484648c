"""Algorithms by name: their files of hyperparameters, tiny runs that go on, and exported policies."""

from __future__ import annotations

import copy
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecFrameStack, VecTransposeImage

from agents.features import SmallCnn
from agents.files import read_yaml
from agents.models import export_policy
from agents.training.checkpoints import BUFFER_ARRAYS
from agents.training.hyperparameters import Hyperparameters
from agents.training.ppo import PpoArgs
from agents.training.train import train
from agents.training.zoo import ALGORITHMS, HYPERPARAMS, ZooArgs, make_env, make_model, parsed, resolve
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.helpers import ROOT, Call

DEFEND = "AirHockeyDefend-v0"

SMALL = {
    "ppo": "{env_kwargs: {reward: shaped}, policy: MlpPolicy, n_timesteps: 32, n_envs: 4, n_steps: 4, batch_size: 8}",
    "sac": "{policy: MlpPolicy, n_timesteps: 60, n_envs: 4, learning_starts: 20, batch_size: 8, buffer_size: 100}",
    "td3": "{policy: MlpPolicy, n_timesteps: 60, n_envs: 4, learning_starts: 20, batch_size: 8, buffer_size: 100,"
    " noise_type: normal, noise_std: 0.2}",
}


def hyperparameters_of(stem: str, env_id: str = DEFEND) -> Hyperparameters:
    """The hyperparameters of a file in agents/hyperparams."""
    return parsed(resolve(ZooArgs(env=env_id, hyperparams=HYPERPARAMS / f"{stem}.yml")))


def small_model(algo: str, **more: Any) -> BaseAlgorithm:
    """With the file's own network, and weights that make it move."""
    hyperparameters = hyperparameters_of(algo)
    hyperparameters.model.update(more)
    model = make_model(algo, hyperparameters, make_env(DEFEND, hyperparameters))
    with torch.no_grad():
        for weights in model.policy.parameters():
            weights.add_(0.2 * torch.randn(weights.shape, generator=torch.Generator().manual_seed(1)))
    return model


@pytest.mark.parametrize(("algo", "sde"), [("ppo", True), ("sac", False), ("sac", True), ("td3", None)])
def test_the_exported_policy_acts_as_the_model(algo: str, sde: bool | None, tmp_path: Path) -> None:
    """SAC's actions are clipped at tanh(2) with gSDE."""
    model = small_model(algo) if sde is None else small_model(algo, use_sde=sde)
    observations = np.random.default_rng(5).uniform(-1.0, 1.0, (200, 13)).astype(np.float32)
    expected, _ = model.predict(observations, deterministic=True)
    assert expected.std() > 0.1
    assert ((np.abs(expected) < 0.99).all(axis=1)).any(), "not all at their ends"
    policy = export_policy(model)
    assert policy.squash == (algo != "ppo")
    policy.save(tmp_path / "policy.npz")
    for one in (policy, MlpPolicy.load(tmp_path / "policy.npz")):
        np.testing.assert_allclose(one(observations), expected, atol=1e-5)


def test_clipped_actions_of_other_networks_are_not_exported() -> None:
    kwargs = {"net_arch": [8], "activation_fn": torch.nn.Tanh}
    model = SAC("MlpPolicy", make_env(DEFEND, hyperparameters_of("sac")), use_sde=True,
                policy_kwargs=kwargs, buffer_size=100)  # fmt: skip
    with pytest.raises(ValueError, match="rectified hidden layers"):
        export_policy(model)


def test_a_policy_file_without_squash(tmp_path: Path) -> None:
    weight, bias = np.zeros((2, 13), np.float32), np.full(2, 0.5, np.float32)
    np.savez(tmp_path / "old.npz", activation="tanh", weight_0=weight, bias_0=bias)
    seen = np.zeros((1, 13), np.float32)
    np.testing.assert_array_equal(MlpPolicy.load(tmp_path / "old.npz")(seen), [[0.5, 0.5]])
    np.testing.assert_allclose(MlpPolicy([weight], [bias], squash=True)(seen), np.tanh([[0.5, 0.5]]), rtol=1e-6)


@pytest.mark.parametrize(
    ("path", "env_id"),
    [(path, env_id) for path in sorted(HYPERPARAMS.glob("*.yml")) for env_id in read_yaml(path)],
    ids=lambda value: getattr(value, "stem", value),
)
def test_every_section_builds_its_model(path: Path, env_id: str) -> None:
    hyperparameters = hyperparameters_of(path.stem, env_id)
    env = make_env(env_id, hyperparameters)
    model = make_model(path.stem.removesuffix("_pixels"), hyperparameters, env)
    action, _ = model.predict(env.reset())
    assert action.shape == (hyperparameters.n_envs, 2)
    assert env.step(action)[0].shape[1:] == ((9, 84, 84) if path.stem.endswith("_pixels") else (13,))


def test_pictures_are_stacked_as_rl_zoo_does() -> None:
    hyperparameters = hyperparameters_of("ppo_pixels", DEFEND)
    assert hyperparameters.frame_stack == 3
    tables = AirHockeySB3VecEnv(2, task="defend", opponent="idle", max_episode_steps=250, obs_type="rgb")
    ours, theirs = make_env(DEFEND, hyperparameters, 2), VecTransposeImage(VecFrameStack(tables, 3))
    assert ours.observation_space == theirs.observation_space
    for env in (ours, theirs):
        env.seed(3)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    actions, ended = np.ones((2, 2), np.float32), 0
    for _ in range(60):
        (seen, _, dones, infos), (expected, _, _, others) = ours.step(actions), theirs.step(actions)
        np.testing.assert_array_equal(seen, expected)
        for row in np.flatnonzero(dones):
            np.testing.assert_array_equal(infos[row]["terminal_observation"], others[row]["terminal_observation"])
        ended += dones.sum()
    assert ended


def test_the_small_network_sees_pictures_from_0_to_1() -> None:
    space = spaces.Box(0, 255, (3, 84, 84), np.uint8)
    network = SmallCnn(space)
    seen = torch.as_tensor(np.random.default_rng(2).integers(0, 256, (2, 3, 84, 84)), dtype=torch.float32)
    expected = network.layers(network.patches(seen / 255.0))
    np.testing.assert_allclose(network(seen).detach(), expected.detach(), atol=1e-5)


class Look(BaseCallback):
    """Keeps what a model is when learning begins."""

    def _on_training_start(self) -> None:
        self.begun = self.model.num_timesteps
        self.parameters = copy.deepcopy(self.model.get_parameters())
        buffer = getattr(self.model, "replay_buffer", None)
        self.buffer = None if buffer is None else {name: getattr(buffer, name).copy() for name in BUFFER_ARRAYS}
        self.size = 0 if buffer is None else buffer.size()

    def _on_step(self) -> bool:
        return True


def tiny_run(algo: str) -> ZooArgs:
    Path("tiny.yml").write_text(f"AirHockeyDefend-v0: {SMALL[algo]}")
    return ZooArgs(
        algo=algo, env=DEFEND, hyperparams=Path("tiny.yml"), name="tiny", seed=3, eval_every=30,
        eval_episodes=2, report_episodes=4, video_seconds=0,
    )  # fmt: skip


@pytest.mark.parametrize("algo", ALGORITHMS)
def test_a_tiny_run_and_going_on_with_it(algo: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder = train(tiny_run(algo))
    saved = ALGORITHMS[algo].load(folder.model, device="cpu")
    history = json.loads(folder.evaluations.read_text(), parse_constant=pytest.fail)
    steps = [row["steps"] for row in history["evaluations"]]
    assert steps[0] == 0 and steps[-1] == saved.num_timesteps >= 32
    assert {row["episodes"] for row in history["evaluations"]} == {2}
    assert [row["episodes"] for row in history["report"]] == [4]
    assert folder.picture.read_bytes().startswith(b"\x89PNG")
    seen = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 13)).astype(np.float32)
    expected, _ = saved.predict(seen, deterministic=True)
    np.testing.assert_allclose(MlpPolicy.load(folder.policy)(seen), expected, atol=1e-5)

    Path("tiny.yml").unlink()  # the run has what it needs
    look = Look()
    train(ZooArgs(resume="tiny", steps=120), callbacks=[look])
    assert look.begun == saved.num_timesteps
    for name, state in saved.get_parameters().items():
        flat, own = (torch.nn.utils.parameters_to_vector(_tensors(one)) for one in (state, look.parameters[name]))
        torch.testing.assert_close(own, flat, rtol=0.0, atol=0.0)
    if look.buffer is not None:
        assert look.size == saved.num_timesteps // 4
        with np.load(folder.buffer) as kept:
            for name in BUFFER_ARRAYS:  # the file goes on where the buffer was
                np.testing.assert_array_equal(kept[name][5 : look.size], look.buffer[name][5 : look.size])
            assert len(kept["rewards"]) == 25 and bool(kept["full"]), "100 steps on 4 tables, then from its beginning"
            assert int(kept["position"]) == 5
    again = ALGORITHMS[algo].load(folder.model, device="cpu")
    assert again.num_timesteps >= 120
    assert again._n_updates > saved._n_updates > 0
    history = json.loads(folder.evaluations.read_text())
    steps = [row["steps"] for row in history["evaluations"]]
    assert steps == sorted(steps) and steps[-1] == again.num_timesteps
    train(ZooArgs(resume="tiny"))  # finished: nothing but the report
    assert json.loads(folder.evaluations.read_text()) == history


def _tensors(state: Any) -> list[torch.Tensor]:
    """All numbers of a state dict, in order."""
    if isinstance(state, torch.Tensor):
        return [state.float()]
    if isinstance(state, dict):
        return [one for value in state.values() for one in _tensors(value)]
    if isinstance(state, (list, tuple)):
        return [one for value in state for one in _tensors(value)]
    return [torch.tensor([float(state)])] if isinstance(state, (int, float)) else []


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a tiny run of SAC."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("finished"))
        return train(tiny_run("sac")).path.absolute()


class TestWhatIsNotResumed:
    @pytest.fixture
    def run(self, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
        monkeypatch.chdir(tmp_path)
        shutil.copytree(finished, tmp_path / "runs" / "tiny")
        return tmp_path / "runs" / "tiny"

    def test_with_other_arguments(self, run: Path, call: Call) -> None:
        """Regression: `--seed 0` was taken for the default, whatever the run's seed."""
        for option in (("--seed", "0"), ("--seed", "5"), ("--algo", "ppo"), ("--eval-episodes", "200")):
            assert f"got {option[0]}" in call("train", "--resume", "tiny", "--steps", "1k", *option, fails=True)
        printed = call("train", "--resume", "tiny", "--steps", "8", "--seed", "3", fails=True)
        assert "--steps must be more, got 8" in printed, "the run's own seed may be given"

    def test_by_another_command(self, run: Path) -> None:
        with pytest.raises(ValueError, match=r"runs.tiny is a run of scripts\.train"):
            train(PpoArgs(resume="tiny"))

    @pytest.mark.parametrize(
        ("name", "value"),
        [("algo", "dreamer"), ("env", None), ("eval_every", 0), ("hyperparams", 1), ("trust", "yes"),
         ("section", None), ("section", {}), ("section", "sac"),
         ("section", {"n_timesteps": 9, "policy": "MlpPolicy", "policy_kwargs": "__import__('os').mkdir('owned')"}),
         ("section", {"n_timesteps": 9, "policy": "MlpPolicy", "env_kwargs": {"wind": 1}})],
    )  # fmt: skip
    def test_a_forged_config(self, name: str, value: Any, run: Path) -> None:
        config = json.loads((run / "config.json").read_text())
        (run / "config.json").write_text(json.dumps({"trust": True, **config, name: value}))
        with pytest.raises(ValueError, match=r"runs.tiny|hyperparameters do not fit"):
            train(ZooArgs(resume="tiny", steps=100))
        assert not Path("owned").exists()

    def test_a_damaged_buffer(self, run: Path) -> None:
        path = run / "replay_buffer.npz"
        with np.load(path) as file:
            kept = dict(file)
        for change in (
            {"position": np.array(100)}, {"position": np.array("x")}, {"rewards": kept["rewards"][:2]},
            {"actions": kept["actions"].astype(np.float64)}, {"observations": np.zeros(3, np.float32)},
            {"full": np.array(True)},
        ):  # fmt: skip
            np.savez(path, **{**kept, **change})
            with pytest.raises(ValueError, match=r"replay_buffer\.npz does not hold"):
                train(ZooArgs(resume="tiny", steps=100))
        path.write_bytes(path.read_bytes()[:1000])
        with pytest.raises(ValueError, match=r"replay_buffer\.npz does not hold"):
            train(ZooArgs(resume="tiny", steps=100))


def test_a_tiny_run_of_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert hyperparameters_of("ppo_pixels").model["policy"] == "CnnPolicy"
    text = (HYPERPARAMS / "ppo_pixels.yml").read_text()
    for name, value in (("n_envs", 2), ("n_steps", 4), ("batch_size", 8), ("n_epochs", 1)):
        before = next(line for line in text.splitlines() if line.startswith(f"  {name}:"))
        text = text.replace(before, f"  {name}: {value}")
    Path("tiny.yml").write_text(text)
    args = ZooArgs(
        env=DEFEND, obs_type="grayscale", hyperparams=Path("tiny.yml"), name="tiny", steps=8,
        eval_episodes=2, report_episodes=2, video_seconds=0.2,
    )  # fmt: skip
    folder = train(args)
    assert folder.video.read_bytes().startswith(b"GIF")
    assert ALGORITHMS["ppo"].load(folder.model, device="cpu").observation_space.shape == (3, 84, 84)
    assert not folder.policy.exists(), "it cannot play without torch"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("AirHockeyHit-v0: {", r"other\.yml"),
        ("", r"--env .*other\.yml"),
        ("AirHockeyHit-v0: {n_timesteps: many}", r"other\.yml.*many"),
        ("AirHockeyHit-v0: {n_timesteps: 9, policy: MlpPolicy, tau: 0.1}", "ppo.*tau"),
    ],
)
def test_a_file_that_does_not_fit_writes_nothing(text: str, message: str, call: Call, tmp_path: Path) -> None:
    (tmp_path / "other.yml").write_text(text)
    assert re.search(message, call("train", "--hyperparams", "other.yml", fails=True))
    assert not (tmp_path / "runs").exists()


@pytest.mark.skipif(importlib.util.find_spec("rl_zoo3") is None, reason='needs the extra "zoo"')
@pytest.mark.parametrize("path", sorted(HYPERPARAMS.glob("*.yml")), ids=lambda path: path.stem)
def test_rl_zoo_reads_the_same_files(path: Path, tmp_path: Path) -> None:
    algo = path.stem.removesuffix("_pixels")
    smaller = ("n_envs:2", "batch_size:8", *(("n_steps:8",) if algo == "ppo" else ("learning_starts:8",)))
    done = subprocess.run(
        [
            *(sys.executable, "-m", "rl_zoo3.train", "--algo", algo, "--env", DEFEND, "--conf-file", path),
            *("--gym-packages", "airhockey_env", "-n", "32", "--eval-freq", "-1", "--log-folder", tmp_path),
            *("--device", "cpu", "--hyperparams", *smaller),
        ],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    # Loading the model here would import rl_zoo3, which replaces Gymnasium's TimeLimit for all tests of this process.
    with zipfile.ZipFile(tmp_path / algo / f"{DEFEND}_1" / f"{DEFEND}.zip") as model:
        assert json.loads(model.read("data"))["num_timesteps"] >= 32
