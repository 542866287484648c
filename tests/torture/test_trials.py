"""Every API plays as plain games do, to the bit, whatever is done to it: trials with fixed seeds.

Arguments, actions, resets, states that are put back, copies, changes of a pool, and bad input are drawn at random.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import pytest
from gymnasium.vector import AutoresetMode

from airhockey_env.game import OBS_TYPES
from airhockey_env.kernel.tasks import TASKS
from tests.torture import chamber
from tests.torture.apis import FACES
from tests.torture.trial import Trial

BOUTS, TRIALS = 8, 20

BETWEEN = ("camera", "stack", "action_delay_ms")
"""What stands between a player and the table."""


def test_every_api_plays_as_plain_games_do(monkeypatch: pytest.MonkeyPatch) -> None:
    met: Counter[Any] = Counter()

    class Watched(Trial):
        """A trial that counts what it met."""

        def __init__(self, name: str, given: dict[str, Any], weird: tuple[str, ...] = ()) -> None:
            super().__init__(name, given, weird)
            between = [name for name in BETWEEN if name in given]
            kind = (name, given["task"], given["obs_type"], given.get("autoreset_mode"), *between)
            self.kind = () if self.refused else kind

        def do(self, operation: dict[str, Any]) -> None:
            super().do(operation)
            met.update((operation["do"], *self.kind, "bad reset" if operation.get("bad") else None))

    monkeypatch.setattr(chamber, "Trial", Watched)
    found = chamber.Tally()
    for number in range(BOUTS):
        found.add(chamber.play_bout(seed=1, number=number, steps=1, trials=TRIALS))
    assert [case.law for case in found.cases] == []
    assert 0 < found.refused < found.trials // 2
    # It was about everything.
    done = (
        "reset",
        "bad reset",
        "step",
        "bad step",
        "state",
        "bad state",
        "save",
        "retrace",
        "copy",
        "observe",
        "pool",
    )
    modes = [mode.value for mode in AutoresetMode]
    assert min(met[one] for one in (*done, "render", *BETWEEN, *FACES, *TASKS, *OBS_TYPES, *modes)) >= 3, met
