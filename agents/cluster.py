"""Ray: one of its own for a command, or a cluster that is there already. Needs the extra `distributed`."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import secrets
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from typing import Any

from gymnasium.error import DependencyNotInstalled

OWN = {
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",  # on every system: listen at 127.0.0.1 only
    "RAY_AUTH_MODE": "token",
    "RAY_AUTH_TOKEN": secrets.token_hex(32),  # the same for all, because Ray reads it once in a process
    "GLOO_SOCKET_IFNAME": "lo0" if sys.platform == "darwin" else "lo",  # torch.distributed listens there
    "RAY_worker_niceness": "0",  # as the command itself; Ray would give its workers 15
}
"""Environment variables of a Ray that a command starts for itself."""

ALWAYS = {
    "RAY_USAGE_STATS_ENABLED": "0",  # Ray would report its use to its makers
    "RAY_CHDIR_TO_TRIAL_DIR": "0",  # relative paths in options stay what they are
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # what Ray will do from its next version on, without the warning
}


CONNECT_SECONDS = 10
"""Seconds in which a cluster has to answer."""

_QUIET: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}


def check_ray(option: str) -> None:
    """Check that Ray is there, without importing it.

    Args:
        option: the name of the option that needs it.

    Raises:
        gymnasium.error.DependencyNotInstalled: it is missing.
    """
    if importlib.util.find_spec("ray") is None:
        install = 'pip install -c constraints-distributed.txt -e ".[distributed]"'
        raise DependencyNotInstalled(f"{option} needs Ray, in an environment of its own: {install}")


@contextlib.contextmanager
def connect(address: str | None, workers: int) -> Iterator[None]:
    """Within this context, Ray can be used; it ends with it, and so does everything that was started on it.

    Without an address, Ray starts here with `workers` processors. It then listens at 127.0.0.1 only, with a token that
    nobody else knows, and has no dashboard. A Ray that this process uses already is used further.

    Args:
        address: of a running cluster: "auto" for the one on this machine, or HOST:PORT. None starts one.
        workers: number of processors of a Ray that is started.

    Raises:
        gymnasium.error.DependencyNotInstalled: Ray is missing.
        ConnectionError: there is no cluster at the address, or Ray could not be started.
    """
    environment = ALWAYS if address is not None else {**ALWAYS, **OWN}
    before = {name: os.environ.get(name) for name in environment}
    os.environ.update(environment)  # before Ray is imported, which reads them once
    try:
        check_ray("--workers")
        import ray

        if ray.is_initialized():
            yield
            return
        with _own_signals():
            if address is None:
                _start(workers)
            else:
                _join(address)
        try:
            yield
        finally:
            ray.shutdown()
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _start(processors: int) -> None:
    import ray

    try:
        ray.init("local", num_cpus=processors, include_dashboard=False, **_QUIET)
    except Exception as error:  # Ray raises no subclass where a busy machine is too slow for it
        raise ConnectionError(f"Ray could not be started: {error}") from error


def _join(address: str) -> None:
    import ray

    try:
        if address != "auto":  # Ray would try for minutes
            host, _, port = address.rpartition(":")
            socket.create_connection((host, int(port)), CONNECT_SECONDS).close()
        ray.init(address, **_QUIET)
    except (OSError, ValueError, RuntimeError) as error:
        wanted = "auto or HOST:PORT of a running Ray cluster"
        raise ConnectionError(f"--address must be {wanted}, got {address!r}: {error}") from error


@contextlib.contextmanager
def _own_signals() -> Iterator[None]:
    """Keep the handler of SIGTERM, which Ray would replace by one that ends the process."""
    handler = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread() and handler is not None:
            signal.signal(signal.SIGTERM, handler)
