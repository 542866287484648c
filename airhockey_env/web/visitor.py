"""One visitor: a socket, and the session behind it."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from concurrent.futures import Executor
from typing import Any

from aiohttp import WSCloseCode, WSMsgType, web

from airhockey_env.version import __version__
from airhockey_env.web.catalogue import Catalogue
from airhockey_env.web.connections import drop, time_limit
from airhockey_env.web.limits import Allowance, Limits
from airhockey_env.web.messages import Refused, encode
from airhockey_env.web.sessions import Session

_log = logging.getLogger(__name__)

_ENDINGS = (WSMsgType.CLOSE, WSMsgType.CLOSING, WSMsgType.CLOSED, WSMsgType.ERROR)


class Visitor:
    """Reads the messages of one page, one after the other, and answers them.

    A visitor that is slow to read, to write or to be answered waits alone: nothing in here is shared.

    Args:
        request: the one that the socket belongs to.
        socket: open.
        limits: what the visitor may use.
        jobs: does what takes long.
        crowd: how many visitors there are.
    """

    def __init__(
        self,
        request: web.Request,
        socket: web.WebSocketResponse,
        limits: Limits,
        jobs: Executor,
        crowd: Callable[[], int],
    ) -> None:
        self._request, self._socket, self._limits, self._jobs, self._crowd = request, socket, limits, jobs, crowd

    async def serve(self, kind: type[Session], catalogue: Catalogue) -> None:
        """Serve a session of this kind until it ends, whatever ends it."""
        try:
            session = kind(catalogue, self._limits)
            await self._send({"type": "hello", "version": __version__, **catalogue.as_dict()})
            await self._converse(session)
        except Refused as error:
            await self.end(WSCloseCode.POLICY_VIOLATION, str(error))
        except ConnectionError:  # the page is gone
            drop(self._request)
        except Exception:
            _log.exception("a session has failed")
            await self.end(WSCloseCode.INTERNAL_ERROR, "the server has made a mistake; its log says which")

    async def end(self, code: int, reason: str) -> None:
        """Tell the page why its session ends, and end it."""
        try:
            await self._send({"type": "end", "reason": reason})
            await self._socket.close(code=code, message=reason.encode()[:120])  # a close frame holds 123 bytes
        except (ConnectionError, RuntimeError):
            drop(self._request)

    async def _converse(self, session: Session) -> None:
        limits = self._limits
        messages = Allowance(limits.messages, limits.burst)
        work = Allowance(limits.share, limits.share_burst)
        said = time.perf_counter()  # when the last message came
        asked = False  # whether the page was asked for a sign of life since anything came of it
        while True:
            left = said + limits.idle_seconds - time.perf_counter()
            if left <= 0.0:
                raise Refused(f"the page has said nothing for {limits.idle_seconds:g} s")
            try:
                message = await self._socket.receive(min(left, limits.heartbeat_seconds))
            except asyncio.TimeoutError:
                if left <= limits.heartbeat_seconds:
                    continue
                if asked:
                    return drop(self._request)
                asked = True
                await self._socket.ping()
                continue
            asked = False
            if message.type in _ENDINGS:
                return
            now = time.perf_counter()
            if messages.spend(1.0, now) > 0.0:
                raise Refused(f"the page has sent more than {limits.messages:g} messages a second")
            if message.type == WSMsgType.PING:
                await self._socket.pong(message.data)
            elif message.type == WSMsgType.BINARY:
                raise Refused("a message must be a text")
            elif message.type == WSMsgType.TEXT:
                said = now
                answer = session.answer(message.data, now)
                if callable(answer):
                    answer = await asyncio.get_running_loop().run_in_executor(self._jobs, answer)
                worked = time.perf_counter()
                if answer is not None:
                    await self._send(answer)
                share = min(limits.share, limits.all_shares / max(1, self._crowd()))
                await asyncio.sleep(work.spend(worked - now, worked, share))  # 0 s too: the others have their turn

    async def _send(self, answer: dict[str, Any] | bytes) -> None:
        """Send an answer; a page that does not take it in time is dropped."""
        with time_limit(self._request, self._limits.send_seconds):
            if isinstance(answer, bytes):
                await self._socket.send_bytes(answer)
            else:
                await self._socket.send_str(encode(answer))
