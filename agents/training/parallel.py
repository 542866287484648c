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
import traceback
from pathlib import Path
from typing import Any, NamedTuple

import torch

from agents.cluster import ALWAYS, connect
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


class Post:
    """What stands between the command's process and worker 0: an actor of Ray, in which Ray Train runs.

    Each of the two asks it for what the other has left there.
    """

    def __init__(self) -> None:
        self._asked: list[int] = []
        self._printed: list[str] = []
        self._steps = 0
        self._working = False
        self._error: Exception | None = None
        self._starts: list[int] = []

    def fit(self, job: Job) -> None:
        """Start the workers, again whenever some are lost, and wait until they have trained."""
        os.environ.update(ALWAYS)
        import ray
        from ray.train import FailureConfig, RunConfig, ScalingConfig
        from ray.train.torch import TorchTrainer

        from agents.training.ray_parts import Losses, torch_config

        post = ray.get_runtime_context().current_actor
        TorchTrainer(
            work,
            train_loop_config={"job": job, "post": post},
            torch_config=torch_config(job.storage if job.local else None, TIMEOUT),
            scaling_config=ScalingConfig(num_workers=job.workers, resources_per_worker={"CPU": job.args.threads}),
            run_config=RunConfig(
                name="train",
                storage_path=job.storage,  # of checkpoints in Ray's own way; here the folder of the run has them
                failure_config=FailureConfig(max_failures=-1),
                callbacks=[Losses(post)],
            ),
        ).fit()

    def begin(self, steps: int) -> None:
        """Worker 0 begins at a checkpoint of so many steps.

        Raises:
            RuntimeError: workers have been lost there too often.
        """
        self._starts.append(steps)
        if self._starts[-MOST_STARTS - 1 :] == [steps] * (MOST_STARTS + 1):
            raise RuntimeError(f"workers were lost {MOST_STARTS} times after the checkpoint at {steps:,} steps")
        self._working, self._steps = True, steps

    def tell(self, steps: int, printed: str) -> list[int]:
        """Worker 0 has played so many steps and printed this. Return the signals that have arrived."""
        self._steps = steps
        self._printed += [printed] if printed else []
        return self._asked

    def lose(self, ranks: list[int]) -> None:
        """These workers were lost, some of them because others were."""
        self._working = False
        if self._error is None:
            numbers = ", ".join(map(str, ranks))
            self._printed.append(f"Ray has lost workers ({numbers}); it starts them again from the last checkpoint.\n")

    def fail(self, error: Exception) -> None:
        """A worker cannot go on."""
        self._error = self._error or error

    def failed(self) -> bool:
        """Whether a worker has said that it cannot go on."""
        return self._error is not None

    def look(self, asked: list[int]) -> tuple[bool, int, list[str], Exception | None]:
        """These signals have arrived. Return whether workers train, their steps, their prints, and an error."""
        self._asked = asked
        printed, self._printed = self._printed, []
        return self._working, self._steps, printed, self._error


class Job(NamedTuple):
    """What the workers need to know of a run."""

    recipe: Recipe
    args: ppo.PpoArgs  # of one worker
    workers: int
    local: bool  # whether Ray is on this machine alone
    current: str  # the folder that the command was started in
    folder: str  # that of the run
    owner: str  # see `RunFolder.owner`
    storage: str  # a folder for Ray's own files


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
    post = ray.remote(num_cpus=0, max_concurrency=4, scheduling_strategy=here)(Post).remote()
    processors, wanted = int(ray.cluster_resources().get("CPU", 0)), args.workers * args.threads
    if processors < wanted:
        print(f"Training begins when the cluster has {wanted} processors; it has {processors}.")
    done = min(run.model.num_timesteps, run.steps)
    with (
        tempfile.TemporaryDirectory() as storage,
        tqdm(total=run.steps, initial=done, unit="step", unit_scale=True, disable=None) as bar,
    ):
        local, path = args.address is None, run.folder.path.absolute()
        share = ppo.share_of_worker(args)
        job = Job(run.recipe, share, args.workers, local, os.getcwd(), str(path), run.folder.owner(), storage)
        fit = post.fit.remote(job)
        ended = False
        while not ended:
            ended = bool(ray.wait([fit], timeout=POLL)[0])
            working, steps, printed, error = ray.get(post.look.remote(list(stop.asked)))
            for text in printed:
                bar.write(text, end="")
            bar.update(max(done, min(steps, bar.total)) - bar.n)
            if stop.asked and not working:
                return  # the last checkpoint has everything
        if error is not None:
            raise error
        ray.get(fit)


def work(config: dict[str, Any]) -> None:
    """Train as one of the workers: what Ray Train calls in every worker's process.

    An error that another start would not change is told to the command, and the workers that Ray starts after it end
    at once.
    """
    import ray

    post = config["post"]
    if ray.get(post.failed.remote()):
        return
    try:
        _work(config["job"], post)
    except workers.WorkerLost:
        raise
    except Exception as error:
        ray.get(post.fail.remote(_plain(error)))
        raise


def _plain(error: Exception) -> Exception:
    """The error, if a command shows it as a message; otherwise one with its traceback, which every process can load."""
    if isinstance(error, (ValueError, OSError)):
        return error
    return RuntimeError("".join(traceback.format_exception(error)))


def _work(job: Job, post: Any) -> None:
    import ray

    folder = _shared_folder(job)
    torch.set_num_threads(job.args.threads)
    setup = job.recipe.build(job.args, False)
    history = checkpoints.load(folder, setup)
    run = Run(job.recipe, folder, job.args, setup, history, job.owner)
    begun = workers.gather((run.model.num_timesteps, workers.weights_hash(run.model)))
    if len(set(begun)) > 1:
        raise ValueError(f"{folder.path} must be the same folder on all nodes; workers have read different checkpoints")
    if workers.rank() == 0:
        ray.get(post.begin.remote(run.model.num_timesteps))
    printed = io.StringIO()
    stop, line = Stop(), Line(post, printed)
    with contextlib.redirect_stdout(printed) if workers.rank() == 0 else contextlib.nullcontext():
        learn_phases(run, [], stop, [workers.Together(stop, line)])
        _compare_weights(run)
    run.save()
    if workers.rank() == 0:
        ray.get(line.flush(run.model.num_timesteps))


def _compare_weights(run: Run) -> None:
    """Say whether all workers hold the same weights."""
    hashes = workers.gather(workers.weights_hash(run.model))
    if len(set(hashes)) == 1:
        print(f"All {len(hashes)} workers hold the same weights, to the bit (SHA-256 {hashes[0]}).")
    else:
        print("The workers' weights differ, as processors of several kinds round them. Those of worker 0 are kept.")


def _shared_folder(job: Job) -> RunFolder:
    """Go to the folder that the command was started in, and find the folder of the run.

    Raises:
        FileNotFoundError: they are not there, or it is another folder that happens to have this path.
    """
    with contextlib.suppress(OSError):
        os.chdir(job.current)
        folder = RunFolder(Path(job.folder))
        if folder.config.is_file() and folder.owner() == job.owner:
            return folder
    raise FileNotFoundError(
        f"{job.folder} must be on a file system that all nodes of the cluster share, at the same path; it is not there "
        f"on {platform.node()}"
    )


class Line:
    """Worker 0's connection to the command: a function for `Together`. It never waits, however slow the command is.

    Args:
        post: the actor.
        printed: what is in it is passed on and removed.
    """

    def __init__(self, post: Any, printed: io.StringIO) -> None:
        self.post, self.printed = post, printed
        self._arrived: list[int] = []
        self._answer: Any = None

    def __call__(self, steps: int) -> list[int]:
        """Tell the number of steps, unless the last one is on its way. Return the signals that have arrived."""
        import ray

        if self._answer is None or ray.wait([self._answer], timeout=0)[0]:
            self.flush(steps)
        return self._arrived

    def flush(self, steps: int) -> Any:
        """Tell the number of steps and what was printed, as soon as the last answer is there. Return the next."""
        import ray

        if self._answer is not None:
            self._arrived = ray.get(self._answer)
        self._answer = self.post.tell.remote(steps, self.printed.getvalue())
        self.printed.seek(0)
        self.printed.truncate()
        return self._answer
