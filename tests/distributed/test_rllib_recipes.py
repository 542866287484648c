"""The recipes for RLlib: they train, are continued from their checkpoints, and their policies play everywhere."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents.cluster import connect
from agents.models import load_player
from agents.rllib import ppo, self_play
from agents.rllib.ppo import RllibPpoArgs
from agents.rllib.self_play import MODULE, PAST, RllibSelfPlayArgs, module_of
from agents.rllib.train import latest, train
from agents.training.runs import RunFolder
from airhockey_env.opponents.policy import MlpPolicy
from tests.helpers import Call, some_observations, start

pytest.importorskip("ray.rllib", reason="needs RLlib")
torch = pytest.importorskip("torch", reason="needs torch")

SMALL: dict[str, Any] = {
    "steps": 100, "num_envs": 4, "batch": 100, "minibatch": 50, "epochs": 1, "net_width": 8, "learning_rate": 0.01,
}  # fmt: skip
OPTIONS = [word for name, value in SMALL.items() for word in (f"--{name.replace('_', '-')}", str(value))]


@pytest.fixture(scope="module", autouse=True)
def a_ray() -> Iterator[None]:
    """A Ray of two processors, which every test uses."""
    with connect(None, 2):
        yield


@pytest.fixture(autouse=True)
def _in_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def weights_of(config: Any, folder: RunFolder) -> tuple[dict[str, Any], Any]:
    """The weights of all modules of the last checkpoint, and the module or modules, as RLlib itself loads them."""
    algorithm = config.build_algo()
    try:
        algorithm.restore_from_path(str(latest(folder)))
        return algorithm.get_weights(), algorithm.env_runner.module
    finally:
        algorithm.stop()


@pytest.mark.parametrize("script", ["rllib_ppo", "rllib_self_play"])
def test_a_run_is_continued_and_enters_the_ladder(script: str, call: Call) -> None:
    call(script, *OPTIONS, "--name", "own")
    folder = RunFolder(Path("runs/own"))
    first, policy = latest(folder), MlpPolicy.load(folder.policy)
    assert int(first.name.partition("-")[2]) >= 100
    call(script, *OPTIONS, "--name", "own", "--steps", "300")
    assert int(latest(folder).name.partition("-")[2]) >= 300
    assert not first.exists()
    assert not np.array_equal(MlpPolicy.load(folder.policy).weights[0], policy.weights[0])
    assert "own" in call("ladder", "own", "goalie", "--only", "--points", "2", "--json", "ladder.json")
    rated = json.loads(Path("ladder.json").read_text())["ratings"]
    assert {row["player"] for row in rated} == {"own", "goalie"}
    assert "--name" in call(script, *OPTIONS, "--name", "own", "--gamma", "0.9", fails=True)


def test_the_policy_is_that_of_rllib() -> None:
    args = RllibPpoArgs(**SMALL)
    folder = train(args)
    _, module = weights_of(ppo.make_config(args), folder)
    seen = some_observations()
    with torch.no_grad():
        outputs = module.forward_inference({"obs": torch.as_tensor(seen)})["action_dist_inputs"].numpy()
    actions = load_player(str(folder.path))(seen)  # type: ignore[operator]
    np.testing.assert_allclose(actions, outputs[:, :2].clip(-1.0, 1.0), atol=1e-6)
    assert np.abs(actions).max() > 0.0


@pytest.mark.parametrize(("copy_every", "same"), [(1, True), (1000, False)])
def test_the_past_self_is_renewed(copy_every: int, same: bool) -> None:
    args = RllibSelfPlayArgs(**SMALL, copy_every=copy_every)
    weights, _ = weights_of(self_play.make_config(args), train(args))
    layer = "pi.net.mlp.0.weight"
    assert np.array_equal(weights[MODULE][layer], weights[PAST][layer]) == same


def test_both_sides_are_played() -> None:
    class Episode:
        def __init__(self, number: int) -> None:
            self.id_ = f"{number:032x}"

    for number in range(4):
        players = [module_of(agent, Episode(number)) for agent in ("left", "right")]
        assert players == ([MODULE, PAST] if number % 2 == 0 else [PAST, MODULE])


@pytest.mark.skipif(os.name == "nt", reason="sends signals")
def test_ctrl_c_saves(tmp_path: Path) -> None:
    process = start("rllib_ppo", *OPTIONS, "--steps", "1e9", "--name", "long", "--workers", "1", folder=tmp_path)
    try:
        until = time.monotonic() + 200.0
        while not (tmp_path / "runs/long/config.json").exists():
            assert process.poll() is None and time.monotonic() < until
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        printed, _ = process.communicate(timeout=200)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130, printed
    assert "Traceback" not in printed
    assert latest(RunFolder(tmp_path / "runs/long")).is_dir()
    assert (tmp_path / "runs/long/policy.npz").exists()
