"""The workers of a run: processes that learn together, each on its own tables.

What is here needs a process group of torch.distributed, in which every worker makes the same calls in the same order.
Without one there is one worker, and every function returns what that one has.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable
from typing import Any, TypeVar

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from torch import distributed, nn

from agents.training.stopping import Stop

Item = TypeVar("Item")


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

    Each worker computes the gradients of its own samples. Before a step they are averaged over the workers, and then
    clipped, as if one process had all samples. So that Stable-Baselines3 does not clip before, it has no limit during
    an update. `num_timesteps` counts the steps of all workers.

    Args:
        stop: the signals that have arrived. It is set between two rollouts, so that all workers stop at the same step.
        signals: given the number of steps, the signals that have arrived at worker 0. It is called by worker 0 only.
    """

    def __init__(self, stop: Stop, signals: Callable[[int], list[int]]) -> None:
        super().__init__()
        self.stop, self.signals = stop, signals
        self.waited = 0.0  # seconds since the last rollout in which gradients were on their way
        self._limit = math.inf
        self._since = time.perf_counter()

    def _on_training_start(self) -> None:
        self._hook = self.model.policy.optimizer.register_step_pre_hook(self._average)
        self._since = time.perf_counter()

    def _on_rollout_start(self) -> None:
        self._restore_limit()

    def _on_step(self) -> bool:
        self.model.num_timesteps += (number() - 1) * self.training_env.num_envs
        return True

    def _on_rollout_end(self) -> None:
        arrived = self.signals(self.model.num_timesteps) if rank() == 0 else []
        self.stop.asked[:] = gather(arrived)[0]
        now = time.perf_counter()
        if self.waited:
            self.logger.record("time/averaging", self.waited / (now - self._since))
        self.waited, self._since = 0.0, now
        self._limit, self.model.max_grad_norm = self.model.max_grad_norm, math.inf  # type: ignore[attr-defined]

    def _on_training_end(self) -> None:
        self._restore_limit()
        self._hook.remove()

    def _restore_limit(self) -> None:
        if self._limit < math.inf:
            self.model.max_grad_norm, self._limit = self._limit, math.inf  # type: ignore[attr-defined]

    def _average(self, optimizer: torch.optim.Optimizer, *_: Any) -> None:
        """Average the gradients in one message, and clip them."""
        weights = [weight for group in optimizer.param_groups for weight in group["params"]]
        gradients = [weight.grad for weight in weights if weight.grad is not None]
        flat = torch.cat([gradient.flatten() for gradient in gradients])
        begun = time.perf_counter()
        if number() > 1:
            _together(lambda: distributed.all_reduce(flat))
        self.waited += time.perf_counter() - begun
        flat /= number()
        for gradient, averaged in zip(gradients, flat.split([gradient.numel() for gradient in gradients]), strict=True):
            gradient.copy_(averaged.view_as(gradient))
        nn.utils.clip_grad_norm_(weights, self._limit)
