"""What a data-parallel update of PPO costs on one processor, measured: steps, gradients, and the averaging of these."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

SHARES = (1, 2, 4, 8, 16)
"""The numbers of workers whose shares of tables and samples are timed, on one processor."""

UPDATES = 4
"""Updates that are timed for each share, after one that is not."""

MESSAGES = 300
"""All-reduces that are timed."""


@dataclass(frozen=True)
class Costs:
    """What one worker spends, s, and what it sends.

    Attributes:
        step: of a step of all its tables, without what grows with their number.
        table: of a step of one table more.
        gradient: of a gradient step, without what grows with the number of samples.
        sample: of one sample more.
        latency: of a message to another worker.
        byte: of a byte more in a message.
        size: bytes of the gradients.
        spread: standard deviation of the logarithm of what a gradient step takes: how much workers differ by chance.
    """

    step: float
    table: float
    gradient: float
    sample: float
    latency: float
    byte: float
    size: int
    spread: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return asdict(self)


def measure(quick: bool = False) -> Costs:
    """Measure all but the spread, for the defaults of `scripts.train_ppo`.

    Steps and gradients are measured in processor time, which other processes hardly change, and the messages between
    two processes of this machine, of which the quickest quarter counts.
    """
    import torch

    from agents.training.ppo import PpoArgs

    torch.set_num_threads(1)
    args = PpoArgs()
    shares, updates = ((SHARES[0], SHARES[-1]), 1) if quick else (SHARES, UPDATES)
    rows = [_time_share(args, share, updates) for share in shares]
    tables, step_times, samples, gradient_times = np.array([row[:4] for row in rows]).T
    table, step = fit_costs(tables, step_times)
    sample, gradient = fit_costs(samples, gradient_times)
    size = rows[0][4]
    empty, full = (_time_messages(number, 20 if quick else MESSAGES) for number in (4, size))
    # gloo's ring of two workers: two messages of half of the bytes each.
    latency, byte = empty / 2, max(0.0, full - empty) / size
    return Costs(step, table, gradient, sample, latency, byte, size)


def fit_costs(numbers: NDArray[np.float64], seconds: NDArray[np.float64]) -> tuple[float, float]:
    """The line that fits best among those without negative costs, by least squares.

    Args:
        numbers: of tables or samples, two or more of them, all above 0.
        seconds: what each of these numbers took.

    Returns:
        The cost of one more, and the cost without any, both 0 or more.
    """
    slope, constant = np.polyfit(numbers, seconds, 1)
    if slope < 0.0:  # the best allowed line then has the least allowed slope
        return 0.0, float(np.mean(seconds))
    if constant < 0.0:
        return float(np.dot(numbers, seconds) / np.dot(numbers, numbers)), 0.0
    return float(slope), float(constant)


def _time_share(args: Any, share: int, updates: int) -> tuple[float, float, float, float, int]:
    """Tables, s of a step of them, samples, s of a gradient step with them, and bytes of the gradients."""
    from dataclasses import replace

    from stable_baselines3.common.callbacks import BaseCallback

    from agents.training.ppo import make_model, make_tables
    from agents.training.recipe import conditions_of

    part = replace(args, num_envs=args.num_envs // share, batch_size=args.batch_size // share)
    env = make_tables(part, conditions_of(part), part.num_envs)
    model = make_model(part, env)  # type: ignore[arg-type]

    class Clock(BaseCallback):
        """Notes the processor time at the beginnings and ends of rollouts."""

        def __init__(self) -> None:
            super().__init__()
            self.begins: list[float] = []
            self.ends: list[float] = []

        def _on_step(self) -> bool:
            return True

        def _on_rollout_start(self) -> None:
            self.begins.append(time.process_time())

        def _on_rollout_end(self) -> None:
            self.ends.append(time.process_time())

    clock = Clock()
    rollout = part.num_envs * part.n_steps
    model.learn((updates + 2) * rollout, callback=clock)
    rollouts = np.median(np.subtract(clock.ends, clock.begins)[1:])
    learning = np.median(np.subtract(clock.begins[1:], clock.ends[:-1])[1:])
    gradients = args.n_epochs * rollout // part.batch_size
    size = sum(weight.numel() * weight.element_size() for weight in model.policy.parameters())
    return part.num_envs, float(rollouts) / part.n_steps, part.batch_size, float(learning) / gradients, size


def _time_messages(size: int, number: int) -> float:
    """Seconds of an all-reduce of so many bytes between two processes of this machine."""
    import tempfile

    import torch.multiprocessing

    with tempfile.TemporaryDirectory() as folder:
        torch.multiprocessing.spawn(_exchange, (folder, size, number), nprocs=2)
        return float(np.load(f"{folder}/times.npy"))


def _exchange(rank: int, folder: str, size: int, number: int) -> None:
    import torch
    from torch import distributed

    torch.set_num_threads(1)
    distributed.init_process_group("gloo", init_method=f"file://{folder}/store", rank=rank, world_size=2)
    data = torch.zeros(size // 4)
    times = []
    for _ in range(number):
        begun = time.perf_counter()
        distributed.all_reduce(data)
        times.append(time.perf_counter() - begun)
    if rank == 0:
        np.save(f"{folder}/times.npy", np.percentile(times, 25))
    distributed.destroy_process_group()
