"""A short fuzz; `python -m tests.web.fuzz` is a long one."""

from __future__ import annotations

import asyncio

from tests.web.fuzz import fuzz


def test_hostile_visitors_disturb_nobody() -> None:
    outcome = asyncio.run(fuzz(messages=12_000, visitors=8, seed=0))
    assert not outcome.unexpected
    assert len(outcome.waits) > 20 and sorted(outcome.waits)[len(outcome.waits) // 2] < 0.1
    assert outcome.memory[-1] < outcome.memory[0] + 20.0  # MiB
