"""How many matches one core holds."""

from __future__ import annotations

import asyncio
import json
import os
import time
from typing import Any

import aiohttp
import numpy as np

from benchmarks.web.serving import serving

LIMIT = 0.005
"""s that the 95th percentile of the answers may take."""
RATE = 60.0
"""Questions a second of each page: those of a usual screen."""
MATCHES = (1, 10, 20, 30, 40, 50, 60, 80, 100, 120, 150, 200)
SETTLING = 1.5
"""s after the start of the matches from which answers are timed: they rest for the first of these."""


async def visit(client: aiohttp.ClientSession, address: str, begin: float, end: float, waits: list[float]) -> None:
    """Play one match as a page does, and note how long the answers take, s."""
    async with client.ws_connect(f"{address}/session/play", headers={"Origin": address}) as socket:
        await socket.receive_json()
        await socket.send_str('{"type": "start", "opponent": "expert", "points": 99}')
        await socket.receive_json()
        due = time.perf_counter() + np.random.default_rng().uniform(0.0, 1.0 / RATE)
        number = 0
        while (now := time.perf_counter()) < end:
            await asyncio.sleep(max(0.0, due - now))
            number += 1
            x, y = -0.8 + 0.2 * np.sin(0.1 * number), 0.3 * np.cos(0.07 * number)
            asked = time.perf_counter()
            await socket.send_str(json.dumps({"type": "turn", "pointer": [float(x), float(y)]}))
            await socket.receive()
            if asked > begin:
                waits.append(time.perf_counter() - asked)
            due = max(due + 1.0 / RATE, time.perf_counter())


async def times_of(address: str, matches: int, seconds: float) -> list[float]:
    """The times of the answers, s, while so many matches are played."""
    waits: list[float] = []
    begin = time.perf_counter() + SETTLING
    async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(limit=0)) as client:
        await asyncio.gather(*(visit(client, address, begin, begin + seconds, waits) for _ in range(matches)))
    return waits


def measure(seconds: float = 5.0) -> list[dict[str, Any]]:
    """Ever more matches, until the answers take too long.

    The server has a core of its own where there is more than one; the visitors have the others.

    Args:
        seconds: for which each number of matches is played.

    Returns:
        Rows with `matches`, `median_ms`, `p95_ms`, and `answers_per_second`, the last one past the limit.
    """
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [0]
    rows = []
    with serving(core=cores[0] if len(cores) > 1 else None) as address:
        if len(cores) > 1:
            os.sched_setaffinity(0, set(cores[1:]))
        try:
            for matches in MATCHES:
                waits = asyncio.run(times_of(address, matches, seconds))
                median, p95 = np.percentile(waits, [50, 95])
                rows.append(
                    {
                        "matches": matches,
                        "median_ms": 1000.0 * float(median),
                        "p95_ms": 1000.0 * float(p95),
                        "answers_per_second": len(waits) / seconds,
                    }
                )
                if p95 > LIMIT:
                    break
        finally:
            if len(cores) > 1:
                os.sched_setaffinity(0, set(cores))
    return rows
