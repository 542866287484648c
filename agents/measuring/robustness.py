"""How robust a player is: its share of the decided points under many conditions of play.

docs/robustness.md explains the conditions.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

from agents.conditions import EXACT, Conditions
from agents.measuring.evaluation import Z_95, Result, play_points
from agents.measuring.held_out import held_out_conditions
from agents.models import Player
from agents.spread import spread
from airhockey_env.cameras import CAMERAS, ROBOT
from airhockey_env.tables import CHALLENGE, FULL_SIZE, IDEAL, TABLES


@dataclass(frozen=True)
class Axis:
    """A quantity that a grid varies."""

    label: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class Grid:
    """Two quantities and the conditions for each pair of their values."""

    title: str
    down: Axis
    across: Axis
    cells: Mapping[tuple[float, float], Conditions]
    """By the values of the two axes, in their order."""


def camera_grid() -> Grid:
    """Delays and noises of a camera that is otherwise `ROBOT`, on the full-size table."""
    delays, noises = Axis("delay, ms", (0, 10, 20, 30, 45)), Axis("noise, mm", (0, 1, 2, 4, 8))

    def through(delay: float, noise: float) -> Conditions:
        jitter = 0 if delay == 0 else ROBOT.jitter_ms  # which cannot be greater than the delay
        return Conditions(
            camera=dataclasses.replace(ROBOT, delay_ms=delay, jitter_ms=jitter, noise_mm=noise, opponent_noise_mm=noise)
        )

    return _grid("Cameras, otherwise as robot", delays, noises, through)


def table_grid() -> Grid:
    """Linear drags, and shares of its speed that the puck keeps at a wall, on a table that is otherwise `FULL_SIZE`.

    The player sees exact states.
    """
    drags = Axis("linear drag, 1/s", (0, 0.1, 0.25, 0.5, 0.8))
    walls = Axis("speed kept at walls", (0.6, 0.7, 0.8, 0.9, 1))

    def on(drag: float, kept: float) -> Conditions:
        return Conditions(dataclasses.replace(FULL_SIZE, drag_linear=drag, wall_restitution=kept, wall_tangential=kept))

    return _grid("Tables, otherwise as full_size", drags, walls, on)


def _grid(title: str, down: Axis, across: Axis, conditions: Any) -> Grid:
    return Grid(title, down, across, {pair: conditions(*pair) for pair in product(down.values, across.values)})


def named_conditions() -> dict[str, Conditions]:
    """The presets, and what agents are trained on, by name."""
    return {
        "full_size": EXACT,
        "challenge": Conditions(CHALLENGE),
        "ideal": Conditions(IDEAL),
        "camera robot": Conditions(camera=ROBOT),
        "camera slow": Conditions(camera=CAMERAS["slow"]),
        "robot, actions 20 ms late": Conditions(camera=ROBOT, action_delay_ms=20),
        "ideal, camera robot": Conditions(IDEAL, camera=ROBOT),
        "tables, cameras robots": Conditions(randomize=TABLES, camera=CAMERAS["robots"]),
    }


LISTS = {"named": named_conditions, "held_out": held_out_conditions}
"""Lists of conditions by their names in `measure`."""

GRIDS = {"camera": camera_grid, "table": table_grid}
"""Grids of conditions, likewise."""

PARTS = (*LISTS, *GRIDS)


@dataclass(frozen=True)
class Cell:
    """The result of one player under one of the conditions."""

    part: str  # one of PARTS
    name: str | tuple[float, float]  # of the conditions in that part
    player: str
    conditions: Conditions
    result: Result

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        names = {"part": self.part, "name": self.name, "player": self.player}
        return {**names, "conditions": self.conditions.as_dict(), **self.result.as_dict()}


def conditions_of_part(part: str) -> Mapping[Any, Conditions]:
    """The conditions of one of `PARTS`, by name."""
    return GRIDS[part]().cells if part in GRIDS else LISTS[part]()


def measure(
    players: Mapping[str, Player],
    opponent: Player,
    points: int,
    *,
    opponent_name: str,
    parts: Sequence[str],
    seed: int = 0,
    workers: int | None = None,
    address: str | None = None,
) -> Iterator[tuple[int, Cell]]:
    """Let every player play points under all conditions against an opponent that sees exact states.

    Yields the results as they end, each with its place in the order of parts, conditions and players.

    Every player plays with the same serves under all conditions, so that these differ by less than the intervals say.

    Args:
        players: as `play_points` takes them, by name.
        opponent, points, seed: as in `play_points`.
        opponent_name: name of the opponent in the results.
        parts: some of `PARTS`.
        workers, address: see `agents.spread.spread`. The results do not depend on them.
    """
    cells = [
        (part, name, player, conditions)
        for part in parts
        for (name, conditions), player in product(conditions_of_part(part).items(), players)
    ]
    yield from spread(partial(_play_cell, players, opponent, points, opponent_name, seed), cells, workers, address)


def _play_cell(
    players: Mapping[str, Player],
    opponent: Player,
    points: int,
    opponent_name: str,
    seed: int,
    cell: tuple[str, Any, str, Conditions],
) -> Cell:
    part, name, player, conditions = cell
    result = play_points(players[player], opponent, points, name=opponent_name, seed=seed, conditions=conditions)
    return Cell(part, name, player, conditions, result)


@dataclass(frozen=True)
class Together:
    """One player's results under all conditions of a list."""

    player: str
    mean: float
    """Mean of the shares of the decided points; every one counts alike. NaN if one of them has no decided points."""
    interval: tuple[float, float]
    """95 % interval of the mean: the normal approximation, for shares that are independent of each other."""
    worst: Cell

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        worst = {"name": self.worst.name, "decided_win_rate": self.worst.result.decided}
        return {"player": self.player, "mean": self.mean, "mean_95": list(self.interval), "worst": worst}


def together(cells: Sequence[Cell]) -> Together:
    """Summarise one player's results under the conditions of a list."""
    shares = [cell.result.decided for cell in cells]
    mean = sum(shares) / len(shares)
    variances = (
        share * (1.0 - share) / max(1, cell.result.wins + cell.result.losses)
        for share, cell in zip(shares, cells, strict=True)
    )
    reach = Z_95 * math.sqrt(sum(variances)) / len(shares)
    worst = min(cells, key=lambda cell: math.inf if math.isnan(cell.result.decided) else cell.result.decided)
    return Together(cells[0].player, mean, (mean - reach, mean + reach), worst)
