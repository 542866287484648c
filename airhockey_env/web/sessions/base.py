"""What a session is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from airhockey_env.web.catalogue import Catalogue
from airhockey_env.web.limits import Limits
from airhockey_env.web.messages import Message, Refused

Answer = dict[str, Any] | bytes | Callable[[], bytes] | None
"""An object with a `type`, which is sent as JSON; bytes; nothing; or a function that takes long and returns bytes: it
is called in another thread, and the session gets no message until it has returned."""

Handler = Callable[[Message, float], Answer]
"""What answers messages of one type: takes the message and the time, s, of a clock that never goes back."""


class Session:
    """One visitor's table.

    Everything that it does is an answer to a message of its own page, and every answer takes little time: a session has
    no tasks, no clocks and no threads, and knows nothing of sockets. A kind of session gives its `handlers`.

    Args:
        catalogue: what the visitor may choose from.
        limits: what the session may use.
    """

    def __init__(self, catalogue: Catalogue, limits: Limits) -> None:
        self.catalogue, self.limits = catalogue, limits
        self._handlers = self.handlers()

    @classmethod
    def prepare(cls) -> None:
        """Do what takes long the first time (compiling, say) before the first visitor comes."""

    def handlers(self) -> dict[str, Handler]:
        """What answers the messages of each type."""
        raise NotImplementedError

    def answer(self, text: str, now: float) -> Answer:
        """Answer one message.

        Args:
            text: the message.
            now: s, of a clock that never goes back.

        Raises:
            Refused: the message is not one of this session, or not now; the session is over then.
        """
        message = Message(text)
        handler = self._handlers.get(message.type)
        if handler is None:
            raise Refused(f"type must be one of {', '.join(self._handlers)}")
        answer = handler(message, now)
        message.finish()
        return answer
