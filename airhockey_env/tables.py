"""Table presets: sizes, masses and physical constants as frozen, validated data with their sources."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.checks import check_number, check_pair, fault

LEAST, MOST = 1e-6, 1e6
"""Range of sizes, masses, speeds and accelerations in SI units. It reaches far beyond any table, and nothing that is
worked out from such numbers is too large or too small for a float."""
RANGES = {
    "wall_restitution": (0, 1),
    "wall_tangential": (0, 1),
    "paddle_restitution": (0, 1),
    "drag_constant": (0, MOST),
    "drag_linear": (0, MOST),
    "drag_quadratic": (0, MOST),
}
"""Smallest and largest values of the fields of a `TableSpec` that have another range."""


@dataclass(frozen=True)
class TableSpec:
    """The size and the physics of a table, in SI units: m, s, kg.

    The table is centred on the origin with x along its length; the left player's goal is at -x.
    Derive a variant with `dataclasses.replace(FULL_SIZE, puck_mass=0.02)`.

    Raises:
        ValueError: a field is not a finite number, is out of range, or is inconsistent with the others. The message
            names the field, what was given and what is allowed.
    """

    length: float
    """Length of the playing surface, along x, m."""
    width: float
    """Width of the playing surface, along y, m."""
    goal_width: float
    """Distance between the two posts of a goal, m; larger than the diameter of the puck."""
    puck_radius: float
    """Radius of the puck, m."""
    puck_mass: float
    """Mass of the puck, kg. Paddles are infinitely heavy, so this only scales the reported impulses."""
    paddle_radius: float
    """Radius of both paddles, m."""
    wall_restitution: float
    """Share of its normal speed that the puck keeps when it hits a wall or post, 0 to 1."""
    wall_tangential: float
    """Share of its tangential speed that the puck keeps when it hits a wall or post, 0 to 1."""
    paddle_restitution: float
    """Restitution between puck and paddle, 0 to 1."""
    drag_constant: float
    """Coefficient a of the glide deceleration a + c*v + b*v**2, m/s**2."""
    drag_linear: float
    """Coefficient c of the glide deceleration a + c*v + b*v**2, 1/s."""
    drag_quadratic: float
    """Coefficient b of the glide deceleration a + c*v + b*v**2, 1/m."""
    paddle_speed: float = 5.0
    """Greatest speed of a paddle, m/s. With a restitution of 0.8, a resting puck leaves a full-speed paddle at 9 m/s;
    human shots peak near 9.7 m/s."""
    paddle_acceleration: float = 30.0
    """Greatest acceleration of a paddle, m/s**2."""
    puck_speed: float = 12.0
    """Greatest speed of the puck at the end of a control step, m/s. A faster puck is slowed down to it, so that
    observations stay in range. Must be greater than `paddle_speed`."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            low, high = RANGES.get(field.name, (LEAST, MOST))
            object.__setattr__(self, field.name, check_number(field.name, getattr(self, field.name), low, high))
        if not 2.0 * self.puck_radius < self.goal_width:
            raise ValueError(
                f"goal_width must be greater than 2 * puck_radius ({2.0 * self.puck_radius}), got {self.goal_width}"
            )
        if not self.goal_width < self.width - 2.0 * self.puck_radius:
            raise ValueError(
                "goal_width must be less than width - 2 * puck_radius "
                f"({self.width - 2.0 * self.puck_radius}), got {self.goal_width}"
            )
        if not 2.0 * (self.paddle_radius + self.puck_radius) < self.width:
            raise ValueError(
                "width must be greater than 2 * (paddle_radius + puck_radius) "
                f"({2.0 * (self.paddle_radius + self.puck_radius)}), got {self.width}"
            )
        if not 8.0 * (self.paddle_radius + self.puck_radius) < self.length:
            raise ValueError(
                "length must be greater than 8 * (paddle_radius + puck_radius) "
                f"({8.0 * (self.paddle_radius + self.puck_radius)}), got {self.length}"
            )
        if not 10.0 * self.paddle_radius < self.length:  # at a serve its centre is a tenth of the length from the wall
            raise ValueError(
                f"paddle_radius must be less than a tenth of the length ({0.1 * self.length}), got {self.paddle_radius}"
            )
        if not self.paddle_speed < self.puck_speed:
            raise ValueError(f"puck_speed must be greater than paddle_speed {self.paddle_speed}, got {self.puck_speed}")


FIELDS = tuple(field.name for field in dataclasses.fields(TableSpec))
"""The fields of a `TableSpec`, in their order."""

FULL_SIZE = TableSpec(
    length=2.362,
    width=1.144,
    goal_width=0.3345,
    puck_radius=0.0413,
    puck_mass=0.037,
    paddle_radius=0.0505,
    wall_restitution=0.785,
    wall_tangential=0.66,
    paddle_restitution=0.8,
    drag_constant=0.0145,
    drag_linear=0.0,
    drag_quadratic=0.0348,
)
"""A full-size arcade table.

Sources: dimensions from the HudsonNock Air-Hockey-Sim table; glide (14.5 +- 7.1 mm/s**2 + 0.0348 v**2) and wall
bounces (normal 0.785, tangential 0.66) measured by misprit7; mallet restitution 0.8 from air_hockey_stack's tracker.
The measured normal restitution falls by about 0.039 per m/s between 0.7 and 7.3 m/s; this preset keeps it constant.
"""

CHALLENGE = TableSpec(
    length=1.948,
    width=1.038,
    goal_width=0.25,
    puck_radius=0.03165,
    puck_mass=0.010,
    paddle_radius=0.04815,
    wall_restitution=0.79,
    wall_tangential=0.84,
    paddle_restitution=0.8,
    drag_constant=0.0,
    drag_linear=0.5,
    drag_quadratic=0.0,
)
"""The table of the Robot Air Hockey Challenge 2023.

Sources: the challenge's MuJoCo model (damping 0.005 on a puck of 0.010 kg: a linear drag of about 0.5 /s); wall
restitution 0.79 and 0.84 from its Kalman filter; paddle restitution as for `FULL_SIZE`.
"""

IDEAL = dataclasses.replace(
    FULL_SIZE,
    wall_restitution=1.0,
    wall_tangential=1.0,
    paddle_restitution=1.0,
    drag_constant=0.0,
    drag_linear=0.0,
    drag_quadratic=0.0,
)
"""`FULL_SIZE` without any losses, for physics lessons and for tests of conservation laws. Not a real table."""

PRESETS: dict[str, TableSpec] = {"full_size": FULL_SIZE, "challenge": CHALLENGE, "ideal": IDEAL}

TABLES: dict[str, tuple[float, float]] = {
    "length": (1.9, 2.45),
    "width": (1.0, 1.25),
    "goal_width": (0.25, 0.36),
    "puck_radius": (0.031, 0.0425),
    "paddle_radius": (0.046, 0.053),
    "wall_restitution": (0.65, 0.95),
    "wall_tangential": (0.55, 0.95),
    "paddle_restitution": (0.65, 0.95),
    "drag_constant": (0.0, 0.05),
    "drag_linear": (0.0, 0.5),
    "drag_quadratic": (0.0, 0.07),
}
"""Ranges that contain the full-size tables and those of robots that people have measured, with a margin.

Masses are left out: they only scale the reported impulses.

* Sizes: `FULL_SIZE` and `CHALLENGE`; the University of British Columbia's first table is about 2 m x 1 m
  (github.com/HudsonNock/Air-Hockey-Sim, README). The rules allow mallets up to 103 mm across.
* Walls: 0.785 and 0.79 of the normal speed are kept, 0.66 and 0.84 of the tangential speed. misprit7's measured normal
  restitution falls by 0.039 per m/s between 0.7 and 7.3 m/s, which is about 0.66 to 0.92 on one table. The UBC team
  reports a high variance over its wooden walls.
* Paddles: 0.8 is the only published value; the margin of 0.15 is that of the walls.
* Glide: misprit7 measured a = 0.0145 +- 0.0071 m/s**2 and b = 0.0348 /m, twice of which is the limit for b. Linear
  drags are 0.21 to 0.26 /s in the Kalman filter of the Robot Air Hockey Challenge 2023, 0.25 /s as fitted to the table
  of the University of Texas (github.com/CalCharles/air-hockey-rl, estimate.yaml), and 0.5 /s in the challenge's MuJoCo
  model. At 2 m/s these tables differ sixfold (0.15 to 1.0 m/s**2), and the ranges allow 0 to 1.33 m/s**2.
"""

TABLE_RANGES: dict[str, Mapping[str, tuple[float, float]]] = {"tables": TABLES}
"""Ranges to draw tables from, by name."""


def resolve_table(table: str | TableSpec | Mapping[str, float]) -> TableSpec:
    """Return the `TableSpec` for a `table` argument: the name of a preset, a spec, or a mapping of its fields.

    A mapping must have all fields that have no default, for example `dataclasses.asdict(FULL_SIZE)`.

    Raises:
        ValueError: `table` is none of these, or a field of the mapping is invalid.
    """
    if isinstance(table, TableSpec):
        return table
    if isinstance(table, str) and table in PRESETS:
        return PRESETS[table]
    if isinstance(table, Mapping):
        fields = dataclasses.fields(TableSpec)
        known = {field.name for field in fields}
        needed = {field.name for field in fields if field.default is dataclasses.MISSING}
        expected = "table must be a mapping of the fields of a TableSpec"
        if unknown := [name for name in table if name not in known]:
            raise ValueError(f"{expected}, got the field {unknown[0]!r}, which is none of {sorted(known)}")
        if missing := sorted(needed - table.keys()):
            raise ValueError(f"{expected}, got one without {missing}")
        return TableSpec(**table)
    raise fault("table", f"one of {sorted(PRESETS)}, a TableSpec or a mapping of its fields", table)


def resolve_randomize(randomize: str | Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """Return the ranges for a `randomize` argument: None, the name of ranges, or ranges, which are not checked here.

    Raises:
        ValueError: there are no ranges of that name.
    """
    if not isinstance(randomize, str):
        return randomize
    if randomize in TABLE_RANGES:
        return TABLE_RANGES[randomize]
    raise fault("randomize", f"None, one of {tuple(TABLE_RANGES)} or a mapping to (low, high)", randomize)


def check_randomize(spec: TableSpec, randomize: Mapping[str, Any]) -> NDArray[np.float64]:
    """What `randomize` means, as (len(FIELDS), 2) smallest and largest values.

    Args:
        spec: the table whose values the fields that are not named keep.
        randomize: from names of fields to (low, high).

    Raises:
        ValueError: a field is unknown, a range is not two finite numbers in order, or some values from the ranges do
            not make a table. The message names the field.
    """
    if not isinstance(randomize, Mapping):
        raise fault("randomize", "a mapping from TableSpec fields to (low, high)", randomize)
    ranges = np.repeat(np.array(dataclasses.astuple(spec))[:, np.newaxis], 2, axis=1)
    for name, given in randomize.items():
        if name not in FIELDS:
            raise fault("randomize", f"a mapping whose keys are among {FIELDS}", name)
        low, high = check_pair(f"randomize[{name!r}]", given)
        if low > high:
            raise fault(f"randomize[{name!r}]", "(low, high) with low <= high", given)
        ranges[FIELDS.index(name)] = low, high
    lowest, highest = (dict(zip(FIELDS, ranges[:, side].tolist(), strict=True)) for side in (0, 1))
    # The fields bind each other in one direction each: if the tightest tables are tables, all are.
    tightest = {name: lowest[name] for name in ("length", "width", "puck_speed")}
    tightest.update({name: highest[name] for name in ("puck_radius", "paddle_radius", "paddle_speed")})
    for table in (lowest, highest, {**lowest, **tightest}, {**highest, **tightest}):
        try:
            TableSpec(**table)
        except ValueError as error:
            raise ValueError(f"randomize must allow only valid tables, got ranges for which {error}") from error
    return ranges
