"""How a player scores: by counters, patient attacks and serves, or by the other player's mistakes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.measuring.shares import Share, quartiles
from agents.measuring.shots import FORWARD, FOUL, REPLY, SERVE, Watch, play_on, speed_of
from airhockey_env.tables import FIELDS

COUNTER = 1.0
"""s. A shot made within this time after the other player's shot came over the centre line is a counter."""

WAYS = ("counter", "attack", "first serve", "serve after a foul", "deflection", "own goal")
"""The ways to score; every goal counts once. docs/exploitability.md defines them."""


@dataclass(frozen=True)
class Goals:
    """How a player scored in some points. The arrays are (n,), for the goals by shots, deflected ones included."""

    ways: dict[str, Share]  # of all goals, by the names in `WAYS`
    bank: Share  # of the goals by shots that nobody touched: those by way of a wall
    serve: Share  # of all goals: those in points of which the player had the first serve
    fouls: int  # how often the other player's shot clock ran out
    held: NDArray[np.float64]  # s from getting the puck to the shot
    speed: NDArray[np.float64]  # m/s of the puck after the shot
    depth: NDArray[np.float64]  # m from the other player's goal line to its paddle at the time of the shot
    aside: NDArray[np.float64]  # m from the long axis of the table to that paddle

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return {
            "ways": {way: share.as_dict() for way, share in self.ways.items()},
            "bank": self.bank.as_dict(),
            "first_serve": self.serve.as_dict(),
            "fouls_of_the_other": self.fouls,
            **{name: quartiles(getattr(self, name)) for name in ("held", "speed", "depth", "aside")},
        }


def count_goals(watch: Watch, of_opponent: bool = False) -> Goals:
    """Count how the evaluated player scored, or its opponent."""
    counts, bank, serve, goals, fouls = dict.fromkeys(WAYS, 0), 0, 0, 0, 0
    parts: list[NDArray[np.float64]] = []
    for game, recorder, own in watch.games:
        player = 1 - own if of_opponent else own
        other = 1 - player
        scored = recorder.shots[recorder.shots["scored"] & (recorder.shots["shooter"] == player)]
        clean = scored[~scored["touched"]]
        counter = (clean["origin"] == REPLY) & (clean["held"] <= COUNTER)
        first, after_foul = clean["origin"] == SERVE, clean["origin"] == FOUL
        deflected = len(scored) - len(clean)
        for way, number in zip(
            WAYS,
            (
                counter.sum(),
                (~counter & ~first & ~after_foul).sum(),
                first.sum(),
                after_foul.sum(),
                deflected,
                recorder.own_goals[other] - deflected,
            ),
            strict=True,
        ):
            counts[way] += int(number)
        bank += int(play_on(clean, game.control_hz).bank.sum())
        serve += int(recorder.served[player, player])
        goals += int(recorder.served[player].sum())
        fouls += int(recorder.fouls[other])
        paddle = scored["start"]["position"][:, other] * FORWARD[other]
        depth = paddle[:, 0] + 0.5 * scored["spec"][:, FIELDS.index("length")]
        parts.append(np.stack([scored["held"], speed_of(scored), depth, np.abs(paddle[:, 1])]))
    untouched = goals - counts["deflection"] - counts["own goal"]
    return Goals(
        {way: Share(number, goals) for way, number in counts.items()},
        Share(bank, untouched),
        Share(serve, goals),
        fouls,
        *np.concatenate(parts, axis=1),
    )
