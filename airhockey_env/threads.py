"""Threads: those that share the rows of a batch, and the lock that keeps a caller's own threads apart."""

from __future__ import annotations

import functools
import os
import threading
import weakref
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any, TypeVar

Method = TypeVar("Method", bound=Callable[..., Any])


class Threads:
    """Up to `num_threads` threads that share the rows of a game, started when they are first needed.

    A copy, a pickle and a forked child start threads of their own: a child has none of its parent's.

    Attributes:
        num_threads: the greatest number that work at once, the caller's included; by default one for each core.
        lock: held by the thread that uses the game; see `one_at_a_time`.
    """

    def __init__(self, num_threads: int | None) -> None:
        self.num_threads: int = num_threads or _cores()
        self.lock: threading.RLock = threading.RLock()
        self._pool: ThreadPoolExecutor | None = None
        _all.add(self)

    def share(self, n: int, rows_per_thread: int, work: Callable[..., None], *arguments: Any) -> None:
        """Do `work(first, last, *arguments)` for n rows, in parts for several threads where these are worth it.

        When it returns or raises, Ctrl-C included, no thread works on the rows any more.
        """
        threads = min(self.num_threads, n // rows_per_thread)
        if threads < 2:
            work(0, n, *arguments)
            return
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.num_threads - 1, thread_name_prefix="airhockey")
        bounds = [n * k // threads for k in range(threads + 1)]
        parts: list[Future[None]] = []
        try:
            for k in range(1, threads):
                parts.append(self._pool.submit(work, bounds[k], bounds[k + 1], *arguments))
            work(0, bounds[1], *arguments)
        finally:
            _wait_for_all(parts)
        for part in parts:
            part.result()

    def close(self) -> None:
        """End the threads; they start again if they are needed again."""
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.shutdown()

    def after_fork(self) -> None:
        """Forget, in a forked child, the threads that stayed in the parent, and the lock if one of them holds it."""
        self._pool = None
        if self.lock.acquire(blocking=False):
            self.lock.release()
        else:
            self.lock = threading.RLock()

    def __reduce__(self) -> tuple[Any, ...]:
        return Threads, (self.num_threads,)


def one_at_a_time(method: Method) -> Method:
    """Let one thread at a time call such methods of an object with `_threads`, those of its game; others wait.

    Two threads that step the same game would play in each other's arrays.
    """

    @functools.wraps(method)
    def locked(self: Any, *arguments: Any, **named: Any) -> Any:
        with self._threads.lock:
            return method(self, *arguments, **named)

    return locked  # type: ignore[return-value]


def _cores() -> int:
    """How many processor cores this process may use: taskset, Slurm and containers may leave it few of many."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _wait_for_all(parts: list[Future[None]]) -> None:
    """Wait until all parts are done, however often Ctrl-C is pressed; it is raised afterwards."""
    interrupt = None
    while True:
        try:
            wait(parts)
            break
        except KeyboardInterrupt as error:
            interrupt = error
    if interrupt is not None:
        raise interrupt


_all: weakref.WeakSet[Threads] = weakref.WeakSet()


def _after_fork() -> None:
    for threads in _all:
        threads.after_fork()


if hasattr(os, "register_at_fork"):  # not on Windows, which does not fork
    os.register_at_fork(after_in_child=_after_fork)
