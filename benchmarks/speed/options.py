"""The cost of the game's options, in a batch on one core, and of rendering."""

from __future__ import annotations

import gymnasium as gym

from airhockey_env.cameras import ROBOT, ROBOTS
from benchmarks.speed import games
from benchmarks.speed.measure import Effort, Row, ratio, run
from benchmarks.speed.single import CART, MADE

TITLE = "Options"
SIZE = 4096
DEFAULT = "default: striker, states, sparse reward"


def measure(effort: Effort) -> tuple[list[Row], list[str]]:
    """Rows for all options; there are no notes."""
    n = 256 if effort.quick else SIZE
    ranges = {"wall_restitution": (0.7, 0.9), "puck_mass": (0.03, 0.05)}
    measures = [
        games.batch(DEFAULT, n),
        games.batch('opponent="idle"', n, opponent="idle"),
        games.batch('opponent="goalie"', n, opponent="goalie"),
        games.batch('opponent="expert"', n, opponent="expert"),
        games.batch('reward="shaped"', n, reward="shaped"),
        games.batch("randomize of two fields", n, randomize=ranges),
        games.batch('obs_type="rgb"', n, obs_type="rgb"),
        games.batch('obs_type="grayscale"', n, obs_type="grayscale"),
        games.batch("seen by the camera ROBOT", n, camera=ROBOT),
        games.batch("seen by drawn cameras, ROBOTS", n, camera=ROBOTS),
        games.batch("stack=6", n, stack=6),
        games.batch("action_delay_ms=(5, 30)", n, action_delay_ms=(5, 30)),
        games.batch("ROBOTS, stack=6 and action_delay_ms=(5, 30)", n, camera=ROBOTS, stack=6, action_delay_ms=(5, 30)),
        games.both_sides("both players controlled by the caller (Game)", n),
        games.pictures("render() of one environment, pictures/s"),
        games.single(MADE, gym.make("AirHockey-v0")),
        games.single(CART, gym.make("CartPole-v1")),
    ]
    return run(measures, effort), []


def table(rows: list[Row]) -> list[tuple[str, ...]]:
    """One row per option."""
    head = ("what", "environments", "steps/s", "relative to the default", f"relative to {CART}")
    cells: list[tuple[str, ...]] = [head]
    cart = next(row["per_second"] for row in rows if row["what"] == CART)
    for row in rows:
        share, speed = ratio(rows, row, DEFAULT), row["per_second"]
        shown = "" if share is None else f"{share:.2f}"
        cells.append((row["what"], f"{row['at']:,}", f"{speed:,.0f}", shown, _times(speed / cart)))
    return cells


def _times(factor: float) -> str:
    """Format a factor with two significant digits below 100, and as a whole number from 100 on."""
    return f"{factor:.0f}" if factor >= 99.5 else f"{factor:.2g}"
