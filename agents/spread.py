"""Work in many parts, spread over the workers of Ray or done here: the same results, wherever they are made."""

from __future__ import annotations

import itertools
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from agents.cluster import connect
from agents.training.stopping import Stop, stopping

Item = TypeVar("Item")
Result = TypeVar("Result")

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
        import ray

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
    import ray

    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from error
    except ray.exceptions.RayError as error:
        raise OSError(f"a task could not be completed on the cluster: {error}") from error


def _interrupt(running: list[Any], stop: Stop) -> None:
    """Interrupt tasks as by Ctrl-C, and wait for their ends. SIGTERM or a second signal interrupts them once more."""
    import ray

    sent = 0
    while running:
        urgent = len(stop.asked) > 1 or any(number != signal.SIGINT for number in stop.asked)
        if sent < 1 + urgent:
            for reference in running:
                ray.cancel(reference)
            sent += 1
        _, running = ray.wait(running, num_returns=len(running), timeout=POLL)
