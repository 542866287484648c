"""The workers of a run: processes that learn together, each on its own tables.

What is here needs a process group of torch.distributed, in which every worker makes the same calls in the same order.
Without one there is one worker, and every function returns what that one has.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeVar

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.type_aliases import DictRolloutBufferSamples, RolloutBufferSamples
from torch import distributed, nn

from agents.training.stopping import Stop

Item = TypeVar("Item")
Samples = TypeVar("Samples", RolloutBufferSamples, DictRolloutBufferSamples)


class WorkerLost(RuntimeError):
    """Another worker does not answer, for example because its process was killed."""


def number() -> int:
    """How many workers learn together."""
    return distributed.get_world_size() if _grouped() else 1


def rank() -> int:
    """The number of this worker, from 0 up. Worker 0 evaluates and writes the run's files."""
    return distributed.get_rank() if _grouped() else 0


def part() -> tuple[int, ...]:
    """What distinguishes this worker's random streams, for `agents.seeding`: nothing for worker 0."""
    return (rank(),) if rank() else ()


def gather(item: Item) -> list[Item]:
    """The items of all workers, by rank. An item is anything that can be pickled.

    Raises:
        WorkerLost: a worker does not answer.
    """
    if not _grouped():
        return [item]
    items: list[Any] = [None] * number()
    _together(lambda: distributed.all_gather_object(items, item))
    return items


def total(*numbers: float) -> list[float]:
    """The sum of each of these numbers over all workers.

    Raises:
        WorkerLost: a worker does not answer.
    """
    sums = torch.tensor(numbers, dtype=torch.float64)
    if _grouped():
        _together(lambda: distributed.all_reduce(sums))
    return sums.tolist()


def weights_hash(model: BaseAlgorithm) -> str:
    """A hash of the weights of a model, which is equal for two models if all weights are equal to the bit."""
    found = hashlib.sha256()
    for name, weight in sorted(model.policy.state_dict().items()):
        found.update(name.encode() + weight.cpu().numpy().tobytes())
    return found.hexdigest()


def _grouped() -> bool:
    return distributed.is_available() and distributed.is_initialized()


def _together(act: Callable[[], object]) -> None:
    try:
        act()
    except RuntimeError as error:  # gloo's own type; NCCL's is a subclass
        raise WorkerLost(f"another worker does not answer: {error}") from error


class Together(BaseCallback):
    """Lets the workers of a run take every step of the optimizer together. It has to be the first callback.

    Each worker computes the gradients of its own samples. Advantages are normalised over the samples of all workers,
    and gradients are averaged over the workers at the end of the backward pass; what follows, such as clipping, is as
    if one process had all samples. `num_timesteps` counts the steps of all workers.

    Args:
        stop: the signals that have arrived. It is set between two rollouts, so that all workers stop at the same step.
        signals: given the number of steps, the signals that have arrived at worker 0. It is called by worker 0 only.
    """

    def __init__(self, stop: Stop, signals: Callable[[int], list[int]]) -> None:
        super().__init__()
        self.stop, self.signals = stop, signals
        self.waited = 0.0  # seconds since the last rollout in which gradients were on their way
        self._since = time.perf_counter()
        self._hooks: list[Any] = []

    def _on_training_start(self) -> None:
        self._hooks = average_gradients(list(self.model.policy.parameters()), self._wait)
        self._since = time.perf_counter()

    def _on_rollout_start(self) -> None:
        self._normalise_together(False)  # an update is over, and a checkpoint may be written now

    def _on_step(self) -> bool:
        self.model.num_timesteps += (number() - 1) * self.training_env.num_envs
        return True

    def _on_rollout_end(self) -> None:
        self._normalise_together(number() > 1)
        arrived = self.signals(self.model.num_timesteps) if rank() == 0 else []
        self.stop.asked[:] = gather(arrived)[0]
        now = time.perf_counter()
        if self.waited:
            self.logger.record("time/averaging", self.waited / (now - self._since))
        self.waited, self._since = 0.0, now

    def _on_training_end(self) -> None:
        self._normalise_together(False)
        for hook in self._hooks:
            hook.remove()

    def _normalise_together(self, together: bool) -> None:
        """Normalise the advantages of a minibatch over all workers or, as Stable-Baselines3 does, over one."""
        assert isinstance(self.model, PPO)
        buffer = self.model.rollout_buffer
        self.model.normalize_advantage = not together
        if together:
            vars(buffer)["get"] = lambda size: normalised(type(buffer).get(buffer, size))
        else:
            vars(buffer).pop("get", None)

    def _wait(self, seconds: float) -> None:
        self.waited += seconds


def normalised(minibatches: Iterable[Samples]) -> Iterator[Samples]:
    """The minibatches of a pass over a rollout, each with advantages normalised over those of all workers.

    Raises:
        WorkerLost: a worker does not answer.
    """
    own = list(minibatches)
    found = [samples.advantages.double() for samples in own]
    sums = total(*[float(part) for a in found for part in (len(a), a.sum(), (a * a).sum())])
    for samples, count, first, second in zip(own, sums[::3], sums[1::3], sums[2::3], strict=True):
        mean = first / count
        deviation = math.sqrt(max(second - count * mean * mean, 0.0) / (count - 1.0))
        yield samples._replace(advantages=(samples.advantages - mean) / (deviation + 1e-8))


def average_gradients(weights: Sequence[nn.Parameter], waited: Callable[[float], None]) -> list[Any]:
    """Average the gradients of these weights over the workers at the end of every backward pass, in one message.

    Args:
        waited: is given the seconds that it took each time.

    Returns:
        Hooks, whose `remove` ends it.
    """
    queued = False

    def queue(_: torch.Tensor) -> None:
        nonlocal queued
        if not queued:  # at the first gradient of a backward pass
            queued = True
            torch.autograd.Variable._execution_engine.queue_callback(average)  # as DistributedDataParallel does

    def average() -> None:
        nonlocal queued
        queued = False
        if number() == 1:
            return
        gradients = [weight.grad for weight in weights if weight.grad is not None]
        flat = torch.cat([gradient.flatten() for gradient in gradients])
        begun = time.perf_counter()
        _together(lambda: distributed.all_reduce(flat))
        waited(time.perf_counter() - begun)
        flat /= number()
        parts = flat.split([gradient.numel() for gradient in gradients])
        torch._foreach_copy_(gradients, [part.view_as(own) for part, own in zip(parts, gradients, strict=True)])

    return [weight.register_post_accumulate_grad_hook(queue) for weight in weights if weight.requires_grad]
