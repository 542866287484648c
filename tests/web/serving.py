"""A server in the test's own event loop, and visitors without a browser."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from typing import Any

import aiohttp

from airhockey_env.web.access import Access
from airhockey_env.web.catalogue import Catalogue
from airhockey_env.web.limits import Limits
from airhockey_env.web.server import Server


class Running:
    """A server that runs, and a client that visits it.

    Args:
        server: the server.
        port: its port, on 127.0.0.1.
        client: the client.
    """

    def __init__(self, server: Server, port: int, client: aiohttp.ClientSession) -> None:
        self.server, self.port, self.client = server, port, client
        self.address = f"http://127.0.0.1:{port}"

    async def visit(self, kind: str, origin: str | None = None, **arguments: Any) -> Visit:
        """Open a session; the server's hello has been read."""
        socket = await self.client.ws_connect(
            f"{self.address}/session/{kind}", headers={"Origin": origin or self.address}, autoping=False, **arguments
        )
        visit = Visit(socket)
        visit.hello = await visit.read()
        return visit


class Visit:
    """One session, as its page sees it."""

    hello: dict[str, Any]

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket

    async def send(self, kind: str, **fields: Any) -> None:
        """Send a message."""
        await self.socket.send_str(json.dumps({"type": kind, **fields}))

    async def read(self) -> dict[str, Any]:
        """The next message of the server."""
        message = await self.socket.receive(timeout=20.0)
        assert message.type == aiohttp.WSMsgType.TEXT, message
        return json.loads(message.data)

    async def ask(self, kind: str, **fields: Any) -> dict[str, Any]:
        """Send a message and read the answer."""
        await self.send(kind, **fields)
        return await self.read()

    async def ending(self) -> tuple[str, int | None]:
        """The reason and the code with which the server ends the session; what else it sends is left out."""
        reason = ""
        while True:
            message = await self.socket.receive(timeout=20.0)
            if message.type == aiohttp.WSMsgType.TEXT:
                content = json.loads(message.data)
                reason = content["reason"] if content["type"] == "end" else reason
            elif message.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED, aiohttp.WSMsgType.ERROR):
                return reason, self.socket.close_code


@contextlib.asynccontextmanager
async def serving(
    token: str | None = None, catalogue: Catalogue | None = None, **limits: Any
) -> AsyncIterator[Running]:
    """Run a server; the arguments beside the first two are those of `Limits`."""
    server = Server(Access("127.0.0.1", 0, token), catalogue or Catalogue(), Limits(**limits))
    port = await server.start("127.0.0.1", 0)
    try:
        async with aiohttp.ClientSession() as client:
            yield Running(server, port, client)
    finally:
        await server.stop()
        await asyncio.sleep(0)  # for what has been closed to be gone
