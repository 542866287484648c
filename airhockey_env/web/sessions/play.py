"""A match of the visitor against a player."""

from __future__ import annotations

from typing import Any

from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.live.match import START_PAUSE, Event, LiveMatch
from airhockey_env.web.catalogue import dimensions
from airhockey_env.web.messages import Message, Refused
from airhockey_env.web.replays import replay_bytes
from airhockey_env.web.sessions.base import Answer, Handler, Session

FARTHEST = 10.0
"""m from the centre of the table that a pointer may be."""


class PlaySession(Session):
    """A match; the page asks for its state before every picture, and says where the pointer is."""

    _match: LiveMatch | None = None

    @classmethod
    def prepare(cls) -> None:
        """Compile what a match needs."""
        match = LiveMatch("expert", recorded=True)
        match.advance(START_PAUSE)
        match.advance(START_PAUSE + 0.05, (0.0, 0.0))
        replay_bytes(match.replay())

    def handlers(self) -> dict[str, Handler]:
        """See docs/web.md."""
        return {
            "start": self._start,
            "turn": self._turn,
            "restart": self._restart,
            "pause": self._pause,
            "resume": self._resume,
            "replay": self._replay,
        }

    def _start(self, message: Message, now: float) -> Answer:
        opponent = message.choice("opponent", self.catalogue.players, "striker")
        table = message.choice("table", self.catalogue.tables, "full_size")
        skill = message.number("skill", 0.0, 1.0, 1.0)
        points = message.whole("points", 1, 99, 7)
        message.finish()
        spec = self.catalogue.tables[table]
        self._match = LiveMatch(self.catalogue.players[opponent], skill=skill, table=spec, points=points, recorded=True)
        self._match.restart(now)
        return {"type": "match", "table": dimensions(spec), "opponent": opponent, "skill": skill, "points": points}

    def _turn(self, message: Message, now: float) -> Answer:
        match = self._playing
        x_y = message.numbers("pointer", 2, FARTHEST) if message.has("pointer") else None
        events = match.advance(now, None if x_y is None else (x_y[0], x_y[1]))
        return {"type": "state", "time": round(now, 4), **state_of(match, events)}

    def _restart(self, message: Message, now: float) -> Answer:
        self._playing.restart(now)
        return None

    def _pause(self, message: Message, now: float) -> Answer:
        self._playing.pause()
        return None

    def _resume(self, message: Message, now: float) -> Answer:
        self._playing.resume(now)
        return None

    def _replay(self, message: Message, now: float) -> Answer:
        match = self._playing
        return lambda: replay_bytes(match.replay())

    @property
    def _playing(self) -> LiveMatch:
        if self._match is None:
            raise Refused("there is no match: start one first")
        return self._match


def state_of(match: LiveMatch, events: list[Event]) -> dict[str, Any]:
    """What a page draws of a match: see docs/web.md."""
    return {
        "positions": [[round(x, 5) for x in match.positions[disc].tolist()] for disc in (LEFT, RIGHT, PUCK)],
        "score": match.score,
        "clock": round(match.clock, 3),
        "notice": match.notice,
        "events": [[event.kind, round(event.strength, 3), round(event.x, 3)] for event in events],
    }
