"""A run that is being trained: its phases, evaluations and checkpoints."""

from __future__ import annotations

import time
from collections.abc import Sequence

from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.logger import Logger, configure
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from agents.training import checkpoints, workers
from agents.training.learning import Records, seed_learning
from agents.training.recipe import History, Phase, Recipe, Setup, TrainArgs
from agents.training.runs import RunFolder
from agents.training.stopping import Stop, StopLearning


class Run:
    """A run that is being trained.

    Args:
        owner: the process that has locked the folder (see `RunFolder.owner`), if that is another one.
    """

    def __init__(
        self,
        recipe: Recipe,
        folder: RunFolder,
        args: TrainArgs,
        setup: Setup,
        history: History,
        owner: str | None = None,
    ) -> None:
        assert args.steps is not None and args.eval_every is not None
        self.recipe, self.folder, self.args, self.setup, self.history = recipe, folder, args, setup, history
        self.model, self.steps, self.eval_every = setup.model, args.steps, args.eval_every
        self._owner = owner
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
        """Write a checkpoint, as worker 0.

        Raises:
            OSError: it could not be written. The last one is intact.
            BlockingIOError: the folder has another owner by now, since the run was resumed without this process.
        """
        if workers.rank() > 0:
            return
        if self._owner is not None and self.folder.owner() != self._owner:
            raise BlockingIOError(f"{self.folder.path} is being trained by {self.folder.owner()}")
        checkpoints.save(self.folder, self.setup, self.history)

    def evaluate(self, stop: Stop) -> None:
        """Evaluate the model, record the result, and save the run. Other workers than worker 0 only note the steps."""
        seconds = self.seconds
        row = self.setup.evaluate(stop) if workers.rank() == 0 else {}
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
        if self.num_timesteps >= self.run.evaluated + self.run.eval_every and not self.stop.asked:
            self.run.evaluate(self.stop)


def learn_phases(
    run: Run, callbacks: Sequence[BaseCallback], stop: Stop, together: Sequence[BaseCallback] = ()
) -> None:
    """Train all phases, until the run has all its steps or a signal arrives.

    Args:
        callbacks: they are called after those of the phase.
        together: they are called before them.

    Raises:
        Stopped, KeyboardInterrupt: a signal has arrived during an evaluation.
    """
    run.model.set_logger(_logger(run))
    if run.evaluated < 0:
        run.evaluate(stop)
    for phase in run.setup.phases(run.history):
        if stop.asked or run.model.num_timesteps >= run.steps:
            break
        _learn_phase(run, phase, [*together, *phase.callbacks, *callbacks, Watch(run, stop), StopLearning(stop)], stop)


def _logger(run: Run) -> Logger:
    """TensorBoard's files and the records of the run; nothing for other workers than worker 0."""
    if workers.rank() > 0:
        return Logger(None, [])
    logger = configure(str(run.folder.path / "tensorboard"), ["tensorboard"])
    logger.output_formats.append(Records(run.history["updates"], lambda: run.seconds))
    return logger


def _learn_phase(run: Run, phase: Phase, callbacks: list[BaseCallback], stop: Stop) -> None:
    """Train on the tables of a phase, until a callback ends it or the run has all its steps."""
    model = run.model
    print(phase.title)
    seed_learning(model, phase.env, phase.purpose, run.args.seed)
    if run.setup.league is not None:
        run.setup.league.begin(run.folder.path.name, stop)
    model.learn(
        run.steps - model.num_timesteps,
        callback=CallbackList(callbacks),
        log_interval=100 if isinstance(model, OffPolicyAlgorithm) else 1,  # episodes, or updates
        reset_num_timesteps=model.num_timesteps == 0,
    )
