"""The air table: pucks on a table without friction."""

from __future__ import annotations

from airhockey_env.web.messages import Message
from airhockey_env.web.sessions.base import Answer, Handler, Session


class AirSession(Session):
    """An air table."""

    def handlers(self) -> dict[str, Handler]:
        """One type of message so far, "start"."""
        return {"start": self._start}

    def _start(self, message: Message, now: float) -> Answer:
        return {"type": "table"}
