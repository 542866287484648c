"""Signals ask a training command to stop, and it stops where nothing is lost.

Ctrl-C ends learning; the run is saved and the report written all the same. A second one, SIGTERM or SIGHUP ends the
command as soon as the run is saved. No signal breaks into anything: they are noted, and looked at between two steps.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from stable_baselines3.common.callbacks import BaseCallback

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Windows has no SIGHUP."""

Item = TypeVar("Item")


class Stopped(SystemExit):
    """A signal ended the command: exit code 128 and the signal's number, by the shells' convention."""


class Stop:
    """What signals have asked for and what has not been heeded yet."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def note(self, number: int, _: object = None) -> None:
        """Take a signal; for `signal.signal`."""
        self.asked.append(number)

    def take_ctrl_c(self) -> bool:
        """Whether there was a Ctrl-C, which is heeded with this."""
        if signal.SIGINT in self.asked:
            self.asked.remove(signal.SIGINT)
            return True
        return False

    def check(self) -> None:
        """Stop here, if it is asked for. Call it where stopping breaks nothing.

        Raises:
            Stopped: by SIGTERM or SIGHUP.
            KeyboardInterrupt: by Ctrl-C.
        """
        for number in self.asked:
            if number != signal.SIGINT:
                raise Stopped(128 + number)
        if self.asked:
            raise KeyboardInterrupt

    def watch(self, *_: Any) -> Callable[..., None]:
        """Look on while points are played (`agents.measuring.evaluation.Watch`) and stop between two steps."""
        return lambda *_: self.check()

    def between(self, items: Iterable[Item]) -> Iterator[Item]:
        """The same items; stops between two of them."""
        for item in items:
            self.check()
            yield item


class StopLearning(BaseCallback):
    """Ends learning at the next step, if it is asked for."""

    def __init__(self, stop: Stop) -> None:
        super().__init__()
        self.stop = stop

    def _on_step(self) -> bool:
        return not self.stop.asked


@contextlib.contextmanager
def stopping() -> Iterator[Stop]:
    """Let signals be noted, in place of what they do otherwise, until what is within ends.

    Those that are ignored stay so (nohup ignores SIGHUP, and shells Ctrl-C for jobs in the background). Outside of the
    main thread nothing changes: Python's signals belong to that one.
    """
    stop, before = Stop(), {}
    if threading.current_thread() is threading.main_thread():
        for number in SIGNALS:
            handler = signal.getsignal(number)
            if handler not in (signal.SIG_IGN, None):  # None: not set by Python, so not ours to replace
                before[number] = handler
                signal.signal(number, stop.note)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
