"""Tables to torture the game on: presets, extremes, any that may be, and ranges from which `randomize` draws."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from airhockey_env.tables import CHALLENGE, FIELDS, FULL_SIZE, IDEAL, TableSpec, check_randomize

RATES = (10.0, 24.0, 50.0, 120.0, 240.0)
SPECS: dict[str, TableSpec] = {
    "full_size": FULL_SIZE,
    "challenge": CHALLENGE,
    "ideal": IDEAL,
    "violent": dataclasses.replace(IDEAL, paddle_speed=40.0, paddle_acceleration=5000.0, puck_speed=100.0),
    "dead": dataclasses.replace(FULL_SIZE, wall_restitution=0.0, wall_tangential=0.0, paddle_restitution=0.0),
    "cramped": TableSpec(
        length=0.9, width=0.27, goal_width=0.11, puck_radius=0.05, puck_mass=0.05, paddle_radius=0.06,
        wall_restitution=0.9, wall_tangential=0.9, paddle_restitution=0.9,
        drag_constant=0.1, drag_linear=0.1, drag_quadratic=0.1,
    ),
}  # fmt: skip

RANDOM = "random"
"""Every seed and rate plays on a table of its own."""
RANDOMIZED = "randomized"
"""Every seed and rate has ranges of its own, from which `randomize` draws a table for every episode."""
TABLES = (*SPECS, RANDOM, RANDOMIZED)


def random_spec(rng: np.random.Generator) -> TableSpec:
    """Any table, within a factor of two to three of real ones."""
    while True:
        length, width, goal = rng.uniform((1.0, 0.5, 0.1), (3.0, 1.5, 0.6))
        puck, paddle, mass = rng.uniform((0.02, 0.03, 0.005), (0.07, 0.09, 0.1))
        kept = rng.uniform(0.0, 1.0, 3)
        drag = rng.uniform(0.0, (0.1, 1.0, 0.2))
        paddle_speed, acceleration, puck_speed = rng.uniform((1.0, 5.0, 5.0), (10.0, 300.0, 30.0))
        try:
            values = (length, width, goal, puck, mass, paddle, *kept, *drag, paddle_speed, acceleration, puck_speed)
            return TableSpec(**dict(zip(FIELDS, values, strict=True)))
        except ValueError:  # they do not fit together
            continue


def random_ranges(spec: TableSpec, rng: np.random.Generator) -> dict[str, tuple[float, float]]:
    """For every field, a range from that of `spec` to that of another table, wherever all that lies between will do."""
    while True:
        other = random_spec(rng)
        pairs = {name: (getattr(spec, name), getattr(other, name)) for name in FIELDS}
        ranges = {name: (min(pair), max(pair)) for name, pair in pairs.items()}
        try:
            check_randomize(spec, ranges)
        except ValueError:  # some draws would not fit together
            continue
        return ranges


def table_of(name: str, seed: int, control_hz: float) -> dict[str, Any]:
    """The arguments of `Game` for a name of `TABLES`."""
    if name in SPECS:
        return {"table": SPECS[name]}
    rng = np.random.default_rng((seed, int(control_hz)))
    spec = random_spec(rng)
    return {"table": spec} if name == RANDOM else {"table": spec, "randomize": random_ranges(spec, rng)}
