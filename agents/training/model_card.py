"""The model card of a run: what it is, how it was made and what it can do, from the files of training and measuring."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import yaml

from agents.conditions import in_words
from agents.files import COUNT, NUMBER, TEXT, mismatch, or_none, read_json
from agents.measuring.shares import Share
from agents.models import short_name
from agents.options import command_with
from agents.sb3_files import read_versions
from agents.training.checkpoints import TIMES
from agents.training.distill import DistillArgs
from agents.training.hyperparameters import read_section
from agents.training.ppo import EVALUATION
from agents.training.recipe import TASK_EVALUATION, TrainArgs
from agents.training.report import success_rate
from agents.training.runs import RunFolder
from agents.training.start import STRONGEST
from agents.training.train import NOT_KEPT, RECIPES, own_args, resolved
from agents.training.zoo import ZooArgs, default_file
from airhockey_env.opponents.foresight import FORESEEN_SIZE
from airhockey_env.opponents.policy import MlpPolicy

Args = TypeVar("Args", bound=TrainArgs)

COUNTS = {"wins": COUNT, "losses": COUNT, "draws": COUNT}
"""The result of some points, as a pattern of `read_json`."""

TASK = {"task": TEXT, **TASK_EVALUATION}
"""The result of a task in a score card, as a pattern of `read_json`."""

ENVIRONMENTS = {"point": "AirHockey-v0", "hit": "AirHockeyHit-v0", "defend": "AirHockeyDefend-v0"}
"""The environments of the tasks that agents are trained in."""

BEGINNINGS = {"scratch": "an untrained network", "own": "its own network", STRONGEST: f"`{STRONGEST}`"}
"""What the kinds of best responses are begun with."""

DECIDED = "of the decided points (95 %)"

LADDER = {"ratings": [{"player": TEXT, "rating": NUMBER, "low": NUMBER, "high": NUMBER}]}
SCORECARD = {"player": TEXT, "tasks": [TASK], "hit_shots": {"all": {"on_target": {"count": COUNT, "of": COUNT}}}}
EXPLOIT = {"model": TEXT, "steps": COUNT, "responses": [{"kind": TEXT, "seed": COUNT, **COUNTS}], "worst": COUNTS}
"""What is read of the JSON files of `ladder`, `scorecard` and `exploit`, as patterns of `read_json`."""

DECIDING = ("algo", "env", "obs_type", "stack", "hyperparams", "section")
"""Options, of some commands, that decide about the defaults of others. So does the number of steps."""


def model_card(
    folder: RunFolder, *, ladder: Path | None = None, scorecard: Path | None = None, exploit: Path | None = None
) -> str:
    """Write the model card of a run in Markdown, with the metadata that the Hugging Face Hub reads.

    Args:
        folder: a run of any of the training commands.
        ladder, scorecard, exploit: JSON files of these commands, about a player with the name of this run.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: a file is damaged, or is about another player. The message names the file.
    """
    name, args = folder.path.resolve().name, _args(folder)
    env = environment(args)
    history = read_json(folder.evaluations, {"practice": or_none(COUNT), "evaluations": [TIMES], "report": [{}]})
    lines = [
        f"# {name}",
        "",
        f"An agent that plays air hockey, trained with `{RECIPES[type(args)].command}` of airhockey-env.",
        "",
        *_table([("run", f"`{name}`"), ("environment", f"`{env}`"), *_facts(folder, args, history)]),
        *_results(history["report"], folder.evaluations, env),
        *(_rating(ladder, name) if ladder is not None else ()),
        *(_tasks(scorecard, name) if scorecard is not None else ()),
        *(_exploitability(exploit, name) if exploit is not None else ()),
        *(_use(env) if folder.policy.exists() else ()),
    ]
    return _metadata(env) + "\n".join(lines) + "\n"


def environment(args: TrainArgs) -> str:
    """The id of the environment that a run was trained in; for practice before the game, that of the game."""
    if isinstance(args, ZooArgs):
        return args.env.rpartition(":")[2]
    return ENVIRONMENTS[args.task if isinstance(args, DistillArgs) else "point"]


def command_line(args: TrainArgs) -> str:
    """The command that begins a run with these options, without those that have their default values."""
    fields = [field.name for field in dataclasses.fields(args)]
    plain = type(args)()
    defaults = resolved(_like(args, plain))
    if args.steps != defaults.steps:
        defaults = dataclasses.replace(resolved(_like(args, plain, steps=args.steps)), steps=None)
    hidden = {*NOT_KEPT, "conditions", "section"}  # options of a session, and contents of files
    if isinstance(args, ZooArgs) and args.section == _default_section(args):
        hidden.add("hyperparams")
    others = [
        name
        for name in fields
        if name not in hidden and getattr(args, name) != getattr(plain if name in DECIDING else defaults, name)
    ]
    return command_with(RECIPES[type(args)].command, args, others)


def _like(args: Args, plain: Args, **others: Any) -> Args:
    """Options as in `plain`, but with those that decide about defaults. Resolving them reads no file."""
    given = {name: getattr(args, name) for name in DECIDING if hasattr(args, name)}
    return dataclasses.replace(plain, resume="", **given, **others)


def _default_section(args: ZooArgs) -> dict[str, Any] | None:
    with contextlib.suppress(OSError, ValueError):
        return read_section(default_file(args), args.env)
    return None


def _args(folder: RunFolder) -> TrainArgs:
    commands = {recipe.command: args for args, recipe in RECIPES.items()}
    command = read_json(folder.config, {"command": TEXT})["command"]
    if command not in commands:
        raise ValueError(f"{folder.config}: command must be one of {tuple(commands)}, got {command!r}")
    return own_args(commands[command](resume=str(folder.path)))[1]


def _facts(folder: RunFolder, args: TrainArgs, history: dict[str, Any]) -> Iterator[tuple[str, str]]:
    yield "command", f"`{command_line(args)}`"
    if history["evaluations"]:
        last, practice = history["evaluations"][-1], history["practice"]
        assert args.steps is not None
        stopped = f" of {args.steps:,}" if last["steps"] < args.steps else ""
        practised = f", {practice:,} of them for shooting practice" if practice else ""
        yield "environment steps", f"{last['steps']:,}{stopped}{practised}"
        yield "training time", f"{last['seconds'] / 60:.1f} minutes, evaluations left out"
    yield "conditions", in_words(args)
    if folder.policy.exists():
        policy = MlpPolicy.load(folder.policy)
        sizes = " to ".join(str(size) for size in (policy.weights[0].shape[1], *map(len, policy.biases)))
        foreseen = "" if policy.foresight is None else f", {FORESEEN_SIZE} of the inputs foreseen from the others"
        size = f"{folder.policy.stat().st_size / 1024:.0f} KiB"
        yield "network", f"fully connected, {sizes} ({policy.activation}){foreseen}, {size}"
    if versions := read_versions(folder.model):
        yield "versions", ", ".join(f"{library} {version}" for library, version in versions.items())


def _results(report: Sequence[dict[str, Any]], path: Path, env: str) -> Iterator[str]:
    if not report:
        return
    yield from ("", "## Results", "")
    if all(mismatch(row, EVALUATION) is None for row in report):
        yield from ("Points at the end of training, half of them on each side of the table:", "")
        rows = [(f"`{row['opponent']}`", str(row["points"]), *_counts(row)) for row in report]
        yield from _table([("opponent", "points", "wins", "losses", "draws", DECIDED), *rows])
    elif all(mismatch(row, TASK_EVALUATION) is None for row in report):
        rows = [(f"{row['episodes']:,}", success_rate(row)) for row in report]
        yield from _table([(f"episodes of `{env}` at the end of training", "successes (95 %)"), *rows])
    else:
        raise ValueError(f"{path}: report must have results of points or of a task")


def _rating(path: Path, name: str) -> Iterator[str]:
    ratings = _read("ladder", path, LADDER)["ratings"]
    found = [row for row in ratings if short_name(row["player"]) == name]
    if not found:
        raise ValueError(f"{path} must have {name} on its ladder, and has {[row['player'] for row in ratings]}")
    place = ratings.index(found[0]) + 1
    yield from ("", "## Rating", "")
    interval = f"{found[0]['rating']:.0f} ({found[0]['low']:.0f} to {found[0]['high']:.0f}, 95 %)"
    yield f"{interval}, place {place} of {len(ratings)} on a ladder on which 400 points are odds of 10 to 1."


def _tasks(path: Path, name: str) -> Iterator[str]:
    card = _read("scorecard", path, SCORECARD)
    _check_about(path, card["player"], name)
    yield from ("", "## Tasks", "")
    yield from _table(
        [
            ("task", "episodes", "successes (95 %)"),
            *((t["task"], f"{t['episodes']:,}", success_rate(t)) for t in card["tasks"]),
        ]
    )
    on_target = card["hit_shots"]["all"]["on_target"]
    of_shots = f"{Share(on_target['count'], on_target['of'])} of its shots in `hit` are on target."
    yield from ("", of_shots if on_target["of"] else "In `hit`, it did not shoot.")


def _exploitability(path: Path, name: str) -> Iterator[str]:
    found = _read("exploit", path, EXPLOIT)
    _check_about(path, found["model"], name)
    yield from ("", "## Exploitability", "")
    wins, losses = found["worst"]["wins"], found["worst"]["losses"]
    share = f"{Share(wins, wins + losses)} of the decided points" if wins + losses else "nothing, as all are drawn"
    yield f"Agents were trained against this one alone, for {found['steps']:,} steps each. In points other than"
    yield f"those of the table, the most successful one wins {share}."
    yield ""
    rows = [(BEGINNINGS.get(row["kind"], row["kind"]), str(row["seed"]), *_counts(row)) for row in found["responses"]]
    yield from _table([("begun with", "seed", "wins", "losses", "draws", DECIDED), *rows])


def _read(command: str, path: Path, pattern: Any) -> Any:
    """Read the results of a command, which has an option of that name here."""
    try:
        return read_json(path, pattern)
    except OSError as error:
        raise FileNotFoundError(f"--{command} must be a JSON file of scripts.{command}, got {path}: {error}") from error
    except ValueError as error:
        raise ValueError(f"--{command} must be a JSON file of scripts.{command}: {error}") from error


def _check_about(path: Path, player: str, name: str) -> None:
    if short_name(player) != name:
        raise ValueError(f"{path} must be about {name}, and is about {player}")


def _counts(row: dict[str, Any]) -> tuple[str, ...]:
    wins, losses, draws = row["wins"], row["losses"], row["draws"]
    return (*(str(number) for number in (wins, losses, draws)), str(Share(wins, wins + losses)))


def _table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """A table in Markdown; the first row is its head."""
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    yield from (lines[0], "|" + "---|" * len(rows[0]), *lines[1:])


def _use(env: str) -> Iterator[str]:
    yield from ("", "## Use", "")
    if env == ENVIRONMENTS["point"]:
        yield from ("```python", "import gymnasium as gym", "")
        yield f'env = gym.make("airhockey_env:{env}", opponent="policy.npz")  # play against it'
        yield from ("```", "")
    task = next((f" --task {task}" for task, id in ENVIRONMENTS.items() if id == env and task != "point"), "")
    yield f"With airhockey-env installed, `python -m scripts.evaluate policy.npz{task}` measures it."


def _metadata(env: str) -> str:
    """The head of a README.md on the Hugging Face Hub."""
    tags = [env, "deep-reinforcement-learning", "reinforcement-learning", "stable-baselines3"]
    data = {"library_name": "stable-baselines3", "tags": tags}
    return f"---\n{yaml.safe_dump(data, sort_keys=False)}---\n\n"
