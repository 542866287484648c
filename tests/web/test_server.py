"""The server: pages, sessions, and what it does with those who mean no good."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import Awaitable, Callable

import aiohttp
import pytest

from airhockey_env.web.messages import Message
from airhockey_env.web.server import PAGES
from airhockey_env.web.sessions import SESSIONS, Session
from airhockey_env.web.sessions.base import Answer, Handler
from tests.web.serving import Running, Visit, serving


class Odd(Session):
    """A session that does what a test asks for."""

    def handlers(self) -> dict[str, Handler]:
        return {"echo": self._echo, "fail": self._fail, "fill": self._fill, "toil": self._toil, "job": self._job}

    def _echo(self, message: Message, now: float) -> Answer:
        return {"type": "echo", "number": message.whole("number", 0, 10**6)}

    def _fail(self, message: Message, now: float) -> Answer:
        raise ZeroDivisionError("by design")

    def _fill(self, message: Message, now: float) -> Answer:
        return bytes(2**20)

    def _toil(self, message: Message, now: float) -> Answer:
        end = time.perf_counter() + 0.004
        while time.perf_counter() < end:
            pass
        return {"type": "done"}

    def _job(self, message: Message, now: float) -> Answer:
        def work() -> bytes:
            time.sleep(0.3)
            return b"done"

        return work


@pytest.fixture(autouse=True)
def odd(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SESSIONS, "odd", Odd)


def run(test: Callable[[Running], Awaitable[None]], **arguments: object) -> None:
    """Run a test against a server of its own."""

    async def all_of_it() -> None:
        async with serving(**arguments) as running:  # type: ignore[arg-type]
            await asyncio.wait_for(test(running), 60.0)

    asyncio.run(all_of_it())


async def undisturbed(visit: Visit) -> None:
    """A session is answered."""
    assert await visit.ask("echo", number=7) == {"type": "echo", "number": 7}


# Pages


def test_pages_load_nothing_from_elsewhere_and_are_cached_until_they_change() -> None:
    async def test(running: Running) -> None:
        for page in PAGES:
            async with running.client.get(running.address + page) as response:
                assert response.status == 200 and response.content_type == "text/html"
                policy = response.headers["Content-Security-Policy"]
                assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy
                assert response.headers["X-Content-Type-Options"] == "nosniff"
                tag = response.headers["ETag"]
            async with running.client.head(running.address + page) as response:
                assert response.status == 200
            async with running.client.get(running.address + page, headers={"If-None-Match": tag}) as response:
                assert response.status == 304

    run(test)


@pytest.mark.parametrize(
    "path",
    ["/nothing", "/static/", "/static/../server.py", "/static/%2e%2e/server.py", "/static//etc/passwd", "/session"],
)
def test_only_the_pages_own_files_are_served(path: str) -> None:
    async def test(running: Running) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", running.port)
        writer.write(f"GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n".encode())
        assert b" 404 " in (await reader.read()).split(b"\r\n")[0]
        writer.close()

    run(test)


def test_requests_under_a_strangers_name_or_from_a_strangers_page_are_refused() -> None:
    async def test(running: Running) -> None:
        async with running.client.get(running.address, headers={"Host": "evil.example"}) as response:
            assert response.status == 403
        for headers in ({}, {"Origin": "http://evil.example"}, {"Origin": "null"}):
            with pytest.raises(aiohttp.WSServerHandshakeError) as refused:
                await running.client.ws_connect(f"{running.address}/session/odd", headers=headers)
            assert refused.value.status == 403
            async with running.client.post(running.address, headers=headers) as response:
                assert response.status == 403

    run(test)


def test_the_token_is_asked_for_everywhere_and_kept_in_a_cookie() -> None:
    token = "abcdefghijkl"

    async def test(running: Running) -> None:
        for path in ("/", "/static/css/site.css", "/session/odd", "/?token=wrong", "/nothing"):
            async with running.client.get(running.address + path) as response:
                assert response.status == 401, path
        jar = aiohttp.CookieJar(unsafe=True)  # cookies of addresses, too
        async with aiohttp.ClientSession(cookie_jar=jar) as client:
            async with client.get(f"{running.address}/watch?token={token}&x=1") as response:
                assert response.status == 200 and str(response.url) == f"{running.address}/watch?x=1"
                cookie = response.history[0].headers["Set-Cookie"]
                assert "HttpOnly" in cookie and "SameSite=Strict" in cookie
            async with client.ws_connect(
                f"{running.address}/session/odd", headers={"Origin": running.address}
            ) as socket:
                assert (await socket.receive_json())["type"] == "hello"

    run(test, token=token)


# Sessions


def test_hello_says_what_can_be_chosen() -> None:
    async def test(running: Running) -> None:
        hello = (await running.visit("odd")).hello
        assert hello["type"] == "hello" and "striker" in hello["players"] and "expert" in hello["players"]
        assert hello["tables"]["full_size"]["length"] == 2.362
        assert hello["palette"]["left"] == [240, 74, 104]

    run(test)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "JSON"),
        ("[]", "object"),
        ('{"type": "nothing"}', "type must be one of echo"),
        ('{"type": "echo"}', "number"),
        ('{"type": "echo", "number": NaN}', "NaN"),
        ('{"type": "echo", "number": 1, "more": 1}', "more"),
        ('{"type": "__class__"}', "type must be one of"),
    ],
)
def test_a_malformed_message_ends_its_session_with_a_reason_and_no_other(text: str, reason: str) -> None:
    async def test(running: Running) -> None:
        other, visit = await running.visit("odd"), await running.visit("odd")
        await visit.socket.send_str(text)
        said, code = await visit.ending()
        assert reason in said and code == aiohttp.WSCloseCode.POLICY_VIOLATION
        await undisturbed(other)
        assert len(running.server.visitors) == 1

    run(test)


def test_an_oversized_message_ends_its_session() -> None:
    async def test(running: Running) -> None:
        other, visit = await running.visit("odd"), await running.visit("odd")
        await visit.socket.send_str("x" * 5000)
        assert (await visit.ending())[1] == aiohttp.WSCloseCode.MESSAGE_TOO_BIG
        await undisturbed(other)

    run(test)


def test_bytes_and_broken_text_end_their_session() -> None:
    async def test(running: Running) -> None:
        other = await running.visit("odd")
        visit = await running.visit("odd")
        await visit.socket.send_bytes(b"\x00")
        assert "text" in (await visit.ending())[0]
        visit = await running.visit("odd")
        await visit.socket._writer.send_frame(b"\xff\xfe", aiohttp.WSMsgType.TEXT)  # no UTF-8
        assert (await visit.ending())[1] == aiohttp.WSCloseCode.INVALID_TEXT
        await undisturbed(other)

    run(test)


@pytest.mark.parametrize("ping", [False, True])
def test_a_flood_ends_its_session(ping: bool) -> None:
    async def test(running: Running) -> None:
        other, visit = await running.visit("odd"), await running.visit("odd")
        with contextlib.suppress(ConnectionError):
            for _ in range(300):
                await (visit.socket.ping() if ping else visit.send("echo", number=1))
        if ping:
            assert (await _last_text(visit))["reason"].startswith("the page has sent more than")
        else:
            assert (await visit.ending())[0].startswith("the page has sent more than")
        await undisturbed(other)

    run(test, messages=100.0, burst=100.0)


async def _last_text(visit: Visit) -> dict[str, str]:
    """The first text among the pongs."""
    while True:
        message = await visit.socket.receive(timeout=10.0)
        if message.type == aiohttp.WSMsgType.TEXT:
            return message.json()
        assert message.type == aiohttp.WSMsgType.PONG


def test_a_mistake_of_the_server_ends_one_session_and_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    async def test(running: Running) -> None:
        other, visit = await running.visit("odd"), await running.visit("odd")
        await visit.send("fail")
        reason, code = await visit.ending()
        assert "mistake" in reason and "by design" not in reason and code == aiohttp.WSCloseCode.INTERNAL_ERROR
        await undisturbed(other)

    run(test)
    assert "by design" in caplog.text


def test_there_is_room_for_so_many_sessions() -> None:
    async def test(running: Running) -> None:
        visits = [await running.visit("odd") for _ in range(2)]
        late = await running.client.ws_connect(f"{running.address}/session/odd", headers={"Origin": running.address})
        reason, code = await Visit(late).ending()
        assert "no room" in reason and code == aiohttp.WSCloseCode.TRY_AGAIN_LATER
        await visits[0].socket.close()
        while len(running.server.visitors) > 1:
            await asyncio.sleep(0.01)
        await undisturbed(await running.visit("odd"))
        await undisturbed(visits[1])

    run(test, sessions=2)


def test_an_idle_session_ends_and_pings_do_not_keep_it() -> None:
    async def test(running: Running) -> None:
        busy, idle = await running.visit("odd"), await running.visit("odd")
        for _ in range(12):
            await undisturbed(busy)
            with contextlib.suppress(ConnectionError):
                await idle.socket.ping()
            await asyncio.sleep(0.1)
        while (message := await idle.socket.receive(timeout=10.0)).type == aiohttp.WSMsgType.PONG:
            pass
        assert "said nothing for 0.5 s" in message.json()["reason"]

    run(test, idle_seconds=0.5)


def test_a_visitor_that_has_gone_silent_is_noticed() -> None:
    async def test(running: Running) -> None:
        visit = await running.visit("odd")  # does not answer the server's pings
        assert len(running.server.visitors) == 1
        await asyncio.wait_for(_until(lambda: not running.server.visitors), 10.0)
        await visit.socket.close()

    run(test, heartbeat_seconds=0.3)


async def _until(holds: Callable[[], bool]) -> None:
    while not holds():
        await asyncio.sleep(0.02)


def test_a_visitor_that_does_not_read_is_dropped_and_slows_nobody() -> None:
    async def test(running: Running) -> None:
        other = await running.visit("odd")
        slow = await running.visit("odd", max_msg_size=0)
        slow.socket._conn.transport.pause_reading()
        for _ in range(20):
            await slow.send("fill")  # megabytes that nobody reads
        waits = []
        while len(running.server.visitors) > 1:
            start = time.perf_counter()
            await undisturbed(other)
            waits.append(time.perf_counter() - start)
            await asyncio.sleep(0.01)
        assert sorted(waits)[len(waits) // 2] < 0.05
        slow.socket._conn.transport.abort()

    run(test, send_seconds=0.5)


def test_hard_work_delays_its_own_session_only() -> None:
    async def test(running: Running) -> None:
        other, busy = await running.visit("odd"), await running.visit("odd")
        start = time.perf_counter()
        for _ in range(30):
            await busy.ask("toil")
        elapsed = time.perf_counter() - start
        assert elapsed > 30 * 0.004 / 0.2 - 0.02 / 0.2 - 0.05  # a fifth of the time, after the burst
        await undisturbed(other)

    run(test, share=0.2, share_burst=0.02)


def test_long_jobs_leave_the_others_alone() -> None:
    async def test(running: Running) -> None:
        other, busy = await running.visit("odd"), await running.visit("odd")
        start = time.perf_counter()
        await busy.send("job")
        await undisturbed(other)
        assert time.perf_counter() - start < 0.25
        assert (await busy.socket.receive(timeout=10.0)).data == b"done"

    run(test)


# Connections


def test_a_connection_that_asks_for_nothing_is_closed() -> None:
    async def test(running: Running) -> None:
        visit = await running.visit("odd")
        for begun in (b"", b"GET / HTTP/1.1\r\nHost: localhost\r\nX: "):
            reader, writer = await asyncio.open_connection("127.0.0.1", running.port)
            writer.write(begun)
            with contextlib.suppress(ConnectionError):
                assert await asyncio.wait_for(reader.read(), 10.0) == b""
            writer.close()
        await undisturbed(visit)

    run(test, first_request_seconds=0.3)


def test_there_is_room_for_so_many_connections() -> None:
    async def test(running: Running) -> None:
        visit = await running.visit("odd")
        silent = [await asyncio.open_connection("127.0.0.1", running.port) for _ in range(10)]
        ended = [asyncio.create_task(reader.read()) for reader, _ in silent]
        await asyncio.wait(ended, timeout=1.0)
        assert sum(task.done() for task in ended) == 7  # the visit is one of the four
        await undisturbed(visit)
        for _, writer in silent:
            writer.close()
        await asyncio.gather(*ended, return_exceptions=True)

    run(test, connections=4, first_request_seconds=30.0)


def test_stopping_tells_the_pages() -> None:
    async def test(running: Running) -> None:
        visit = await running.visit("odd")
        ending = asyncio.create_task(visit.ending())
        await running.server.stop()
        reason, code = await ending
        assert "stopped" in reason and code == aiohttp.WSCloseCode.GOING_AWAY

    run(test)
