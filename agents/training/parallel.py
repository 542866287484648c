"""Data-parallel training: Ray Train places the workers of a run and starts them again when one is lost.

The command's own process begins the run, hands it over by its folder, and waits; it passes signals on to worker 0 and
shows what that reports. Workers begin at the last checkpoint in the folder, whether it is their first start or another.
"""

from __future__ import annotations

import contextlib
import io
import os
import platform
import tempfile
import threading
import traceback
from pathlib import Path
from typing import Any

import torch

from agents.cluster import connect
from agents.training import checkpoints, ppo, workers
from agents.training.recipe import Recipe, TrainArgs
from agents.training.run import Run, learn_phases
from agents.training.runs import RunFolder
from agents.training.stopping import Stop

MOST_STARTS = 5
"""Workers that are lost so many times in a row before they reach a checkpoint are not started again."""

TIMEOUT = 24 * 3600
"""Seconds that workers wait for each other: as long as worker 0 may evaluate. Ray notices lost workers by itself."""

POLL = 0.2
"""Seconds between two looks at the messages of worker 0."""


def wanted(args: TrainArgs) -> bool:
    """Whether workers are to train, rather than this process."""
    return isinstance(args, ppo.PpoArgs) and args.workers is not None


def connected(args: TrainArgs) -> contextlib.AbstractContextManager[None]:
    """Ray for these options. See `agents.cluster.connect`."""
    assert isinstance(args, ppo.PpoArgs) and args.workers is not None
    return connect(args.address, args.workers * args.threads)


class Messages:
    """What the command's process and worker 0 tell each other: an actor of Ray."""

    def __init__(self) -> None:
        self.asked: list[int] = []
        self.printed: list[str] = []
        self.steps = 0
        self.working = False
        self.error: Exception | None = None
        self._starts: list[int] = []

    def begin(self, steps: int) -> None:
        """Worker 0 begins at a checkpoint of so many steps.

        Raises:
            RuntimeError: workers have been lost there too often.
        """
        self._starts.append(steps)
        if self._starts[-MOST_STARTS - 1 :] == [steps] * (MOST_STARTS + 1):
            raise RuntimeError(f"workers were lost {MOST_STARTS} times after the checkpoint at {steps:,} steps")
        self.working, self.steps = True, steps

    def tell(self, steps: int, printed: str) -> list[int]:
        """Worker 0 has played so many steps and printed this. Return the signals that have arrived."""
        self.steps = steps
        if printed:
            self.printed.append(printed)
        return self.asked

    def end(self) -> None:
        """All is saved."""
        self.working = False

    def lose(self, ranks: list[int]) -> None:
        """These workers were lost, some of them because others were."""
        self.working = False
        if self.error is None:
            numbers = ", ".join(map(str, ranks))
            self.printed.append(f"Ray has lost workers ({numbers}); it starts them again from the last checkpoint.\n")

    def fail(self, error: Exception) -> None:
        """A worker cannot go on."""
        self.error, self.working = self.error or error, False

    def failed(self) -> bool:
        """Whether a worker has said that it cannot go on."""
        return self.error is not None

    def look(self, asked: list[int]) -> tuple[bool, int, list[str], Exception | None]:
        """These signals have arrived. Return whether workers train, their steps, what they printed, and an error."""
        self.asked = asked
        printed, self.printed = self.printed, []
        return self.working, self.steps, printed, self.error


def learn(run: Run, stop: Stop) -> None:
    """Let workers train all phases of a run, until it has all its steps or a signal arrives. They save it.

    Raises:
        ValueError, OSError, RuntimeError: a worker cannot go on. The last checkpoint is intact.
    """
    import ray
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy
    from tqdm import tqdm

    args = run.args
    assert isinstance(args, ppo.PpoArgs) and args.workers is not None
    here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=False)
    messages = ray.remote(num_cpus=0, scheduling_strategy=here)(Messages).remote()
    processors = int(ray.cluster_resources().get("CPU", 0))
    if processors < args.workers * args.threads:
        print(f"Training begins when the cluster has {args.workers * args.threads} processors; it has {processors}.")
    errors: list[BaseException] = []
    with tempfile.TemporaryDirectory() as storage:
        thread = threading.Thread(target=_fit, args=(_trainer(run, messages, storage), errors), daemon=True)
        thread.start()
        done = run.model.num_timesteps
        with tqdm(total=run.steps, initial=min(done, run.steps), unit="step", unit_scale=True, disable=None) as bar:
            ended = False
            while not ended:
                thread.join(POLL)
                ended = not thread.is_alive()
                working, steps, printed, error = ray.get(messages.look.remote(list(stop.asked)))
                for text in printed:
                    bar.write(text, end="")
                bar.update(min(steps, bar.total) - bar.n)
                ended = ended or (bool(stop.asked) and not working)  # then nothing has been learned since
    if error is not None:
        raise error
    if errors:
        raise RuntimeError(f"Ray Train has failed; {run.folder.path} has its last checkpoint") from errors[0]


def _fit(trainer: Any, errors: list[BaseException]) -> None:
    try:
        trainer.fit()
    except Exception as error:
        errors.append(error)


def _trainer(run: Run, messages: Any, storage: str) -> Any:
    """Ray's trainer for a run."""
    from ray.train import FailureConfig, RunConfig, ScalingConfig
    from ray.train.torch import TorchTrainer

    from agents.training.ray_parts import Losses, torch_config

    args = run.args
    assert isinstance(args, ppo.PpoArgs) and args.workers is not None
    return TorchTrainer(
        work,
        train_loop_config={
            "recipe": run.recipe,
            "args": ppo.share_of_worker(args),
            "current": os.getcwd(),
            "folder": str(run.folder.path.absolute()),
            "owner": run.folder.owner(),
            "messages": messages,
        },
        torch_config=torch_config(None if args.address else storage, TIMEOUT),
        scaling_config=ScalingConfig(num_workers=args.workers, resources_per_worker={"CPU": args.threads}),
        run_config=RunConfig(
            name="train",
            storage_path=storage,  # of Ray Train's own checkpoints, which nobody makes: the run's folder has them
            failure_config=FailureConfig(max_failures=-1),
            callbacks=[Losses(messages)],
        ),
    )


def work(config: dict[str, Any]) -> None:
    """Train as one of the workers: what Ray Train calls in every worker's process.

    An error that another start would not change is told to the command, and the workers that Ray starts after it end
    at once.
    """
    import ray

    messages = config["messages"]
    if ray.get(messages.failed.remote()):
        return
    try:
        _work(config["recipe"], config["args"], config["current"], config["folder"], config["owner"], messages)
    except workers.WorkerLost:
        raise
    except Exception as error:
        ray.get(messages.fail.remote(_plain(error)))
        raise


def _plain(error: Exception) -> Exception:
    """The error, if a command shows it as a message; otherwise one with its traceback, which every process can load."""
    if isinstance(error, (ValueError, OSError)):
        return error
    return RuntimeError("".join(traceback.format_exception(error)))


def _work(recipe: Recipe, args: ppo.PpoArgs, current: str, path: str, owner: str, messages: Any) -> None:
    import ray

    folder = _shared_folder(current, path, owner)
    torch.set_num_threads(args.threads)
    setup = recipe.build(args, False)
    history = checkpoints.load(folder, setup, recipe.evaluation)
    run = Run(recipe, folder, args, setup, history, owner)
    begun = workers.gather((run.model.num_timesteps, workers.weights_hash(run.model)))
    if len(set(begun)) > 1:
        raise ValueError(f"{path} must be the same folder on all nodes; workers have read different checkpoints in it")
    if workers.rank() == 0:
        ray.get(messages.begin.remote(run.model.num_timesteps))
    printed = io.StringIO()
    stop, line = Stop(), Line(messages, printed)
    with contextlib.redirect_stdout(printed) if workers.rank() == 0 else contextlib.nullcontext():
        learn_phases(run, [], stop, [workers.Together(stop, line)])
        _compare_weights(run)
    run.save()
    if workers.rank() == 0:
        line(run.model.num_timesteps)
        ray.get(messages.end.remote())


def _compare_weights(run: Run) -> None:
    """Say whether all workers hold the same weights."""
    hashes = workers.gather(workers.weights_hash(run.model))
    if len(set(hashes)) == 1:
        print(f"All {len(hashes)} workers hold the same weights, to the bit (SHA-256 {hashes[0]}).")
    else:
        print("The workers' weights differ, as processors of several kinds round them. Those of worker 0 are kept.")


def _shared_folder(current: str, path: str, owner: str) -> RunFolder:
    """Go to the folder that the command was started in, and find the folder of the run.

    Raises:
        FileNotFoundError: they are not there, or it is another folder that happens to have this path.
    """
    with contextlib.suppress(OSError):
        os.chdir(current)
        folder = RunFolder(Path(path))
        if folder.config.is_file() and folder.owner() == owner:
            return folder
    raise FileNotFoundError(
        f"{path} must be on a file system that all nodes of the cluster share, at the same path; it is not there on "
        f"{platform.node()}"
    )


class Line:
    """Worker 0's connection to the command: a function for `Together` that never waits for an answer to come.

    Args:
        messages: the actor.
        printed: what is in it is passed on and removed.
    """

    def __init__(self, messages: Any, printed: io.StringIO) -> None:
        self.messages, self.printed = messages, printed
        self._answer: Any = None

    def __call__(self, steps: int) -> list[int]:
        """Tell the number of steps, and return the signals that had arrived when it was called before."""
        import ray

        arrived = [] if self._answer is None else ray.get(self._answer)
        self._answer = self.messages.tell.remote(steps, self.printed.getvalue())
        self.printed.seek(0)
        self.printed.truncate()
        return arrived
