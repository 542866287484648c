"""Search hyperparameters of a training command: python -m scripts.tune --trials 50 -- train_ppo --steps 3M"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from tqdm import tqdm

from agents.options import FIELD_FILE_HELP, Address, Count, Workers, check_cluster, check_ranges, listed, make_folder
from agents.training.runs import check_name
from agents.training.tune import COMMANDS, TRIAL_DEFAULTS, Outcome, Search, make_search, open_study, run_trials
from agents.training.tune_report import best_trials, command_line, draw_importance, print_trials
from airhockey_env.checks import check_choice
from scripts._command import run_command

COMMAND_HELP = (
    f"Search the hyperparameters of this command, {listed(COMMANDS)}, with its options. Write -- before it. The "
    "options that are searched are overridden."
)
SPACE_HELP = (
    f"Try what this file says, {FIELD_FILE_HELP} hyperparameters with the arguments of an Optuna distribution each. "
    "The default is agents/hyperparams/search/ALGORITHM.yml."
)


@dataclass(frozen=True)
class TuneArgs:
    """Search hyperparameters with Optuna: each trial is a run of a training command, in runs/NAME-NUMBER/.

    The trials maximise the share of points won, or of successful episodes, in a run's last evaluation. The study and a
    picture of what mattered are written into runs/NAME/. After Ctrl-C, the same command continues, with another number
    of --trials if wanted.
    """

    command: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="COMMAND", help=COMMAND_HELP)] = (
        "train_ppo",
        "--steps",
        "3M",
    )
    name: str = "tune"
    """Write the study into runs/NAME/, and its runs into runs/NAME-NUMBER/."""
    trials: Count = 50
    """Run this many trials in all."""
    space: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help=SPACE_HELP)] = None
    prune: bool = True
    """Stop a trial early if it is worse than half of the others were after as many steps."""
    seed: int = 0
    """Seed what is tried. The runs have the seed of their command."""
    workers: Workers = None
    address: Address = None


def tune(args: TuneArgs) -> None:
    """Search, print, and draw.

    Raises:
        ValueError, OSError: an argument does not fit.
        KeyboardInterrupt: Ctrl-C was pressed. The results so far have been reported, and the runs are saved.
    """
    check_ranges(args, trials=(1, 100_000), seed=(0, 10**9))
    check_cluster(args)
    command, *options = args.command or ("",)
    check_choice("COMMAND", command, COMMANDS)
    defaults = dataclasses.replace(COMMANDS[command](), **TRIAL_DEFAULTS)
    training = tyro.cli(COMMANDS[command], prog=f"python -m scripts.{command}", args=options, default=defaults)
    search = make_search(command, training, check_name(args.name), args.space, args.prune, args.seed)
    Path("runs").mkdir(exist_ok=True)
    make_folder("name", search.folder.path)
    with search.folder.locked(new=True):
        study = open_study(search)
        stopped, errors = False, []
        ended = sum(trial.state.is_finished() for trial in study.trials)
        with tqdm(total=args.trials, initial=ended, unit="trial", desc="tune", disable=None) as bar:
            try:
                for outcome in run_trials(search, study, args.trials, args.workers, args.address):
                    bar.update()
                    tqdm.write(_in_words(search, outcome))
                    errors += [outcome.error] if outcome.error is not None else []
            except KeyboardInterrupt:
                stopped = True
        if best_trials(study):
            report(search)
        elif errors:
            raise ValueError(f"no trial was complete; the last one failed: {errors[-1]}")
    if stopped:
        print("Stopped. The same command continues.")
        raise KeyboardInterrupt


def report(search: Search) -> None:
    """Print the best trials and the command that repeats the best, and draw what mattered."""
    study = open_study(search)
    print_trials(search, study)
    if draw_importance(search, study):
        print(f"{search.picture}: how much each hyperparameter mattered")
    best = best_trials(study)[0]
    print("To train the best one again:")
    print(command_line(search.command, search.trial_args(best.number, best.params)))


def _in_words(search: Search, outcome: Outcome) -> str:
    run = f"{search.name}-{outcome.number}"
    if outcome.error is not None:
        return f"{run} failed: {outcome.error}"
    return f"{run} was stopped early" if outcome.value is None else f"{run}: {outcome.value:.1%}"


def main() -> None:
    """Read the command line and search."""
    run_command("tune", TuneArgs, tune)


if __name__ == "__main__":
    main()
