"""How a player scores: from serves, counters and patient attacks, or by the other player's mistakes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.measuring.evaluation import wilson_interval
from agents.measuring.shots import FOUL, REPLY, SERVE, Recorder, play_on
from agents.tables import print_table
from airhockey_env.game import Game

COUNTER = 1.0
"""s. A shot made within this time after the other player's shot came over the centre line is a counter."""

WAYS = {
    "counter": f"a shot within {COUNTER:g} s after the other's shot came over the centre line",
    "attack": "any later shot, at a puck that came from the other player or back from an own shot",
    "first serve": "a shot at the first serve of the point",
    "serve after a foul": "a shot at a serve that was given because the other's shot clock had run out",
    "deflection": "a shot that went in off the other player",
    "own goal": "the other player put the puck into its own goal, without a shot",
}
"""The ways to score, each with its definition. Every goal counts once."""


@dataclass(frozen=True)
class Goals:
    """How a player scored in some points."""

    points: int
    ways: dict[str, int]  # goals by the keys of `WAYS`
    bank: int  # of the goals by shots that nobody touched: those by way of a wall
    fouls: int  # how often the other player's shot clock ran out

    @property
    def goals(self) -> int:
        return sum(self.ways.values())

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return {
            "points": self.points,
            "goals": self.goals,
            "ways": self.ways,
            "bank": self.bank,
            "fouls_of_the_other": self.fouls,
        }


class GoalWatch:
    """Observes the points of an evaluation (see `evaluation.Observer`) and tells how both players scored."""

    def __init__(self) -> None:
        self._seen: list[tuple[Game, Recorder, int]] = []  # and the evaluated player's side
        self._points = 0

    def __call__(self, game: Game, own: int) -> Callable[[NDArray[np.bool_]], None]:
        recorder = Recorder(game)
        self._seen.append((game, recorder, own))
        self._points += game.num_tables
        return recorder.note

    def goals(self, of_opponent: bool = False) -> Goals:
        """How the evaluated player scored, or its opponent."""
        ways, bank, fouls = dict.fromkeys(WAYS, 0), 0, 0
        for game, recorder, own in self._seen:
            scorer = 1 - own if of_opponent else own
            other = 1 - scorer
            scored = recorder.shots[recorder.shots["scored"] & (recorder.shots["shooter"] == scorer)]
            clean = scored[~scored["touched"]]
            deflected = len(scored) - len(clean)
            counter = (clean["origin"] == REPLY) & (clean["held"] <= COUNTER)
            serve, after_foul = clean["origin"] == SERVE, clean["origin"] == FOUL
            for way, number in (
                ("counter", counter.sum()),
                ("attack", (~counter & ~serve & ~after_foul).sum()),
                ("first serve", serve.sum()),
                ("serve after a foul", after_foul.sum()),
                ("deflection", deflected),
                ("own goal", recorder.own_goals[other] - deflected),
            ):
                ways[way] += int(number)
            bank += int(play_on(clean, game.spec, game.control_hz).bank.sum())
            fouls += int(recorder.fouls[other])
        return Goals(self._points, ways, bank, fouls)


def print_goals(title: str, goals: Goals) -> None:
    """Print the ways to score, with their shares of all goals and 95 % Wilson intervals."""
    rows = [("way", "goals", "share (95 %)")]
    for way, number in goals.ways.items():
        low, high = wilson_interval(number, goals.goals)
        share = f"{number / goals.goals:.1%} ({100 * low:.1f}-{100 * high:.1f})" if goals.goals else "none"
        rows.append((way, str(number), share))
    print_table(title, rows)
    print(
        f"{goals.bank} of the goals by untouched shots went by way of a wall. The other player's shot clock ran out "
        f"{goals.fouls} times in {goals.points} points."
    )
