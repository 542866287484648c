"""The server: pages, files and sessions over HTTP and WebSockets."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from aiohttp import WSCloseCode, web

from airhockey_env.web.access import Access
from airhockey_env.web.assets import Asset, load_assets
from airhockey_env.web.catalogue import Catalogue
from airhockey_env.web.connections import Connections, time_limit
from airhockey_env.web.limits import Limits
from airhockey_env.web.replays import trajectory
from airhockey_env.web.sessions import SESSIONS, Session
from airhockey_env.web.visitor import Visitor

PAGES = {"/": "play.html", "/watch": "watch.html", "/air": "air.html"}
"""Pages by their address."""

HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
        "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-cache",
}
"""Headers of every answer: pages load nothing from elsewhere, and nobody may frame them."""

_Result = TypeVar("_Result")

_Handle = Callable[[web.Request], Awaitable[web.StreamResponse]]


class Server:
    """Serves the pages and their sessions on one event loop.

    Args:
        access: who may talk to it.
        catalogue: what visitors may choose from.
        limits: what they may use.
    """

    def __init__(self, access: Access, catalogue: Catalogue, limits: Limits | None = None) -> None:
        self.access, self.catalogue, self.limits = access, catalogue, limits or Limits()
        self.visitors: set[Visitor] = set()
        """Those who have a session at present."""
        self._assets = load_assets()
        self._jobs = ThreadPoolExecutor(2, "web")
        app = web.Application(middlewares=[self._guard], client_max_size=self.limits.upload_bytes)
        for address, name in PAGES.items():
            app.router.add_get(address, self._file(name))
        for name in self._assets:
            app.router.add_get(f"/static/{name}", self._file(name))
        for kind, session in SESSIONS.items():
            app.router.add_get(f"/session/{kind}", self._session(session))
        app.router.add_get("/run/{name}", self._records)
        app.router.add_post("/replay", self._replay)
        self._uploads = 0
        self._runner = web.AppRunner(app, access_log=None, shutdown_timeout=1.0, keepalive_timeout=30.0)
        self._listener: asyncio.Server | None = None

    async def start(self, host: str, port: int) -> int:
        """Listen; returns the port, which is another one if `port` is 0.

        Raises:
            OSError: it cannot listen there.
        """
        await self._runner.setup()
        assert self._runner.server is not None
        self._connections = Connections(self._runner.server, self.limits)
        self._listener = await asyncio.get_running_loop().create_server(self._connections, host, port)
        return int(self._listener.sockets[0].getsockname()[1])

    async def stop(self) -> None:
        """End every session and stop listening."""
        if self._listener is not None:
            self._listener.close()
        await asyncio.gather(*(v.end(WSCloseCode.GOING_AWAY, "the server has stopped") for v in self.visitors))
        await self._runner.cleanup()
        self._jobs.shutdown(wait=False, cancel_futures=True)

    # Requests ---------------------------------------------------------------------------------------------------

    @web.middleware
    async def _guard(self, request: web.Request, handler: _Handle) -> web.StreamResponse:
        """Let in who may come in, and put `HEADERS` on whatever is answered."""
        self._connections.heard(request.protocol)
        try:
            response = await self._admitted(request, handler)
        except web.HTTPException as error:
            response = error
        if not response.prepared:
            response.headers.update(HEADERS)
        if isinstance(response, web.HTTPException):
            raise response
        return response

    async def _admitted(self, request: web.Request, handler: _Handle) -> web.StreamResponse:
        host, token = request.headers.get("Host", ""), request.query.get("token")
        if not self.access.host_allowed(host):
            raise web.HTTPForbidden(text="This server answers to the name of this machine only, such as localhost.\n")
        if not self.access.token_right(token, request.headers.get("Cookie")):
            raise web.HTTPUnauthorized(text="Open the address that the server has printed, with its token.\n")
        changes = request.method not in ("GET", "HEAD") or request.path.startswith("/session/")
        if changes and not self.access.origin_allowed(request.headers.get("Origin"), host):
            raise web.HTTPForbidden(text="Only pages of this server may open sessions.\n")
        if token is not None and request.method == "GET":  # from now on the cookie says it: not every address need
            response = web.HTTPSeeOther(str(request.rel_url.without_query_params("token")))
            response.set_cookie(self.access.cookie, token, httponly=True, samesite="Strict")
            raise response
        return await handler(request)

    def _file(self, name: str) -> _Handle:
        asset: Asset = self._assets[name]

        async def handle(request: web.Request) -> web.StreamResponse:
            if any(tag.value == asset.etag for tag in request.if_none_match or ()):
                return web.Response(status=304)
            response = web.Response(body=asset.body, content_type=asset.content_type, charset="utf-8")
            response.etag = asset.etag
            return response

        return handle

    async def _records(self, request: web.Request) -> web.StreamResponse:
        """What a training run has recorded so far."""
        run = self.catalogue.runs.get(request.match_info["name"])
        if run is None:
            raise web.HTTPNotFound()
        return web.json_response(await self._in_thread(run.records))

    async def _replay(self, request: web.Request) -> web.StreamResponse:
        """Play an uploaded replay back."""
        if self._uploads >= self.limits.uploads:
            raise web.HTTPServiceUnavailable(text="The server is busy with other replays: try again in a moment.")
        self._uploads += 1
        try:
            content = await asyncio.wait_for(request.read(), self.limits.upload_seconds)
            return await self._send(request, await self._in_thread(trajectory, content, self.limits))
        except asyncio.TimeoutError:
            raise web.HTTPRequestTimeout(text="The upload has taken too long.") from None
        except ValueError as error:
            raise web.HTTPUnprocessableEntity(text=str(error)) from None
        finally:
            self._uploads -= 1

    async def _send(self, request: web.Request, body: bytes) -> web.StreamResponse:
        """Answer with much; a page that does not take it in time is dropped."""
        response = web.StreamResponse(headers={**HEADERS, "Content-Type": "application/octet-stream"})
        response.content_length = len(body)
        with time_limit(request, self.limits.upload_seconds):
            await response.prepare(request)
            for start in range(0, len(body), 2**16):
                await response.write(body[start : start + 2**16])
            await response.write_eof()
        return response

    async def _in_thread(self, job: Callable[..., _Result], *arguments: object) -> _Result:
        return await asyncio.get_running_loop().run_in_executor(self._jobs, job, *arguments)

    # Sessions ---------------------------------------------------------------------------------------------------

    def _session(self, kind: type[Session]) -> _Handle:
        async def handle(request: web.Request) -> web.StreamResponse:
            socket = web.WebSocketResponse(
                max_msg_size=self.limits.message_bytes,
                compress=False,  # or a short message could become a long one
                autoping=False,  # they count as messages
                timeout=1.0,
                writer_limit=2**16,
            )
            socket.headers.update(HEADERS)
            await socket.prepare(request)
            visitor = Visitor(request, socket, self.limits, self._jobs, lambda: len(self.visitors))
            if len(self.visitors) >= self.limits.sessions:
                await visitor.end(WSCloseCode.TRY_AGAIN_LATER, "the server has no room for another session")
                return socket
            self.visitors.add(visitor)
            try:
                await visitor.serve(kind, self.catalogue)
            finally:
                self.visitors.discard(visitor)
            return socket

        return handle
