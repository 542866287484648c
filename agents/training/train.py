"""The trainer that all recipes share: it begins or resumes a run, trains, evaluates, saves, and writes the report."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from collections.abc import Sequence
from typing import TypeVar

import torch
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import configure
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from agents.files import read_arguments, read_json, write_json
from agents.options import check_ranges, check_resumed, not_default
from agents.training import checkpoints, distill, ppo, self_play, zoo
from agents.training.learning import ProgressBar, Records, seed_learning
from agents.training.recipe import History, Phase, Recipe, Setup, TrainArgs
from agents.training.report import draw_training
from agents.training.runs import RunFolder
from agents.training.stopping import Stop, StopLearning, Stopped, stopping
from agents.video import write_video
from airhockey_env.checks import MOST_STACK

Args = TypeVar("Args", bound=TrainArgs)

RECIPES = {recipe.args: recipe for recipe in (ppo.RECIPE, self_play.RECIPE, distill.RECIPE, zoo.RECIPE)}
"""The recipes by the type of their options."""

NOT_KEPT = ("resume", "trust")
"""Options that config.json does not keep. Otherwise a file from somebody else could say that it is to be trusted."""


class Run:
    """A run that is being trained."""

    def __init__(self, recipe: Recipe, folder: RunFolder, args: TrainArgs, setup: Setup, history: History) -> None:
        assert args.steps is not None and args.eval_every is not None
        self.command, self.folder, self.args, self.setup, self.history = recipe.command, folder, args, setup, history
        self.model, self.steps, self.eval_every = setup.model, args.steps, args.eval_every
        before = history["updates"][-1]["seconds"] if history["updates"] else 0.0
        self._begun = time.perf_counter() - before

    @property
    def seconds(self) -> float:
        """Training time over all sessions, without evaluations."""
        return time.perf_counter() - self._begun

    @property
    def evaluated(self) -> int:
        """The number of steps at the last evaluation, or -1 before the first."""
        return self.history["evaluations"][-1]["steps"] if self.history["evaluations"] else -1

    def save(self) -> None:
        """Write a checkpoint."""
        checkpoints.save(self.folder, self.setup, self.history)

    def evaluate(self, stop: Stop) -> None:
        """Evaluate the model, record the result, and save the run."""
        seconds = self.seconds
        row = self.setup.evaluate(stop)
        self._begun += self.seconds - seconds
        self.history["evaluations"].append({"steps": self.model.num_timesteps, "seconds": seconds, **row})
        for name, value in row.items():
            if isinstance(value, float):
                self.model.logger.record(f"eval/{name}", value)
        self.save()


class Watch(BaseCallback):
    """Evaluates and saves a run regularly."""

    def __init__(self, run: Run, stop: Stop) -> None:
        super().__init__()
        self.run, self.stop = run, stop

    def _on_step(self) -> bool:
        if isinstance(self.model, OffPolicyAlgorithm):
            self._evaluate_if_due()
        return True

    def _on_rollout_start(self) -> None:
        self._evaluate_if_due()

    def _evaluate_if_due(self) -> None:
        if self.num_timesteps >= self.run.evaluated + self.run.eval_every:
            self.run.evaluate(self.stop)


def train(args: TrainArgs, callbacks: Sequence[BaseCallback] = ()) -> RunFolder:
    """Train to `args.steps`, or until Ctrl-C; then write the report. Return the folder of the run.

    After a second Ctrl-C, SIGTERM or SIGHUP, the run is saved without a report.

    Args:
        args: the options of a recipe: `PpoArgs`, `SelfPlayArgs`, `DistillArgs` or `ZooArgs`.
        callbacks: Stable-Baselines3 callbacks, for example of a tracker. They see training start and end once per phase
            of the recipe, such as shooting practice. A callback that returns False ends the phase.

    Raises:
        ValueError, FileExistsError, FileNotFoundError: an option is wrong. Nothing has been written.
        BlockingIOError: another process is training this run.
        OSError: the run could not be saved. Its last checkpoint is intact.
    """
    with contextlib.ExitStack() as stack:
        stop = stack.enter_context(stopping())
        run = _begin(args, stack) if args.resume is None else _resume(args, stack)
        _learn(run, callbacks, stop)
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
        return folder, _resolved(dataclasses.replace(kept, **session))
    except ValueError as error:
        raise ValueError(f"{folder.config}: {error}") from error


def _resolved(args: Args) -> Args:
    """Check the options, and replace None by the defaults that depend on other options.

    Raises:
        ValueError: an option is out of range.
    """
    most = math.inf
    check_ranges(
        args, steps=(1, most), seed=(0, 2**31 - 1), eval_every=(1, most), eval_episodes=(1, most),
        report_episodes=(1, most), threads=(1, 1024), video_seconds=(0, 3600), stack=(1, MOST_STACK),
    )  # fmt: skip
    args = RECIPES[type(args)].resolve(args)
    assert args.steps is not None
    return dataclasses.replace(args, eval_every=args.eval_every or max(1, args.steps // 10))


def _begin(args: TrainArgs, stack: contextlib.ExitStack) -> Run:
    """Make a new run. Its folder stays locked until the stack is closed."""
    recipe, args = RECIPES[type(args)], _resolved(args)
    torch.set_num_threads(args.threads)
    setup = recipe.build(args, True)
    folder = RunFolder.create(args.name, type(setup.model).__name__.lower())
    stack.enter_context(folder.locked(new=True))
    run = Run(recipe, folder, args, setup, {"practice": None, "evaluations": [], "updates": [], "report": []})
    run.save()
    kept = {name: value for name, value in dataclasses.asdict(args).items() if name not in NOT_KEPT}
    write_json(folder.config, {"command": recipe.command, **kept})  # last: now the run can be resumed
    return run


def _resume(args: TrainArgs, stack: contextlib.ExitStack) -> Run:
    """Load a run to continue it. Its folder stays locked until the stack is closed."""
    folder, kept = own_args(args)
    check_resumed(dataclasses.replace(kept, **{name: getattr(args, name) for name in not_default(args)}), kept)
    stack.enter_context(folder.locked())
    recipe, asked = RECIPES[type(args)], args.steps
    args = _resolved(dataclasses.replace(kept, steps=asked or kept.steps))
    torch.set_num_threads(args.threads)
    setup = recipe.build(args, False)
    history = checkpoints.load(folder, setup)
    done = setup.model.num_timesteps
    rollout = setup.model.n_envs * getattr(setup.model, "n_steps", 1)  # off-policy algorithms collect a step at a time
    if asked is not None and done >= asked + rollout:
        raise ValueError(f"the run has {done:,} steps: --steps must be more, got {asked:,}")
    return Run(recipe, folder, args, setup, history)


def _learn(run: Run, callbacks: Sequence[BaseCallback], stop: Stop) -> None:
    """Train all phases. The run is saved however they end.

    Raises:
        Stopped, KeyboardInterrupt: a signal other than one Ctrl-C has arrived.
    """
    done, path = run.model.num_timesteps, run.folder.path
    resumed = f" It continues at {done:,}." if done < run.steps else f" It has {done:,} already, so nothing is left."
    print(f"{path}: {run.steps:,} steps in all.{resumed if done else ''} Ctrl-C stops early and saves everything.")
    if run.folder.policy.exists() and run.model.num_timesteps < run.steps:
        print(f"Watch it learn, in the browser: python -m airhockey_env.web --run {path} --open")
    logger = configure(str(path / "tensorboard"), ["tensorboard"])
    logger.output_formats.append(Records(run.history["updates"], lambda: run.seconds))
    run.model.set_logger(logger)
    try:
        if run.evaluated < 0:
            run.evaluate(stop)
        for phase in run.setup.phases(run.history):
            if stop.asked or run.model.num_timesteps >= run.steps:
                break
            _learn_phase(run, phase, callbacks, stop)
    except (KeyboardInterrupt, Stopped):
        if not stop.asked:
            raise
    finally:
        run.save()
    if stop.asked:
        print(f"\nStopped; the run is saved. Continue with: python -m scripts.{run.command} --resume {path}")
        stop.forget_ctrl_c()
        stop.check()


def _learn_phase(run: Run, phase: Phase, callbacks: Sequence[BaseCallback], stop: Stop) -> None:
    """Train on the tables of a phase, until a callback ends it or the run has all its steps."""
    model = run.model
    print(phase.title)
    seed_learning(model, phase.env, phase.purpose, run.args.seed)
    model.learn(
        run.steps - model.num_timesteps,
        callback=CallbackList([*phase.callbacks, *callbacks, Watch(run, stop), ProgressBar(), StopLearning(stop)]),
        log_interval=100 if isinstance(model, OffPolicyAlgorithm) else 1,  # episodes, or updates
        reset_num_timesteps=model.num_timesteps == 0,
    )


def _report(run: Run, stop: Stop) -> None:
    """Evaluate the trained agent, print and write the results, draw the picture and record the video."""
    folder = run.folder
    print(f"{run.model.num_timesteps:,} steps, {run.seconds / 60:.1f} minutes of training. Evaluating ...")
    if run.evaluated < run.model.num_timesteps:
        run.evaluate(stop)
    run.history["report"] = run.setup.report(run.history, stop)
    write_json(folder.evaluations, run.history)
    draw_training(run.history, run.setup.title, folder.picture)
    if run.args.video_seconds > 0:
        write_video(folder.video, stop.between(run.setup.frames(folder)))
    print(folder.files())
