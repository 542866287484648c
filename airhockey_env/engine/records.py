"""The engine's inputs and outputs, as NumPy record types and named tuples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

SURFACE = np.dtype(
    [
        ("half_length", np.float64),  # m; inf for no walls
        ("half_width", np.float64),  # m; inf for no walls
        ("half_goal", np.float64),  # m; half the opening of the goals in the end walls, 0 for none
        ("wall_restitution", np.float64),  # share of the normal speed kept at a wall or post
        ("wall_tangential", np.float64),  # share of the tangential speed kept there
        ("disc_restitution", np.float64),  # disc on disc
    ],
    align=True,
)
"""The table's surface. A record with more fields, such as the game's, works as well."""

CONTACT = np.dtype(
    [
        ("time", np.float64),  # s into the tick
        ("a", np.int32),  # disc
        ("b", np.int32),  # disc, a < b; -1 for a wall or post
        ("x", np.float64),  # m, where they touch
        ("y", np.float64),
        ("nx", np.float64),  # unit normal, pointing from b to a
        ("ny", np.float64),
        ("impulse", np.float64),  # N s along the normal, on a; the opposite acts on b
    ],
    align=True,
)
"""One contact. Buffers of contacts are filled in order of time."""


class Discs(NamedTuple):
    """The discs of one table. The engine changes position, velocity and hits in place."""

    position: NDArray[np.float64]  # (n, 2) m
    velocity: NDArray[np.float64]  # (n, 2) m/s
    radius: NDArray[np.float64]  # (n,) m
    inverse_mass: NDArray[np.float64]  # (n,) 1/kg; 0 for discs that are immovable or driven by the caller
    hits: NDArray[np.int32]  # (n,) contacts so far in this tick


class Kiss(NamedTuple):
    """The next kiss on a table: its time, its kind, and what is involved."""

    time: float  # s from now
    kind: int  # one of the constants below
    a: int  # disc
    b: int  # DISC: the other disc; WALL, POST, GOAL: which one (see `kiss`)


NOTHING, DISC, WALL, POST, GOAL = range(5)


class Outcome(NamedTuple):
    """The result of a tick."""

    elapsed: float  # s; less than the tick only after a goal or when the buffer is full
    contacts: int  # how many there were; the buffer holds the first ones
    goal: int  # side of the goal line that a disc's centre crossed: -1 left, +1 right, 0 none
