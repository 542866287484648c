"""Two players against each other, at any speed: named ones, or a training run's newest policy while it learns."""

from __future__ import annotations

import time
from typing import Any

from airhockey_env.kernel.state import LEFT
from airhockey_env.live.match import CONTROL_HZ, Event, LiveMatch
from airhockey_env.web.catalogue import dimensions
from airhockey_env.web.messages import Message, Refused
from airhockey_env.web.runs import Run
from airhockey_env.web.sessions.base import Answer, Handler, Session
from airhockey_env.web.sessions.play import state_of

FASTEST = 100.0
"""The greatest speed, as a multiple of the wall clock's. A slow machine shows less, and says so."""
SLICE = 0.05
"""s of the game between two looks at the clock: shorter than what a match catches up with at once."""
MOST_BEHIND = 0.1
"""s on the wall for which a page may not have asked; after a longer time, the match goes on from where it was."""
MOST_CONTACTS = 200
"""The most contacts that an answer holds: the last ones."""
MOST_EVENTS = 20
"""The most events that an answer holds: the last ones."""
LOOK_SECONDS = 1.0
"""s between two looks whether a run has a new policy."""


class WatchSession(Session):
    """A match of two players; the page asks for its state before every picture."""

    _match: LiveMatch | None = None
    _run: Run | None = None

    def handlers(self) -> dict[str, Handler]:
        """See docs/web.md."""
        return {
            "start": self._start,
            "turn": self._turn,
            "speed": self._set_speed,
            "step": self._step,
            "restart": self._restart,
        }

    def _start(self, message: Message, now: float) -> Answer:
        run = message.choice("run", self.catalogue.runs) if message.has("run") else None
        left = None if run is not None else message.choice("left", self.catalogue.players, "striker")
        right = message.choice("right", self.catalogue.players, "striker")
        table = message.choice("table", self.catalogue.tables, "full_size")
        points = message.whole("points", 1, 99, 7)
        speed = message.number("speed", 0.0, FASTEST, 1.0)
        message.finish()
        self._match, self._run, self._written, self._looked = None, None, 0.0, now
        if run is not None:
            self._run = self.catalogue.runs[run]
            policy, self._written = self._run.policy()
            if policy is None:
                return {"type": "waiting", "run": run}
        spec = self.catalogue.tables[table]
        self._match = LiveMatch(
            self.catalogue.players[right],
            left=self.catalogue.players[left] if left is not None else policy,
            table=spec,
            points=points,
        )
        self._speed, self._asked, self._time, self._told = speed, now, 0.0, 0.0
        self._match.restart(0.0)
        names = {"left": left or run, "right": right, "points": points, "run": run}
        return {"type": "match", "table": dimensions(spec), "control_hz": CONTROL_HZ, **names}

    def _turn(self, message: Message, now: float) -> Answer:
        with_contacts = message.flag("contacts", False)
        match = self._playing
        elapsed = min(now - self._asked, MOST_BEHIND)
        self._asked = now
        return self._advance(match, self._time + elapsed * self._speed, now, with_contacts)

    def _set_speed(self, message: Message, now: float) -> Answer:
        self._speed = message.number("speed", 0.0, FASTEST)
        return None

    def _step(self, message: Message, now: float) -> Answer:
        """One control step, while the match stands still."""
        self._asked = now
        return self._advance(self._playing, self._time + 1.0 / CONTROL_HZ, now, with_contacts=True)

    def _restart(self, message: Message, now: float) -> Answer:
        self._playing.restart(self._time)
        return None

    def _advance(self, match: LiveMatch, goal: float, now: float, with_contacts: bool) -> Answer:
        """Play up to a time of the match's own clock, or as far as one answer may take."""
        if self._run is not None and now - self._looked > LOOK_SECONDS:
            self._looked = now
            policy, written = self._run.policy()
            if policy is not None and written != self._written:
                match.replace(LEFT, policy)
                self._written = written
        ends = time.perf_counter() + self.limits.answer_seconds
        events: list[Event] = []
        contacts: list[Any] = []
        while True:
            self._time = min(goal, self._time + SLICE)
            events += match.advance(self._time)
            contacts += match.contacts
            if self._time >= goal or time.perf_counter() > ends:
                break
        state = {
            "type": "state",
            "time": round(now, 4),
            "elapsed": match.elapsed,
            **state_of(match, events[-MOST_EVENTS:]),
        }
        if with_contacts:
            state["contacts"] = contacts[-MOST_CONTACTS:]
        if self._run is not None:
            state["written"] = self._written
        return state

    @property
    def _playing(self) -> LiveMatch:
        if self._match is None:
            raise Refused("there is no match: start one first")
        return self._match
