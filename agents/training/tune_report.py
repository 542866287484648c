"""What a search of hyperparameters has found: its best trials, what mattered, and the command that repeats the best."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

from agents.options import command_with, not_default
from agents.plots import save_figure
from agents.tables import print_table
from agents.training.recipe import TrainArgs
from agents.training.runs import RunFolder
from agents.training.tune import TRIAL_DEFAULTS, Search, import_optuna, measure_of, read_evaluations

if TYPE_CHECKING:
    from optuna import Study
    from optuna.trial import FrozenTrial

MOST = 10
"""The most trials in the table."""


def best_trials(study: Study) -> list[FrozenTrial]:
    """The complete trials, best first."""
    complete = study.get_trials(states=(import_optuna().trial.TrialState.COMPLETE,))
    return sorted(complete, key=lambda trial: -trial.value)


def print_trials(search: Search, study: Study) -> None:
    """Print the best trials with the 95 % intervals of their last evaluations."""
    trials = best_trials(study)[:MOST]
    rows: list[tuple[str, ...]] = []
    measure = "value"
    for trial in trials:
        row = read_evaluations(RunFolder(search.folder.path.with_name(f"{search.name}-{trial.number}")))[-1]
        measure = measure_of(row)
        low, high = row[f"{measure}_95"]
        share = f"{trial.value:.1%} ({100 * low:.1f}-{100 * high:.1f})"
        rows.append((f"{search.name}-{trial.number}", share, *(_short(trial.params[name]) for name in search.space)))
    title = f"The best of {len(study.trials)} trials, {search.args.steps:,} steps each"
    print_table(title, [("run", f"{measure.replace('_', ' ')} (95 %)", *search.space), *rows])


def draw_importance(search: Search, study: Study) -> bool:
    """Draw how much each hyperparameter mattered; return False if there are too few results for that."""
    import_optuna()
    from matplotlib import pyplot
    from optuna.visualization.matplotlib import plot_param_importances

    if len({trial.value for trial in best_trials(study)}) < 2:
        return False
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Optuna calls its figures of matplotlib experimental
        axis = plot_param_importances(study)
    save_figure(axis.figure, search.picture)
    pyplot.close(axis.figure)
    return True


def command_line(command: str, args: TrainArgs) -> str:
    """The command that trains with these options. Without a name, so that the run gets a new one."""
    beside = (*TRIAL_DEFAULTS, "name", "resume", "conditions", "section")
    return command_with(command, args, [name for name in not_default(args) if name not in beside])


def _short(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
