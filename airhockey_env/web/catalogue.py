"""What visitors may choose from."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from airhockey_env.drawing.palette import COLORS
from airhockey_env.opponents.players import NAMES, Player
from airhockey_env.tables import PRESETS, TableSpec
from airhockey_env.web.runs import Run


class Catalogue:
    """The players, tables and runs that visitors may name. No file is ever opened because a visitor names it.

    Args:
        players: names of further players, and who they are, as `AirHockeyEnv` takes an opponent.
        runs: names of training runs, and their folders.
    """

    def __init__(self, players: Mapping[str, Player] | None = None, runs: Mapping[str, Path] | None = None) -> None:
        self.players: dict[str, Player] = {**{name: name for name in NAMES}, **(players or {})}
        self.tables: dict[str, TableSpec] = dict(PRESETS)
        self.runs = {name: Run(folder) for name, folder in (runs or {}).items()}

    def as_dict(self) -> dict[str, Any]:
        """What a page needs to know of it, ready for JSON."""
        return {
            "players": list(self.players),
            "tables": {name: dimensions(spec) for name, spec in self.tables.items()},
            "runs": list(self.runs),
            "palette": COLORS._asdict(),
        }


def dimensions(spec: TableSpec) -> dict[str, float]:
    """What a page needs to draw a table, m."""
    names = ("length", "width", "goal_width", "puck_radius", "paddle_radius")
    return {name: float(getattr(spec, name)) for name in names}
