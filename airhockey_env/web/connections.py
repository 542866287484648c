"""Connections: how many there are, how long a new one may be silent, and how long a visitor may take to read."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator
from typing import Any

from aiohttp import web

from airhockey_env.web.limits import Limits


class _Refusal(asyncio.Protocol):
    """Closes the connection that it is given."""

    def connection_made(self, transport: Any) -> None:
        transport.abort()


class Connections:
    """Makes the protocols of new connections.

    aiohttp waits for a connection's first request as long as it takes, and takes any number of connections: so it would
    be enough to open many and say nothing.

    Args:
        server: aiohttp's.
        limits: what a visitor may use.
    """

    def __init__(self, server: web.Server, limits: Limits) -> None:
        self._server, self._limits = server, limits
        self._silent: dict[Any, asyncio.TimerHandle] = {}  # new connections, and what will close them

    def __call__(self) -> asyncio.BaseProtocol:
        """The protocol of a new connection."""
        if len(self._server.connections) >= self._limits.connections:
            return _Refusal()
        protocol = self._server()
        wait = self._limits.first_request_seconds
        self._silent[protocol] = asyncio.get_running_loop().call_later(wait, self._give_up, protocol)
        return protocol

    def heard(self, protocol: Any) -> None:
        """Note that a request has come over a connection."""
        timer = self._silent.pop(protocol, None)
        if timer is not None:
            timer.cancel()

    def _give_up(self, protocol: Any) -> None:
        """Close a connection that has been silent for too long."""
        del self._silent[protocol]
        if protocol.transport is not None:
            protocol.transport.abort()


def drop(request: web.Request) -> None:
    """Close a request's connection without waiting for what is left to be sent."""
    if request.transport is not None:
        request.transport.abort()


@contextlib.contextmanager
def time_limit(request: web.Request, seconds: float) -> Iterator[None]:
    """Drop the request's connection if what is done in here takes longer."""
    late = asyncio.get_running_loop().call_later(seconds, drop, request)
    try:
        yield
    finally:
        late.cancel()
