"""Train a run to its end, whether it is new, begun or complete."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from stable_baselines3.common.callbacks import BaseCallback

from agents.files import COUNT, read_json
from agents.training.recipe import TrainArgs
from agents.training.runs import RunFolder, check_name
from agents.training.train import NOT_KEPT, train


def finish(args: TrainArgs, callbacks: Sequence[BaseCallback] = ()) -> RunFolder:
    """Train the run runs/NAME/ to `args.steps`: begin it, or go on with it. A run that is complete is left as it is.

    Args:
        args: the options of the run, with a name and a number of steps. Those of a run that has begun are not compared
            with them.
        callbacks: see `train`.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed. The run is saved, and the same call continues it.
        ValueError, OSError: see `train`.
    """
    assert args.name is not None
    folder = RunFolder(Path("runs") / check_name(args.name))
    if not folder.config.exists():
        train(args, callbacks)
    elif not complete(folder, args):
        kept = {name: getattr(args, name) for name in NOT_KEPT if hasattr(args, name)}
        resumed = {**kept, "resume": str(folder.path), "steps": args.steps}
        train(dataclasses.replace(type(args)(), **resumed), callbacks)
    if not complete(folder, args):
        raise KeyboardInterrupt
    return folder


def complete(folder: RunFolder, args: TrainArgs) -> bool:
    """Whether a run has all its steps and its report."""
    assert args.steps is not None
    history = read_json(folder.evaluations, {"evaluations": [{"steps": COUNT}], "report": [{}]})
    return bool(history["report"]) and history["evaluations"][-1]["steps"] >= args.steps
