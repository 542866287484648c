"""Measure the skills of a player: shots, saves, time attacking, fouls, own goals and reaction.

docs/scorecard.md explains each number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.conditions import EXACT, Conditions
from agents.measuring.evaluation import CONTROL_HZ, Result, TaskResult, play_points, play_task
from agents.measuring.goals import Goals, count_goals
from agents.measuring.shares import Share, quartiles
from agents.measuring.shots import FORWARD, SHOT, Watch, play_on, specs_in_play, speed_of
from agents.models import Player
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, RIGHT
from airhockey_env.tables import FIELDS

SPEEDS = (0.0, 2.0, 4.0, 6.0, 8.0, math.inf)
"""m/s. Bounds of the speed classes for saves."""

REACTED = 0.1
"""Share of its greatest speed at which a paddle counts as having set off."""


@dataclass(frozen=True)
class Shots:
    """Shots of one kind."""

    on_target: Share  # of all shots
    scored: Share  # of all shots
    speeds: NDArray[np.float64]  # (n,) m/s
    arrives: NDArray[np.float64]  # (n,) m, to the shooter's left of the goal's centre; NaN: never at the far end

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return {
            "shots": len(self.speeds),
            "on_target": self.on_target.as_dict(),
            "scored": self.scored.as_dict(),
            "speed": quartiles(self.speeds),
        }


@dataclass(frozen=True)
class Saves:
    """How many of the shots on target with a speed from `low` to `high` were kept out."""

    low: float  # m/s
    high: float
    play: Share  # against the opponent
    defend: Share  # in the task

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return {"from": self.low, "to": self.high, "play": self.play.as_dict(), "defend": self.defend.as_dict()}


@dataclass(frozen=True)
class Card:
    """The result of `measure`."""

    player: str
    result: Result  # against the opponent
    seconds: float  # of that play
    shots: dict[str, Shots]  # "direct", "bank", "all": of that play
    hit_shots: dict[str, Shots]  # the same for the task "hit"
    saves: list[Saves]  # by speed
    zone: float  # share of that time with the puck on the far half
    possession: float  # with the puck on the near half, last touched by the player
    goals: Goals  # in that play
    conceded: Goals  # those of the opponent
    fouls: int  # in that play
    own_goals: int
    deflected: int  # of these, shots on target that went in off the player
    reaction: dict[str, NDArray[np.float64]]  # "direct", "bank": s, in the task "defend"; inf for never
    hit: TaskResult
    defend: TaskResult

    @property
    def attacking(self) -> float:
        """Share of the time with the puck on the far half or in possession."""
        return self.zone + self.possession

    def per_hour(self, count: int) -> float:
        """A count as a rate per hour of play."""
        return count / self.seconds * 3600.0

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return {
            "player": self.player,
            "play": {**self.result.as_dict(), "seconds": self.seconds},
            "shots": {kind: shots.as_dict() for kind, shots in self.shots.items()},
            "hit_shots": {kind: shots.as_dict() for kind, shots in self.hit_shots.items()},
            "saves": [saves.as_dict() for saves in self.saves],
            "attacking": {"share": self.attacking, "zone": self.zone, "possession": self.possession},
            "goals": self.goals.as_dict(),
            "conceded": self.conceded.as_dict(),
            "fouls": self.fouls,
            "own_goals": {"count": self.own_goals, "deflected": self.deflected},
            "reaction": {
                kind: {
                    "reacted": Share(int(np.isfinite(times).sum()), len(times)).as_dict(),
                    "seconds": quartiles(times),
                }
                for kind, times in self.reaction.items()
            },
            "tasks": [self.hit.as_dict(), self.defend.as_dict()],
        }


def measure(
    player: Player,
    opponent: Player,
    *,
    player_name: str,
    opponent_name: str,
    points: int = 2000,
    episodes: int = 4000,
    seed: int = 0,
    conditions: Conditions = EXACT,
) -> Card:
    """Let a player play points against an opponent, half of them on each side of the table, and both tasks.

    Args:
        player, opponent: as in `play_points`.
        player_name, opponent_name: names for reports.
        points: number of points against the opponent.
        episodes: number of episodes of each task.
        seed, conditions: used for all of these.

    Raises:
        ValueError: an argument is out of range.
    """
    played, hits, defences = Watch(), Watch(), _Defences()
    shared: dict[str, Any] = {"seed": seed, "conditions": conditions}
    result = play_points(player, opponent, points, name=opponent_name, observer=played, **shared)
    hit = play_task(player, "hit", episodes, observer=hits, **shared)
    defend = play_task(player, "defend", episodes, observer=defences, **shared)

    own, incoming = _flown(played)
    defended = defences.shots()
    threats = incoming.shots[incoming.on_target]
    steps = sum(recorder.steps for _, recorder, _ in played.games)
    return Card(
        player=player_name,
        result=result,
        seconds=steps / CONTROL_HZ,
        shots=_by_kind(own),
        hit_shots=_by_kind(_flown(hits)[0]),
        saves=[
            Saves(low, high, _saved(threats, low, high), _saved(defended.shots[defended.on_target], low, high))
            for low, high in pairwise(SPEEDS)
        ],
        zone=played.total("zone") / steps,
        possession=played.total("possession") / steps,
        goals=count_goals(played),
        conceded=count_goals(played, of_opponent=True),
        fouls=played.total("fouls"),
        own_goals=played.total("own_goals"),
        deflected=int((threats["scored"] & threats["touched"]).sum()),
        reaction={
            kind: defences.reaction()[defences.has_to_move() & defended.on_target & (defended.bank == (kind == "bank"))]
            for kind in ("direct", "bank")
        },
        hit=hit,
        defend=defend,
    )


class Flown(NamedTuple):
    """Shots and where they would have gone; all arrays are (n,)."""

    shots: NDArray[np.void]  # of SHOT
    on_target: NDArray[np.bool_]
    bank: NDArray[np.bool_]
    arrives: NDArray[np.float64]  # m, to the shooter's left of the goal's centre; NaN: never at the far end


def _flown(watch: Watch) -> tuple[Flown, Flown]:
    """The shots of the evaluated player and those of its opponent."""
    both: tuple[list[Flown], list[Flown]] = ([], [])
    for game, recorder, own in watch.games:
        shots = recorder.shots
        courses = play_on(shots, game.control_hz)
        arrives = courses.arrives * FORWARD[shots["shooter"]]
        for flown, chosen in zip(both, (shots["shooter"] == own, shots["shooter"] != own), strict=True):
            fields = (shots, courses.on_target, courses.bank, arrives)
            flown.append(Flown(*(field[chosen] for field in fields)))
    return _joined(both[0]), _joined(both[1])


def _joined(parts: Sequence[Flown]) -> Flown:
    return Flown(*(np.concatenate(fields) for fields in zip(*parts, strict=True)))


def _by_kind(flown: Flown) -> dict[str, Shots]:
    kinds = {"direct": ~flown.bank, "bank": flown.bank, "all": np.ones(len(flown.bank), np.bool_)}
    return {
        kind: Shots(
            Share(int((flown.on_target & chosen).sum()), int(chosen.sum())),
            Share(int((flown.shots["scored"] & chosen).sum()), int(chosen.sum())),
            speed_of(flown.shots[chosen]),
            flown.arrives[chosen],
        )
        for kind, chosen in kinds.items()
    }


def _saved(shots: NDArray[np.void], low: float, high: float) -> Share:
    speed = speed_of(shots)
    chosen = shots[(speed >= low) & (speed < high)]
    return Share(int((~chosen["scored"]).sum()), len(chosen))


class _Defences:
    """Observes games of the task "defend"."""

    def __init__(self) -> None:
        self._each: list[Defence] = []

    def __call__(self, game: Game, own: int) -> Callable[[NDArray[np.bool_]], None]:
        self._each.append(Defence(game))
        return self._each[-1].note

    def shots(self) -> Flown:
        return _joined([Flown(d.shots, d.courses.on_target, d.courses.bank, d.courses.arrives) for d in self._each])

    def has_to_move(self) -> NDArray[np.bool_]:
        return np.concatenate([defence.has_to_move for defence in self._each])

    def reaction(self) -> NDArray[np.float64]:
        return np.concatenate([defence.reaction for defence in self._each])


class Defence:
    """One game of the task "defend": the result of each shot, and when the paddle set off.

    Attributes:
        shots: (n,) of `SHOT`, one per table; `scored` is updated during play.
        courses: where the shots go if nobody touches them.
        has_to_move: (n,) whether the shot misses the paddle's initial position, so that the paddle has to move.
        reaction: (n,) s from the shot until the paddle has set off towards it; inf if it has not.
    """

    def __init__(self, game: Game) -> None:
        n = game.num_tables
        self._game = game
        self.shots = np.zeros(n, SHOT)
        specs = specs_in_play(game)
        self.shots["shooter"], self.shots["spec"], self.shots["start"] = RIGHT, specs, game.states
        place = game.positions[:, LEFT]
        self.courses = play_on(self.shots, game.control_hz, line=place[:, 0])
        away = np.nan_to_num(self.courses.passes - place[:, 1])
        self._towards = np.sign(away)
        radii = specs[:, [FIELDS.index("paddle_radius"), FIELDS.index("puck_radius")]]
        self.has_to_move = np.abs(away) > radii.sum(axis=1)
        self._reacted = REACTED * specs[:, FIELDS.index("paddle_speed")]
        self.reaction = np.full(n, np.inf)
        self._steps = 0

    def note(self, running: NDArray[np.bool_]) -> None:
        """Record a step that the tables of the mask (N,) have played."""
        game = self._game
        self._steps += 1
        self.shots["scored"][running] = game.out.point[running] < 0
        speed = game.states["velocity"][:, LEFT, 1] * self._towards
        set_off = running & np.isinf(self.reaction) & (speed > self._reacted)
        self.reaction[set_off] = self._steps / game.control_hz
