"""Search hyperparameters of a training command with Optuna. Every trial is a training run.

The process of the command asks Optuna what to try, and each trial is a task of `agents.spread`: Optuna decides what is
tried, and Ray only where. Ray Tune would add a scheduler and checkpoints of its own beside those of the runs. The study
is kept in a journal file, which may lie on a shared file system, as an SQLite file may not: the trials' workers write
their evaluations into it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from gymnasium.error import DependencyNotInstalled
from stable_baselines3.common.callbacks import BaseCallback

from agents.files import COUNT, read_fields, read_json
from agents.options import option_name
from agents.spread import spread
from agents.training.finish import finish
from agents.training.hyperparameters import read_section, write_section
from agents.training.ppo import PpoArgs
from agents.training.recipe import TrainArgs
from agents.training.runs import RunFolder
from agents.training.self_play import SelfPlayArgs
from agents.training.train import RECIPES
from agents.training.zoo import HYPERPARAMS, ZooArgs

if TYPE_CHECKING:
    from optuna import Study
    from optuna.distributions import BaseDistribution
    from optuna.trial import Trial

COMMANDS: dict[str, type[TrainArgs]] = {"train_ppo": PpoArgs, "train_self_play": SelfPlayArgs, "train": ZooArgs}
"""The commands whose hyperparameters can be searched, with their options."""

TRIAL_DEFAULTS: dict[str, Any] = {"eval_episodes": 1000, "report_episodes": 100, "video_seconds": 0.0}
"""Defaults of a trial that are not those of its command: exact evaluations, and little after them. They do not change
what is learned."""

MEASURES = ("win_rate", "success_rate")
"""What is maximised: the first of these that an evaluation has."""

STARTUP_TRIALS = 5
"""No trial is stopped early before so many are complete."""


def import_optuna() -> Any:
    """Import Optuna.

    Raises:
        gymnasium.error.DependencyNotInstalled: it is missing.
    """
    try:
        import optuna
    except ImportError as error:
        install = 'pip install -c constraints-distributed.txt -e ".[distributed]"'
        raise DependencyNotInstalled(f"scripts.tune needs Optuna: {install}") from error
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    return optuna


@dataclass(frozen=True)
class Search:
    """What is searched: a training command, and the hyperparameters that its trials vary.

    Attributes:
        name: the study is in runs/NAME/, and its trials are the runs runs/NAME-NUMBER/.
        command: a key of `COMMANDS`.
        args: the options of every trial, with a number of steps.
        space: for each hyperparameter, the arguments of one of Optuna's distributions: `choices`, or `low` and `high`
            with `log` or `step` if wanted.
        prune: whether to stop trials early that are worse than half of the others were after as many steps.
        seed: seeds what is tried.
    """

    name: str
    command: str
    args: TrainArgs
    space: Mapping[str, Mapping[str, Any]]
    prune: bool = True
    seed: int = 0

    @property
    def folder(self) -> RunFolder:
        return RunFolder(Path("runs") / self.name)

    @property
    def picture(self) -> Path:
        return self.folder.path / "importance.png"

    def trial_args(self, number: int, params: Mapping[str, Any]) -> TrainArgs:
        """The options of a trial. Where its hyperparameters come from a file, that is written into `folder`."""
        args = dataclasses.replace(self.args, name=f"{self.name}-{number}")
        if not isinstance(args, ZooArgs):
            return dataclasses.replace(args, **params)
        assert args.hyperparams is not None
        file = self.folder.path / f"{number}.yml"
        write_section(file, args.env, {**read_section(args.hyperparams, args.env), **params})
        return dataclasses.replace(args, hyperparams=file)


class Outcome(NamedTuple):
    """How a trial ended."""

    number: int
    value: float | None  # of the last evaluation; None if it was stopped early or failed
    error: str | None = None  # why it failed


def make_search(
    command: str, args: TrainArgs, name: str, space: Path | None = None, prune: bool = True, seed: int = 0
) -> Search:
    """Check what is to be searched.

    Args:
        space: a .json or .yml file; by default that of the algorithm in agents/hyperparams/search.
        command, args, name, prune, seed: see `Search`.

    Raises:
        ValueError, OSError: an option or the file does not fit.
        gymnasium.error.DependencyNotInstalled: Optuna is missing.
    """
    given = [field for field in ("name", "resume", "workers", "address") if getattr(args, field, None) is not None]
    if given:
        raise ValueError(f"a trial's command cannot have {option_name(given[0])}, which the search decides on")
    resolved = RECIPES[type(args)].resolve(args)
    algorithm = args.algo if isinstance(args, ZooArgs) else "ppo"
    file = space or HYPERPARAMS / "search" / f"{algorithm}.yml"
    fields = read_fields(file)
    for parameter, distribution in distributions(fields, str(file)).items():
        _check_parameter(args, parameter, distribution, str(file))
    args = dataclasses.replace(args, steps=resolved.steps)
    if isinstance(args, ZooArgs):
        args = dataclasses.replace(args, hyperparams=resolved.hyperparams)
    return Search(name, command, args, fields, prune, seed)


def distributions(space: Mapping[str, Any], where: str) -> dict[str, BaseDistribution]:
    """Optuna's distributions for their arguments.

    Args:
        space: see `Search`.
        where: the name of the file in errors.

    Raises:
        ValueError: they are none.
    """
    kinds = import_optuna().distributions
    made = {}
    for name, arguments in space.items():
        try:
            if "choices" in arguments:
                kind = kinds.CategoricalDistribution
            elif all(type(arguments[end]) is int for end in ("low", "high")):
                kind = kinds.IntDistribution
            else:
                kind = kinds.FloatDistribution
            made[name] = kind(**arguments)
        except (TypeError, ValueError, KeyError) as error:
            raise ValueError(
                f"{where}: {name} must have choices, or low and high with log or step, got {arguments!r} ({error!r})"
            ) from error
    return made


def _check_parameter(args: TrainArgs, name: str, distribution: Any, where: str) -> None:
    """Raise ValueError if a command cannot have a hyperparameter, or not the ends of its range."""
    if isinstance(args, ZooArgs):
        return  # the algorithms of Stable-Baselines3 check theirs, when the first trial begins
    shared = {field.name for field in dataclasses.fields(TrainArgs)}
    own = [field.name for field in dataclasses.fields(args) if field.name not in shared]
    if name not in own:
        raise ValueError(f"{where} must have hyperparameters among {own}, got {name!r}")
    ends = distribution.choices if hasattr(distribution, "choices") else (distribution.low, distribution.high)
    for end in ends:
        RECIPES[type(args)].resolve(dataclasses.replace(args, **{name: end}))


def open_study(search: Search) -> Study:
    """The study in the folder of a search, which is made unless it is there.

    Raises:
        ValueError: it is the study of another search.
    """
    optuna = import_optuna()
    from optuna.storages import JournalStorage
    from optuna.storages.journal import JournalFileBackend

    study = optuna.create_study(
        study_name=search.name,
        storage=JournalStorage(JournalFileBackend(str(search.folder.path / "study.journal"))),
        direction="maximize",
        load_if_exists=True,
        # Half of the steps may be shooting practice, whose success says little about points.
        pruner=optuna.pruners.MedianPruner(n_startup_trials=STARTUP_TRIALS, n_warmup_steps=evaluations(search) // 2),
    )
    what = {"command and options": f"{search.command} {search.args}", "hyperparameters": str(search.space)}
    for name, value in what.items():
        if study.user_attrs.setdefault(name, value) != value:
            raise ValueError(f"{search.folder.path} is a search whose {name} are different: choose another --name")
        if not study.trials:
            study.set_user_attr(name, value)
    study.sampler = optuna.samplers.TPESampler(seed=search.seed + len(study.trials))
    return study


def evaluations(search: Search) -> int:
    """The number of evaluations of a trial, without the one before the first step."""
    assert search.args.steps is not None
    return max(1, search.args.steps // every(search.args))


def every(args: TrainArgs) -> int:
    """The number of steps between two evaluations, as `train` has it."""
    assert args.steps is not None
    return args.eval_every or max(1, args.steps // 10)


def run_trials(
    search: Search, study: Study, number: int, workers: int | None = None, address: str | None = None
) -> Iterator[Outcome]:
    """Run trials until the study has `number`, and yield how they end. Those that had begun are continued first.

    Args:
        workers, address: see `agents.spread.spread`. Several workers try different things than one does, because
            what is tried depends on the results so far.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed. The trials' runs are saved, and the same call continues them.
    """
    optuna = import_optuna()
    state = optuna.trial.TrialState
    space = distributions(search.space, "the search space")

    def trials() -> Iterator[int]:
        for begun in study.get_trials(states=(state.RUNNING,)):
            yield begun._trial_id
        while len(study.trials) < number:
            yield study.ask(space)._trial_id

    for _, outcome in spread(partial(run_trial, search), trials(), workers, address):
        if outcome.value is not None:
            study.tell(outcome.number, outcome.value)
        else:
            study.tell(outcome.number, state=state.PRUNED if outcome.error is None else state.FAIL)
        yield outcome


def run_trial(search: Search, trial_id: int) -> Outcome:
    """Train the run of a trial, or go on with it."""
    optuna = import_optuna()
    trial = optuna.trial.Trial(open_study(search), trial_id)
    args = search.trial_args(trial.number, trial.params)
    folder = RunFolder(Path("runs") / str(args.name))
    try:
        finish(args, [Report(trial, folder, every(args), search.prune)])
    except optuna.TrialPruned:
        return Outcome(trial.number, None)
    except ValueError as error:  # a network of infinite weights, or hyperparameters that do not fit each other
        return Outcome(trial.number, None, str(error))
    return Outcome(trial.number, measured(read_evaluations(folder)[-1]))


def read_evaluations(folder: RunFolder) -> Sequence[Mapping[str, Any]]:
    """The rows of a run's evaluations."""
    return read_json(folder.evaluations, {"evaluations": [{"steps": COUNT}]})["evaluations"]


def measure_of(row: Mapping[str, Any]) -> str:
    """The name of what is maximised in a row of an evaluation: one of `MEASURES`."""
    return next(name for name in MEASURES if name in row)


def measured(row: Mapping[str, Any]) -> float:
    """The value of what is maximised."""
    return float(row[measure_of(row)])


class Report(BaseCallback):
    """Reports the evaluations of a run to its trial, and ends it by `optuna.TrialPruned` if it is to be stopped."""

    def __init__(self, trial: Trial, folder: RunFolder, every: int, prune: bool) -> None:
        super().__init__()
        self.trial, self.folder, self.every, self.prune = trial, folder, every, prune
        self.changed = 0
        self.reported: set[int] = set()  # Optuna warns of a step that is reported again

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        changed = self.folder.evaluations.stat().st_mtime_ns  # quicker than to read it for every rollout
        if changed == self.changed:
            return
        self.changed = changed
        for row in read_evaluations(self.folder):
            step = round(row["steps"] / self.every)
            if step not in self.reported:
                self.reported.add(step)
                self.trial.report(measured(row), step)
        if self.prune and self.trial.should_prune():
            raise import_optuna().TrialPruned
