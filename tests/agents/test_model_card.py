"""Model cards: the command of a run can be read off its card, and every number is that of a file."""

from __future__ import annotations

import dataclasses
import json
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tyro
import yaml

from agents.training.distill import DistillArgs
from agents.training.model_card import command_line, model_card
from agents.training.ppo import PpoArgs
from agents.training.recipe import TrainArgs
from agents.training.runs import RunFolder
from agents.training.self_play import SelfPlayArgs
from agents.training.train import NOT_KEPT, resolved, train
from agents.training.zoo import ZooArgs
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.tables import FULL_SIZE

RESPONSE = {"kind": "own", "seed": 4, "wins": 60, "losses": 20, "draws": 120}
TASK = {"task": "hit", "episodes": 400, "success_rate": 0.75, "success_rate_95": [0.705, 0.79], "mean_seconds": 1.0}
FILES: dict[str, Any] = {
    "ladder": {
        "ratings": [
            {"player": "striker", "rating": 1000.0, "low": 1000.0, "high": 1000.0},
            {"player": "runs/tiny", "rating": 712.4, "low": 690.2, "high": 731.9},
        ]
    },
    "scorecard": {"player": "runs/tiny", "tasks": [TASK], "hit_shots": {"all": {"on_target": {"count": 3, "of": 8}}}},
    "exploit": {
        "model": "tiny",
        "steps": 5_000_000,
        "responses": [RESPONSE],
        "worst": {"wins": 50, "losses": 30, "draws": 120},
    },
}
"""What the card reads of the files of these commands."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """A short run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("card"))
        args = PpoArgs(
            name="tiny", steps=1024, num_envs=8, n_steps=16, batch_size=64, net_width=8, eval_episodes=2,
            report_episodes=10, video_seconds=0, warmup_steps=0, seed=3,
        )  # fmt: skip
        return RunFolder(train(args).path.absolute())


@pytest.fixture
def results(tmp_path: Path) -> Callable[..., Path]:
    """Write a file of results as JSON."""

    def write(data: Any, name: str = "results.json") -> Path:
        (tmp_path / name).write_text(json.dumps(data))
        return tmp_path / name

    return write


@pytest.mark.parametrize(
    "args",
    [
        PpoArgs(name="plain"),
        PpoArgs(name="a", steps=3_000_000, seed=7, opponent=("striker", "adept"), start="expert", noise=0.25),
        PpoArgs(camera="robots", randomize="tables", action_delay_ms=(10.0, 30.0), stack=4, warmup_steps=100),
        SelfPlayArgs(responses=("own", "scratch"), win_value=0.4, reward="sparse"),
        DistillArgs(steps=1_000_000, teacher="adept", camera="slow", stack=4),
        ZooArgs(algo="sac", env="AirHockeyDefend-v0", eval_every=1000),
    ],
    ids=lambda args: type(args).__name__,
)
def test_the_command_has_the_options_of_the_run(args: TrainArgs) -> None:
    args = resolved(args)
    program, command = command_line(args).split(" --", 1) if " --" in command_line(args) else (command_line(args), "")
    read = tyro.cli(type(args), args=shlex.split(f"--{command}") if command else [])
    assert program.startswith("python -m scripts.")
    assert resolved(read) == args


def test_the_command_leaves_defaults_out() -> None:
    assert command_line(resolved(PpoArgs(name="plain"))) == "python -m scripts.train_ppo --name plain"
    given = ZooArgs(algo="td3", env="AirHockeyDefend-v0", seed=2)
    assert command_line(resolved(given)) == "python -m scripts.train --seed 2 --algo td3 --env AirHockeyDefend-v0"


def test_a_card_has_what_the_run_has(run: RunFolder) -> None:
    card = model_card(run)
    head, text = card.removeprefix("---\n").split("---\n", 1)
    assert yaml.safe_load(head)["library_name"] == "stable-baselines3"
    history = json.loads(run.evaluations.read_text())
    assert f"{history['evaluations'][-1]['steps']:,}" in text
    for row in history["report"]:
        assert f"| `{row['opponent']}` | 10 | {row['wins']} | {row['losses']} | {row['draws']} |" in text
    assert "13 to 8 to 8 to 2 (relu), " in text
    assert "--seed 3" in text
    assert "Stable-Baselines3 2" in text


def test_results_of_other_commands(run: RunFolder, results: Callable[..., Path]) -> None:
    card = model_card(run, **{name: results(data, f"{name}.json") for name, data in FILES.items()})
    for part in ("712 (690 to 732", "place 2 of 2", "| hit | 400 | 75.0% (70.5-79.0) |", "37.5%", "5,000,000 steps",
                 "62.5%", "| its own network | 4 | 60 | 20 | 120 | 75.0%"):  # fmt: skip
        assert part in card, part


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("fault", ["other player", "damaged", "missing"])
def test_files_that_do_not_fit(run: RunFolder, results: Callable[..., Path], name: str, fault: str) -> None:
    path = results(json.loads(json.dumps(FILES[name]).replace("tiny", "somebody")))
    if fault == "damaged":
        path.write_text("{}")
    elif fault == "missing":
        path.unlink()
    with pytest.raises(FileNotFoundError if fault == "missing" else ValueError, match=r"results\.json") as error:
        model_card(run, **{name: path})
    assert ("somebody" if fault == "other player" else f"--{name} must") in str(error.value)


def test_nothing_to_share(run: RunFolder, results: Callable[..., Path]) -> None:
    scorecard = {**FILES["scorecard"], "hit_shots": {"all": {"on_target": {"count": 0, "of": 0}}}}
    exploit = {**FILES["exploit"], "worst": {"wins": 0, "losses": 0, "draws": 200}}
    card = model_card(run, scorecard=results(scorecard), exploit=results(exploit, "exploit.json"))
    assert "did not shoot" in card
    assert "wins nothing" in card


def test_a_run_in_the_current_folder_and_one_that_was_stopped(run: RunFolder, tmp_path: Path) -> None:
    copy = tmp_path / "tiny"
    copy.mkdir()
    for file in (run.model, run.policy):
        (copy / file.name).write_bytes(file.read_bytes())
    config, history = (json.loads(file.read_text()) for file in (run.config, run.evaluations))
    (copy / run.config.name).write_text(json.dumps({**config, "steps": 5_000_000}))
    (copy / run.evaluations.name).write_text(json.dumps({**history, "practice": 512}))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(copy)
        card = model_card(RunFolder(Path()))
    assert "# tiny" in card
    assert f"{history['evaluations'][-1]['steps']:,} of 5,000,000, 512 of them for shooting practice" in card


def test_a_policy_with_foresight(run: RunFolder, tmp_path: Path) -> None:
    for file in (run.config, run.model, run.evaluations):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    MlpPolicy([np.ones((2, 43))], [np.zeros(2)], foresight=FULL_SIZE).save(tmp_path / run.policy.name)
    assert "43 to 2 (tanh), 30 of the inputs foreseen" in model_card(RunFolder(tmp_path))


def test_a_damaged_report(run: RunFolder, tmp_path: Path) -> None:
    for file in (run.config, run.model, run.policy):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    history = json.loads(run.evaluations.read_text())
    copy = RunFolder(tmp_path)
    copy.evaluations.write_text(json.dumps({**history, "report": [{"opponent": "striker", "wins": -1}]}))
    with pytest.raises(ValueError, match=r"evaluations\.json"):
        model_card(copy)


def test_a_run_of_a_task(run: RunFolder, tmp_path: Path) -> None:
    args = dataclasses.replace(resolved(ZooArgs(name="hits")), hyperparams=Path("my own.yml"))  # which is gone
    assert args.section is not None
    own = {**args.section, "n_timesteps": 1234}
    copy = RunFolder(tmp_path)
    for file in (run.model, run.policy):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    copy.evaluations.write_text(json.dumps({"practice": None, "evaluations": [], "report": [TASK]}))
    for section, command in (
        (args.section, "--name hits"),
        (own, f"--name hits --steps {args.steps} --hyperparams 'my own.yml'"),
    ):
        config = dataclasses.asdict(dataclasses.replace(args, section=section))
        kept = {name: value for name, value in config.items() if name not in NOT_KEPT}
        copy.config.write_text(json.dumps({"command": "train", **kept}, default=str))
        card = model_card(copy)
        assert f"`python -m scripts.train {command}`" in card
        assert "| episodes of `AirHockeyHit-v0` at the end of training |" in card
        assert "| 400 | 75.0% (70.5-79.0) |" in card
        assert "--task hit" in card and "opponent=" not in card
        assert yaml.safe_load(card.split("---\n")[1])["tags"][0] == "AirHockeyHit-v0"
