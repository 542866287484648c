"""Stopping a training command by signals without losing anything.

Ctrl-C ends learning; the run is saved and the report follows. A second one, SIGTERM or SIGHUP ends the command as soon
as the run is saved. Signals interrupt nothing: they are noted, and checked between two steps.
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
    """A signal ended the command. The exit code is 128 plus the signal's number, as in shells."""


class Stop:
    """The signals that have arrived and were not handled yet."""

    def __init__(self) -> None:
        self.asked: list[int] = []

    def note(self, number: int, _: object = None) -> None:
        """Note a signal. This is a handler for `signal.signal`."""
        self.asked.append(number)

    def forget_ctrl_c(self) -> None:
        """Forget one Ctrl-C, if there was one, because it was handled."""
        if signal.SIGINT in self.asked:
            self.asked.remove(signal.SIGINT)

    def check(self) -> None:
        """Stop here if a signal has arrived. Call this where stopping breaks nothing.

        Raises:
            Stopped: SIGTERM or SIGHUP has arrived.
            KeyboardInterrupt: Ctrl-C was pressed.
        """
        for number in self.asked:
            if number != signal.SIGINT:
                raise Stopped(128 + number)
        if self.asked:
            raise KeyboardInterrupt

    def observe(self, *_: Any) -> Callable[..., None]:
        """Stop between two steps of an evaluation. This is an observer for `play_points`."""
        return lambda *_: self.check()

    def between(self, items: Iterable[Item]) -> Iterator[Item]:
        """Yield the same items, and stop between two of them."""
        for item in items:
            self.check()
            yield item


class StopLearning(BaseCallback):
    """Ends learning at the next step after a signal."""

    def __init__(self, stop: Stop) -> None:
        super().__init__()
        self.stop = stop

    def _on_step(self) -> bool:
        return not self.stop.asked


@contextlib.contextmanager
def stopping() -> Iterator[Stop]:
    """Within this context, signals are noted instead of having their usual effect.

    Ignored signals stay ignored: nohup ignores SIGHUP, and shells ignore Ctrl-C in background jobs. Outside the main
    thread nothing changes, because Python handles signals only there.
    """
    stop, before = Stop(), {}
    if threading.current_thread() is threading.main_thread():
        for number in SIGNALS:
            handler = signal.getsignal(number)
            if handler not in (signal.SIG_IGN, None):  # None: the handler was not set by Python
                before[number] = handler
                signal.signal(number, stop.note)
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
