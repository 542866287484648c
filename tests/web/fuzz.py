"""Hostile visitors: python -m tests.web.fuzz --messages 100000

A server of its own is sent messages of wrong types, sizes and orders, floods, and connections that are broken off,
while one well-behaved session plays on. In the end the server has to be alive, that session undisturbed, and memory as
it was.
"""

from __future__ import annotations

import argparse
import asyncio
import base64
import contextlib
import json
import os
import random
import re
import sys
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, NamedTuple

import aiohttp

from airhockey_env.web.sessions import SESSIONS
from tests.web.serving import Visit

ROOT = Path(__file__).parents[2]

FIELDS = {
    "start": {"opponent": "striker", "left": "goalie", "right": "expert", "table": "ideal", "skill": 0.5, "points": 3,
              "speed": 2.0, "run": "none", "scene": "scene=large_and_small"},
    "turn": {"pointer": [-0.5, 0.1], "contacts": True, "hold": [0, 0.1, 0.2]},
    "speed": {"speed": 50.0},
    "add": {"position": [0.7, 0.0], "radius": 0.05, "mass": 1.0}, "remove": {"puck": 0, "method": "kiss"},
    "change": {"puck": 0, "position": [0.7, 0.0], "velocity": [1.0, 2.0], "radius": 0.04, "mass": 2.0},
    "settings": {"tick": 0.01, "restitution": 0.3, "wall_restitution": 0.3, "phase": 0.5},
    "throw": {"puck": 0, "velocity": [3.0, 0.1]}, "fan": {}, "keep": {"method": "overlap"}, "reverse": {},
    "step": {"until_contact": True}, "restart": {}, "pause": {}, "resume": {}, "replay": {}, "": {},
    "__init__": {}, "hello": {},
}  # fmt: skip
"""Types of messages, and fields that some session takes with them."""

KNOWN = {
    "play": {"start": ("opponent", "table", "skill", "points"), "turn": ("pointer",)},
    "watch": {"start": ("left", "right", "table", "points", "speed"), "turn": ("contacts",), "speed": ("speed",)},
    "air": {"start": ("scene",), "turn": ("hold",), "speed": ("speed",), "step": ("until_contact",),
            **{name: tuple(FIELDS[name]) for name in ("add", "remove", "change", "settings", "throw", "keep")}},
}  # fmt: skip

ODD_VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 1e308, 10**400, -(2**63), 0.1, "", "striker", "../../etc/passwd", "\x00", "\ud83d\ude00",
    "x" * 3000, [], [1], [1, 2], [[1, 2]], {}, {"a": {}}, [None], float("nan"), float("inf"), [float("nan"), 0],
)  # fmt: skip


class Outcome(NamedTuple):
    """What a fuzz has shown."""

    messages: int
    sessions: int
    unexpected: list[str]  # reasons with which the server should never end a session
    waits: list[float]  # s, of the well-behaved session
    memory: list[float]  # MiB, while it went on


def message(kind: str, draw: random.Random) -> str:
    """A message that may be good, or nearly so."""
    name = draw.choice(list(FIELDS))
    fields = {field: value for field, value in FIELDS[name].items() if field in KNOWN.get(kind, {}).get(name, ())}
    if draw.random() < 0.15:
        fields[draw.choice(["x", "type", "pointer", "points", "opponent"])] = draw.choice(ODD_VALUES)
    for field in list(fields):
        if draw.random() < 0.05:
            fields[field] = draw.choice(ODD_VALUES)
        elif draw.random() < 0.1:
            del fields[field]
    return json.dumps({"type": name, **fields})


def garbage(draw: random.Random) -> str:
    """A text that is no message."""
    return draw.choice(
        [
            "", "{", "null", "[" * 4000, '{"type":' * 400, "x" * draw.randrange(6000), "\x00",
            '{"type": "turn", "pointer": [NaN, 0]}', '{"type": "turn", "type": "turn"}',
            "1e999", '"turn"', '{"type": 1e999}', "\ud7ff" * 10, "0" * 4000,
        ]
    )  # fmt: skip


class Hostile:
    """Visitors of one server.

    Args:
        address: the server's.
        client: makes connections.
        seed: of everything that is drawn.
    """

    def __init__(self, address: str, client: aiohttp.ClientSession, seed: int) -> None:
        self.address, self.client, self.draw = address, client, random.Random(seed)
        self.messages = self.sessions = 0
        self.unexpected: list[str] = []

    async def go_on(self, most: int) -> None:
        """Open one session after the other, until so many messages have been sent in all."""
        ways: list[Callable[[], Awaitable[None]]] = [self.talk] * 12 + [
            self.flood,
            self.break_off,
            self.raw,
            self.silent,
        ]
        while self.messages < most:
            self.sessions += 1
            with contextlib.suppress(aiohttp.ClientError, ConnectionError, asyncio.TimeoutError):
                await self.draw.choice(ways)()

    async def open(self) -> tuple[str, aiohttp.ClientWebSocketResponse]:
        """Open a session of any kind."""
        kind = self.draw.choice(list(SESSIONS))
        address = f"{self.address}/session/{kind}"
        return kind, await self.client.ws_connect(address, headers={"Origin": self.address}, max_msg_size=0)

    async def talk(self) -> None:
        """Say this and that, and read the answers, until the server has had enough."""
        kind, socket = await self.open()
        reader = asyncio.create_task(self.read(socket))
        with contextlib.suppress(ConnectionError):
            await socket.send_str('{"type": "start"}')
            for _ in range(self.draw.randrange(1, 60)):
                if socket.closed or reader.done():
                    break
                self.messages += 1
                chance = self.draw.random()
                if chance < 0.93:
                    await socket.send_str(message(kind, self.draw))
                elif chance < 0.96:
                    await socket.send_str(garbage(self.draw))
                elif chance < 0.98:
                    await socket.send_bytes(self.draw.randbytes(self.draw.randrange(5000)))
                else:
                    await socket.ping(self.draw.randbytes(100))
                await asyncio.sleep(0.006)
        await socket.close()
        await reader

    async def read(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        """Read everything; note reasons that tell of a mistake."""
        async for answer in socket:
            if answer.type == aiohttp.WSMsgType.TEXT and '"end"' in answer.data and "mistake" in answer.data:
                self.unexpected.append(answer.data)

    async def flood(self) -> None:
        """As much as possible at once, without reading."""
        _, socket = await self.open()
        with contextlib.suppress(ConnectionError):
            for _ in range(600):
                self.messages += 1
                await socket.send_str('{"type": "turn"}')
        await socket.close()

    async def break_off(self) -> None:
        """A connection that is gone in the middle of it, without a word."""
        kind, socket = await self.open()
        self.messages += 1
        await socket.send_str(message(kind, self.draw))
        response = socket._response
        if response.connection is not None and response.connection.transport is not None:
            response.connection.transport.abort()

    async def raw(self) -> None:
        """Bytes that are no frames."""
        host, port = self.address.removeprefix("http://").split(":")
        reader, writer = await asyncio.open_connection(host, int(port))
        key = base64.b64encode(self.draw.randbytes(16)).decode()
        writer.write(
            f"GET /session/play HTTP/1.1\r\nHost: {host}:{port}\r\nOrigin: {self.address}\r\nConnection: Upgrade\r\n"
            f"Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n\r\n".encode()
        )
        for _ in range(self.draw.randrange(1, 5)):
            self.messages += 1
            writer.write(self.draw.randbytes(self.draw.randrange(1, 500)))
        with contextlib.suppress(ConnectionError, asyncio.TimeoutError):
            await asyncio.wait_for(reader.read(2000), 1.0)
        writer.close()

    async def silent(self) -> None:
        """A connection on which nothing, or half of a request, is said for a while."""
        host, port = self.address.removeprefix("http://").split(":")
        _, writer = await asyncio.open_connection(host, int(port))
        self.messages += 1
        writer.write(self.draw.choice([b"", b"GET / HT", b"\x16\x03\x01\x02\x00\x01", b"POST /replay HTTP/1.1\r\n"]))
        await asyncio.sleep(0.3)
        writer.close()


async def behave(address: str) -> list[float]:
    """Play a match until the standard input ends; how long every answer took, s.

    It is done in a process of its own: one that floods the server is no good clock.
    """
    done = asyncio.create_task(asyncio.to_thread(sys.stdin.read))
    waits = []
    async with aiohttp.ClientSession() as client:
        visit = Visit(await client.ws_connect(f"{address}/session/play", headers={"Origin": address}))
        assert (await visit.read())["type"] == "hello"
        assert (await visit.ask("start", opponent="expert", points=99))["type"] == "match"
        print("playing", flush=True)
        while not done.done():
            start = time.perf_counter()
            state = await visit.ask("turn", pointer=[-0.8, 0.1])
            waits.append(time.perf_counter() - start)
            assert state["type"] == "state"
            await asyncio.sleep(1 / 60)
        await visit.socket.close()
    return waits


async def start(*arguments: str) -> asyncio.subprocess.Process:
    """Start a module of this checkout, with pipes for its input and output."""
    return await asyncio.create_subprocess_exec(
        sys.executable, "-m", *arguments, env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
    )  # fmt: skip


def memory_of(process: int) -> float:
    """MiB that a process has in memory; 0 where nobody tells."""
    try:
        text = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0.0
    found = re.search(r"VmRSS:\s*(\d+) kB", text)
    return int(found[1]) / 1024 if found else 0.0


async def fuzz(messages: int, visitors: int, seed: int) -> Outcome:
    """Run a server and let hostile visitors at it."""
    server = await start("airhockey_env.web", "--port", "0")
    assert server.stdout is not None
    address = ""
    while not address.startswith("http"):
        address = (await server.stdout.readline()).decode().strip().rstrip("/")
    good = await start("tests.web.fuzz", "--behave", address)
    assert good.stdout is not None and await good.stdout.readline() == b"playing\n"
    memory: list[float] = []
    try:
        async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=0)) as client:
            hostile = Hostile(address, client, seed)
            going = [asyncio.create_task(hostile.go_on(messages)) for _ in range(visitors)]
            while not all(task.done() for task in going):
                await asyncio.wait(going, timeout=1.0)
                memory.append(memory_of(server.pid))
            await asyncio.gather(*going)
        told, _ = await good.communicate(b"")
        assert good.returncode == 0, "the well-behaved session was disturbed"
        assert server.returncode is None, "the server has ended"
    finally:
        for process in (server, good):
            if process.returncode is None:
                process.terminate()
                await process.wait()
    return Outcome(hostile.messages, hostile.sessions, hostile.unexpected, json.loads(told), memory)


def main() -> None:
    """Read the command line and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=100_000, help="Send so many messages. Default: 100000.")
    parser.add_argument("--visitors", type=int, default=12, help="Send them from so many at a time. Default: 12.")
    parser.add_argument("--seed", type=int, default=0, help="Draw them from this seed. Default: 0.")
    parser.add_argument("--behave", metavar="ADDRESS", help="Play on that server instead, and print the times.")
    args = parser.parse_args()
    if args.behave:
        print(json.dumps(asyncio.run(behave(args.behave))))
        return
    outcome = asyncio.run(fuzz(args.messages, args.visitors, args.seed))
    waits = sorted(1000.0 * wait for wait in outcome.waits)
    third = outcome.memory[len(outcome.memory) // 3 :]
    print(f"{outcome.messages:,} messages in {outcome.sessions:,} sessions; the server is alive")
    print(f"mistakes of the server: {len(outcome.unexpected)}")
    print(
        f"the session beside them: {len(waits):,} answers, median {waits[len(waits) // 2]:.1f} ms, "
        f"95th percentile {waits[int(0.95 * len(waits))]:.1f} ms, longest {waits[-1]:.1f} ms"
    )
    print(f"memory: {outcome.memory[0]:.0f} MiB at first, {third[0]:.0f} after a third, {third[-1]:.0f} in the end")


if __name__ == "__main__":
    main()
