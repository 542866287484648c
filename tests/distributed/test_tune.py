"""The search of hyperparameters: its trials are runs, it can be continued, and its best trial can be repeated."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from agents.training.ppo import PpoArgs
from agents.training.runs import RunFolder
from agents.training.train import train
from agents.training.tune import Outcome, Search, make_search, open_study, run_trials
from agents.training.tune_report import command_line
from tests.helpers import Call

optuna = pytest.importorskip("optuna", reason="needs Optuna")

TINY: dict[str, Any] = {
    "steps": 64, "num_envs": 4, "n_steps": 4, "batch_size": 8, "net_width": 8, "eval_episodes": 2, "report_episodes": 2,
    "eval_every": 32, "video_seconds": 0.0,
}  # fmt: skip
OPTIONS = [word for name, value in TINY.items() for word in (f"--{name.replace('_', '-')}", str(value))]
SPACE = "learning_rate: {low: 1.0e-4, high: 1.0e-2, log: true}\nn_epochs: {choices: [1, 2]}\n"


@pytest.fixture(autouse=True)
def _in_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("space.yml").write_text(SPACE)
    Path("runs").mkdir()


def tiny_search(**arguments: Any) -> Search:
    search = make_search("train_ppo", PpoArgs(**TINY), "tune", Path("space.yml"), **arguments)
    search.folder.path.mkdir(exist_ok=True)
    return search


def states(study: Any) -> list[str]:
    return [trial.state.name for trial in study.trials]


def test_the_command_and_its_best_trial_again(call: Call) -> None:
    search = ("--space", "space.yml", "--", "train_ppo", *OPTIONS)
    call("tune", "--trials", "2", *search)
    printed = call("tune", "--trials", "4", *search)  # goes on
    assert not RunFolder(Path("runs/tune-4")).config.exists()
    study = open_study(tiny_search())
    assert states(study) == ["COMPLETE"] * 4
    assert "--name" in call("tune", "--space", "space.yml", "--", "train_ppo", *OPTIONS, "--seed", "1", fails=True)

    line = printed[printed.index("python -m scripts.train_ppo") :].split("\n")[0]
    call("train_ppo", *shlex.split(line)[3:], "--name", "again", "--report-episodes", "2", "--video-seconds", "0")
    best = max(study.trials, key=lambda trial: (trial.value, -trial.number))
    assert f"{best.params['learning_rate']}" in line
    assert Path("runs/again/policy.npz").read_bytes() == Path(f"runs/tune-{best.number}/policy.npz").read_bytes()


def test_workers_train_what_one_process_trains(call: Call) -> None:
    printed = call("tune", "--trials", "3", "--workers", "2", "--space", "space.yml", "--", "train_ppo", *OPTIONS)
    assert "python -m scripts.train_ppo" in printed
    search = tiny_search()
    study = open_study(search)
    assert states(study) == ["COMPLETE"] * 3
    assert {trial.params["n_epochs"] for trial in study.trials} <= {1, 2}
    args = search.trial_args(2, study.trials[2].params)
    train(PpoArgs(**{**vars(args), "name": "here"}))
    assert Path("runs/here/policy.npz").read_bytes() == Path("runs/tune-2/policy.npz").read_bytes()


def test_a_trial_that_had_begun_is_continued() -> None:
    search = tiny_search()
    study = open_study(search)
    begun = study.ask({"n_epochs": optuna.distributions.CategoricalDistribution([1, 2])})
    train(search.trial_args(begun.number, begun.params))
    before = Path("runs/tune-0/model.zip").stat().st_mtime_ns
    ends = list(run_trials(search, open_study(search), 2))
    assert [end.number for end in ends] == [0, 1]
    assert Path("runs/tune-0/model.zip").stat().st_mtime_ns == before, "a complete run is left as it is"
    assert states(study) == ["COMPLETE"] * 2


@pytest.mark.parametrize(("prune", "state"), [(True, "PRUNED"), (False, "COMPLETE")])
def test_a_bad_trial_is_stopped_early(prune: bool, state: str) -> None:
    search = tiny_search(prune=prune)
    study = open_study(search)
    for _ in range(5):
        good = study.ask()
        for step in range(3):
            good.report(2.0, step)  # which is more than any run can have
        study.tell(good, 2.0)
    (end,) = run_trials(search, study, 6)
    assert (end.value is None) == prune
    assert states(study)[-1] == state


def test_a_trial_that_fails_does_not_end_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails_once(args: PpoArgs, callbacks: Any) -> Any:
        if args.name == "tune-0":
            raise ValueError("loc must not be NaN")
        return finish(args, callbacks)

    from agents.training import tune

    finish = tune.finish
    monkeypatch.setattr(tune, "finish", fails_once)
    search = tiny_search()
    study = open_study(search)
    first, second = run_trials(search, study, 2)
    assert first == Outcome(0, None, "loc must not be NaN")
    assert second.value is not None
    assert states(study) == ["FAIL", "COMPLETE"]


def test_hyperparameters_of_a_file(call: Call) -> None:
    section = {"policy": "MlpPolicy", "n_timesteps": 60, "n_envs": 4, "learning_starts": 20, "batch_size": 8,
               "buffer_size": 400, "train_freq": 10, "policy_kwargs": "dict(net_arch=[8])"}  # fmt: skip
    Path("tiny.yml").write_text(yaml.safe_dump({"AirHockeyHit-v0": section}))
    Path("space.yml").write_text("tau: {low: 0.01, high: 0.02}\n")
    small = ("--eval-episodes", "2", "--report-episodes", "2", "--eval-every", "30")
    printed = call("tune", "--trials", "1", "--space", "space.yml", "--",
                   "train", "--algo", "sac", "--hyperparams", "tiny.yml", *small)  # fmt: skip
    found = yaml.safe_load(Path("runs/tune/0.yml").read_text())["AirHockeyHit-v0"]
    assert 0.01 <= found.pop("tau") <= 0.02
    assert found == section
    line = printed[printed.index("python -m scripts.train ") :].split("\n")[0]
    assert "--algo sac" in line and "--hyperparams runs/tune/0.yml" in line
    call("train", *shlex.split(line)[3:], "--name", "again", *small, "--video-seconds", "0")
    one, other = (np.load(f"runs/{name}/policy.npz") for name in ("again", "tune-0"))
    assert all(np.array_equal(one[name], other[name]) for name in one)


@pytest.mark.parametrize(
    ("space", "named"),
    [
        ("steps: {low: 1, high: 2}", "steps"),
        ("speed: {low: 1, high: 2}", "speed"),
        ("gamma: {low: 0.9, high: 2.0}", "--gamma"),
        ("gamma: {low: 0.9}", "gamma"),
        ("gamma: [0.9, 0.99]", "gamma"),
        ("gamma: {low: 0.99, high: 0.9}", "gamma"),
    ],
)
def test_a_space_that_does_not_fit(space: str, named: str, call: Call) -> None:
    Path("space.yml").write_text(space)
    assert named in call("tune", "--space", "space.yml", "--", "train_ppo", *OPTIONS, fails=True)
    assert not list(Path("runs").iterdir())


@pytest.mark.parametrize("options", [("--name", "own"), ("--resume", "own"), ("--workers", "2")])
def test_options_that_a_trial_cannot_have(options: tuple[str, ...], call: Call) -> None:
    assert options[0] in call("tune", "--", "train_ppo", *options, fails=True)


def test_the_command_line_has_what_differs() -> None:
    args = PpoArgs(steps=10, opponent=("idle", "goalie"), gamma=0.1 + 0.2, name="own", video_seconds=0.0)
    line = command_line("train_ppo", args)
    assert line == "python -m scripts.train_ppo --steps 10 --opponent idle goalie --gamma 0.30000000000000004"


def test_without_optuna_the_extra_is_named(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    assert "[distributed]" in call("tune", fails=True)
