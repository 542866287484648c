"""One environment: where the time of a step is spent."""

from __future__ import annotations

import gymnasium as gym

from benchmarks.speed import games
from benchmarks.speed.measure import Effort, Row, ratio, run

TITLE = "One environment"
MADE, RAW, CODE = "gym.make", "AirHockeyEnv, without wrappers", "its compiled step alone"
CART, CART_RAW = "CartPole-v1, gym.make", "CartPole-v1, without wrappers"


def measure(effort: Effort) -> tuple[list[Row], list[str]]:
    """Rows for the environment and its parts; there are no notes."""
    measures = [
        games.single(MADE, gym.make("AirHockey-v0")),
        games.single(RAW, gym.make("AirHockey-v0").unwrapped),
        games.compiled(CODE, 1),
        games.single(CART, gym.make("CartPole-v1")),
        games.single(CART_RAW, gym.make("CartPole-v1").unwrapped),
    ]
    return run(measures, effort), []


def table(rows: list[Row]) -> list[tuple[str, ...]]:
    """One row per measure, and one per part of a step."""
    cells: list[tuple[str, ...]] = [("what", "steps/s", "µs a step", f"relative to {CART}")]
    for row in rows:
        speed = row["per_second"]
        cells.append((row["what"], f"{speed:,.0f}", f"{1e6 / speed:.1f}", f"{ratio(rows, row, CART) or 0.0:.2f}"))
    micro = {row["what"]: 1e6 / row["per_second"] for row in rows}
    for name, part in (
        ("within gym.make: Gymnasium's wrappers", micro[MADE] - micro[RAW]),
        ("within gym.make: observation, info, checks", micro[RAW] - micro[CODE]),
        ("within gym.make: calling the compiled step", micro[CODE]),
    ):
        cells.append((name, "", f"{part:.1f} ({part / micro[MADE]:.0%})", ""))
    return cells
