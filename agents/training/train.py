"""The trainer that all recipes share: it begins or resumes a run, trains, evaluates, saves, and writes the report.

With --workers, Ray's workers do the training (`agents.training.parallel`), and this process the rest.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Sequence
from typing import TypeVar

import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger

from agents.files import read_arguments, read_json, write_json
from agents.options import check_device, check_ranges, check_resumed, not_default
from agents.training import checkpoints, distill, parallel, ppo, self_play, zoo
from agents.training.learning import ProgressBar
from agents.training.recipe import TrainArgs
from agents.training.report import draw_training
from agents.training.run import Run, learn_phases
from agents.training.runs import RunFolder
from agents.training.stopping import Stop, Stopped, stopping
from agents.video import write_video
from airhockey_env.checks import MOST_STACK

Args = TypeVar("Args", bound=TrainArgs)

RECIPES = {recipe.args: recipe for recipe in (ppo.RECIPE, self_play.RECIPE, distill.RECIPE, zoo.RECIPE)}
"""The recipes by the type of their options."""

NOT_KEPT = ("resume", "trust", "device", "workers", "address")
"""Options of a session, which config.json does not keep. Otherwise a file from somebody else could say that it is to be
trusted, and a run could not be resumed on a machine with other devices."""


def train(args: TrainArgs, callbacks: Sequence[BaseCallback] = ()) -> RunFolder:
    """Train to `args.steps`, or until Ctrl-C; then write the report. Return the folder of the run.

    After a second Ctrl-C, SIGTERM or SIGHUP, the run is saved without a report.

    Args:
        args: the options of a recipe: `PpoArgs`, `SelfPlayArgs`, `DistillArgs` or `ZooArgs`.
        callbacks: Stable-Baselines3 callbacks, for example of a tracker. They see training start and end once per phase
            of the recipe, such as shooting practice. A callback that returns False ends the phase. There can be none
            with workers, which are processes of their own.

    Raises:
        ValueError, FileExistsError, FileNotFoundError: an option is wrong. Nothing has been written.
        BlockingIOError: another process is training this run.
        OSError: the run could not be saved. Its last checkpoint is intact.
        ConnectionError: there is no Ray cluster at `args.address`.
        gymnasium.error.DependencyNotInstalled: there are workers, and Ray is missing.
    """
    if callbacks and parallel.wanted(args):
        raise ValueError("callbacks must be empty with workers, which are processes of their own")
    with contextlib.ExitStack() as stack:
        stop = stack.enter_context(stopping())
        cluster = stack.enter_context(contextlib.ExitStack())
        run = _begin(args, stack, cluster) if args.resume is None else _resume(args, stack, cluster)
        if parallel.wanted(args):
            run = _learn_with_workers(run, cluster, stop)
        else:
            _learn(run, [*callbacks, ProgressBar()], stop)
        _report(run, stop)
    return run.folder


def own_args(args: Args) -> tuple[RunFolder, Args]:
    """Find the run that `args.resume` names. Return its folder and the options that it was begun with.

    Raises:
        FileNotFoundError: there is no such run.
        ValueError: the run belongs to another command, or its config.json is damaged.
    """
    assert args.resume is not None
    recipe = RECIPES[type(args)]
    folder = RunFolder.open(args.resume, "--resume")
    whose = read_json(folder.config, {}).get("command", recipe.command)
    if whose != recipe.command:
        raise ValueError(
            f"{folder.path} is a run of scripts.{whose}, which can resume it, not of scripts.{recipe.command}"
        )
    kept = read_arguments(folder.config, type(args), beside=("command",))
    session = {name: getattr(args, name) for name in NOT_KEPT if hasattr(args, name)}
    try:
        return folder, resolved(dataclasses.replace(kept, **session))
    except ValueError as error:
        raise ValueError(f"{folder.config}: {error}") from error


def resolved(args: Args) -> Args:
    """Check the options, and replace None by the defaults that depend on other options.

    Raises:
        ValueError: an option is out of range.
    """
    most = math.inf
    check_ranges(
        args, steps=(1, most), seed=(0, 2**31 - 1), eval_every=(1, most), eval_episodes=(1, most),
        report_episodes=(1, most), threads=(1, 1024), video_seconds=(0, 3600), stack=(1, MOST_STACK),
    )  # fmt: skip
    check_device(args.device)
    args = RECIPES[type(args)].resolve(args)
    assert args.steps is not None
    return dataclasses.replace(args, eval_every=args.eval_every or max(1, args.steps // 10))


def _begin(args: TrainArgs, stack: contextlib.ExitStack, cluster: contextlib.ExitStack) -> Run:
    """Make a new run. Its folder stays locked until the stack is closed, and Ray can be used until `cluster` is."""
    recipe, args = RECIPES[type(args)], resolved(args)
    torch.set_num_threads(args.threads)
    setup = recipe.build(args, True)
    if parallel.wanted(args):
        cluster.enter_context(parallel.connected(args))
    folder = RunFolder.create(args.name, type(setup.model).__name__.lower())
    stack.enter_context(folder.locked(new=True))
    run = Run(recipe, folder, args, setup, {"practice": None, "evaluations": [], "updates": [], "report": []})
    run.save()
    kept = {name: value for name, value in dataclasses.asdict(args).items() if name not in NOT_KEPT}
    write_json(folder.config, {"command": recipe.command, **kept})  # last: now the run can be resumed
    return run


def _resume(args: TrainArgs, stack: contextlib.ExitStack, cluster: contextlib.ExitStack) -> Run:
    """Load a run to continue it. The stacks are as in `_begin`."""
    folder, kept = own_args(args)
    check_resumed(dataclasses.replace(kept, **{name: getattr(args, name) for name in not_default(args)}), kept)
    stack.enter_context(folder.locked())
    recipe, asked = RECIPES[type(args)], args.steps
    args = resolved(dataclasses.replace(kept, steps=asked or kept.steps))
    torch.set_num_threads(args.threads)
    setup = recipe.build(args, False)
    history = checkpoints.load(folder, setup)
    done = setup.model.num_timesteps
    rollout = setup.model.n_envs * getattr(setup.model, "n_steps", 1)  # off-policy algorithms collect a step at a time
    if asked is not None and done >= asked + rollout:
        raise ValueError(f"the run has {done:,} steps: --steps must be more, got {asked:,}")
    if parallel.wanted(args):
        cluster.enter_context(parallel.connected(args))
    return Run(recipe, folder, args, setup, history)


def _learn(run: Run, callbacks: Sequence[BaseCallback], stop: Stop) -> None:
    """Train all phases. The run is saved however they end.

    Raises:
        Stopped, KeyboardInterrupt: a signal other than one Ctrl-C has arrived.
    """
    _announce(run)
    try:
        learn_phases(run, callbacks, stop)
    except (KeyboardInterrupt, Stopped):
        if not stop.asked:
            raise
    finally:
        run.save()
    _end(run, stop)


def _learn_with_workers(run: Run, cluster: contextlib.ExitStack, stop: Stop) -> Run:
    """Let Ray's workers train all phases, close Ray, and return the run as they have saved it.

    Raises:
        Stopped, KeyboardInterrupt: a signal other than one Ctrl-C has arrived.
    """
    _announce(run)
    with cluster:
        parallel.learn(run, stop)
    history = checkpoints.load(run.folder, run.setup)
    run = Run(run.recipe, run.folder, run.args, run.setup, history)
    run.model.set_logger(Logger(None, []))
    _end(run, stop)
    return run


def _announce(run: Run) -> None:
    done, path = run.model.num_timesteps, run.folder.path
    resumed = f" It continues at {done:,}." if done < run.steps else f" It has {done:,} already, so nothing is left."
    print(f"{path}: {run.steps:,} steps in all.{resumed if done else ''} Ctrl-C stops early and saves everything.")
    if run.folder.policy.exists() and run.model.num_timesteps < run.steps:
        print(f"Watch it learn, in the browser: python -m airhockey_env.web --run {path} --open")


def _end(run: Run, stop: Stop) -> None:
    """Say how a run that was stopped can be continued; leave if that was not by one Ctrl-C.

    Raises:
        Stopped, KeyboardInterrupt: a signal other than one Ctrl-C has arrived.
    """
    if stop.asked:
        command = run.recipe.command
        print(f"\nStopped; the run is saved. Continue with: python -m scripts.{command} --resume {run.folder.path}")
        stop.forget_ctrl_c()
        stop.check()


def _report(run: Run, stop: Stop) -> None:
    """Evaluate the trained agent, print and write the results, draw the picture and record the video."""
    folder = run.folder
    print(f"{run.model.num_timesteps:,} steps, {run.seconds / 60:.1f} minutes of training.")
    print(
        f"Evaluating the agent in {run.args.report_episodes:,} episodes, against each opponent if there are several ..."
    )
    if run.evaluated < run.model.num_timesteps:
        run.evaluate(stop)
    run.history["report"] = run.setup.report(run.history, stop)
    write_json(folder.evaluations, run.history)
    draw_training(run.history, run.setup.title, folder.picture)
    if run.args.video_seconds > 0:
        write_video(folder.video, stop.between(run.setup.frames(folder)))
    print(folder.files())
