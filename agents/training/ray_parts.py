"""Parts of Ray Train for `agents.training.parallel`. This module imports Ray."""

from __future__ import annotations

import uuid
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import ray
from ray.train import UserCallback
from ray.train.torch import TorchConfig
from ray.train.torch.config import _TorchBackend
from torch import distributed


def torch_config(storage: str | None, timeout: int) -> TorchConfig:
    """How the workers' process group is set up.

    Args:
        storage: a folder of this machine, if all workers are here; None if they are in a cluster.
        timeout: seconds that workers wait for each other.
    """
    return TorchConfig("gloo", timeout_s=timeout) if storage is None else LocalTorch("gloo", "file", timeout, storage)


@dataclass
class LocalTorch(TorchConfig):
    """A process group whose processes find each other by a file. By default one of them would open a port to all."""

    storage: str = ""

    @property
    def backend_cls(self) -> type[_TorchBackend]:
        return _LocalBackend


class _LocalBackend(_TorchBackend):
    def on_start(self, worker_group: Any, backend_config: TorchConfig) -> None:
        assert isinstance(backend_config, LocalTorch)
        file = Path(backend_config.storage) / uuid.uuid4().hex  # another one whenever the workers start
        size = len(worker_group)
        ray.get([worker_group.execute_single_async(k, _join, backend_config, file, k, size) for k in range(size)])


def _join(config: TorchConfig, file: Path, rank: int, size: int) -> None:
    timeout = timedelta(seconds=config.timeout_s)
    distributed.init_process_group(config.backend, file.as_uri(), timeout, rank=rank, world_size=size)


class Losses(UserCallback):
    """Tells the command when workers are lost. It is called in the process that controls them."""

    def __init__(self, post: Any) -> None:
        self.post = post

    def after_exception(self, run_context: Any, worker_exceptions: dict[int, Exception]) -> None:
        ray.get(self.post.lose.remote(sorted(worker_exceptions)))
