"""Ray: one of its own for a command, or a cluster that is there already. Needs the extra `distributed`."""

from __future__ import annotations

import contextlib
import itertools
import os
import secrets
import signal
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from gymnasium.error import DependencyNotInstalled

from agents.training.stopping import Stop, stopping

Item = TypeVar("Item")
Result = TypeVar("Result")

OWN = {
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",  # on every system: listen at 127.0.0.1 only
    "RAY_AUTH_MODE": "token",
    "GLOO_SOCKET_IFNAME": "lo",
}
"""Environment variables of a Ray that a command starts for itself."""

ALWAYS = {
    "RAY_USAGE_STATS_ENABLED": "0",  # Ray would report its use to its makers
    "RAY_CHDIR_TO_TRIAL_DIR": "0",  # relative paths in options stay what they are
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # what Ray will do from its next version on, without the warning
}


def import_ray(option: str = "--workers") -> Any:
    """Import Ray.

    Args:
        option: the name of the option that needs it.

    Raises:
        gymnasium.error.DependencyNotInstalled: it is missing.
    """
    try:
        import ray
    except ImportError as error:
        install = 'pip install -c constraints-distributed.txt -e ".[distributed]"'
        raise DependencyNotInstalled(f"{option} needs Ray: {install}") from error
    return ray


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
        ValueError, ConnectionError: there is no cluster at the address.
    """
    environment = ALWAYS if address is not None else {**ALWAYS, **OWN, "RAY_AUTH_TOKEN": secrets.token_hex(32)}
    before = {name: os.environ.get(name) for name in environment}
    os.environ.update(environment)  # before Ray is imported, which reads them once
    try:
        ray = import_ray()
        if ray.is_initialized():
            yield
            return
        try:
            if address is None:
                ray.init("local", num_cpus=workers, include_dashboard=False, **_QUIET)
            else:
                ray.init(address, **_QUIET)
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise ConnectionError(
                f"--address must be that of a running Ray cluster, got {address!r}: {error}"
            ) from error
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


_QUIET: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}


POLL = 0.2
"""While tasks run, signals are looked for this often, s."""


def spread(
    function: Callable[[Item], Result], items: Iterable[Item], workers: int | None = None, address: str | None = None
) -> Iterator[tuple[int, Result]]:
    """Call a function with every item; yield the number of each item, from 0, and its result, as the calls end.

    With several workers or an address, each call is a Ray task on one processor, in the current folder, which all nodes
    must have under the same path. Ray repeats a task whose worker or node is lost. Otherwise the calls are made here,
    one after the other. Results do not depend on this if the function's seeds depend on the item alone.

    After a signal, or when the caller takes no more results, the tasks are interrupted as by Ctrl-C. This function
    returns when they have ended, so that a task that is a training run has saved it.

    Args:
        function: it, the items and its results must be picklable by cloudpickle if there are tasks.
        items: the next one is taken when a worker is free and the results before it have been handled.
        workers: the greatest number of tasks at once, 1 or more; None is 1.
        address: see `connect`.

    Raises:
        gymnasium.error.DependencyNotInstalled, ConnectionError: see `connect`.
        OSError: workers were lost again and again, or a node lacks the current folder.
        KeyboardInterrupt: Ctrl-C was pressed.
        Stopped: SIGTERM or SIGHUP has arrived.
        Exception: what the function raised.
    """
    workers = workers or 1
    if workers == 1 and address is None:
        for number, item in enumerate(items):
            yield number, function(item)
        return
    with connect(address, workers), stopping() as stop:
        ray = import_ray()
        task = ray.remote(num_cpus=1)(_in_folder)
        shared, upcoming = ray.put((function, os.getcwd())), enumerate(items)
        running: dict[Any, int] = {}
        try:
            while True:
                for number, item in itertools.islice(upcoming, workers - len(running)):
                    running[task.remote(shared, item)] = number
                if not running:
                    return
                done, _ = ray.wait(list(running), timeout=POLL)
                stop.check()
                for reference in done:
                    yield running.pop(reference), _result(reference)
        finally:
            _interrupt(list(running), stop)


def _in_folder(shared: tuple[Callable[[Item], Result], str], item: Item) -> Result:
    """Call the shared function in the shared folder. This runs in a worker."""
    function, folder = shared
    try:
        os.chdir(folder)
    except OSError as error:
        raise OSError(
            f"the current folder must be on every node of the cluster under the same path, got {folder} ({error})"
        ) from error
    return function(item)


def _result(reference: Any) -> Any:
    """The result of a task that has ended, or its exception as the function raised it."""
    ray = import_ray()
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from error
    except ray.exceptions.RayError as error:
        raise OSError(f"a task could not be completed on the cluster: {error}") from error


def _interrupt(running: list[Any], stop: Stop) -> None:
    """Interrupt tasks as by Ctrl-C, and wait for their ends. SIGTERM or a second signal interrupts them twice."""
    ray = import_ray()
    sent = 0
    while running:
        twice = len(stop.asked) > 1 or any(number != signal.SIGINT for number in stop.asked)
        for _ in range(sent, 2 if twice else 1):
            for reference in running:
                ray.cancel(reference)
            sent += 1
        _, running = ray.wait(running, num_returns=len(running), timeout=POLL)
