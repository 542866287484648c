"""Print how a player scores."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from agents.measuring.goals import Goals
from agents.measuring.shares import Share, quartiles
from agents.tables import print_table


def print_goals(title: str, goals: Goals) -> None:
    """Print the ways to score, and when and where from, with 95 % Wilson intervals."""
    rows = [(way, share_of(share)) for way, share in goals.ways.items()]
    rows += [
        ("bank shots, of the goals by untouched shots", share_of(goals.bank)),
        ("in points that began with the scorer's serve", share_of(goals.serve)),
        ("fouls of the other player (shot clock)", str(goals.fouls)),
        ("time from getting the puck to the shot, s (quartiles)", quartiles_of(goals.held)),
        ("speed of the shot, m/s (quartiles)", quartiles_of(goals.speed, 1)),
        ("other paddle's distance from its goal line, m (quartiles)", quartiles_of(goals.depth)),
        ("other paddle's distance from the long axis, m (quartiles)", quartiles_of(goals.aside)),
    ]
    print_table(title, [("", ""), *rows])


def share_of(share: Share) -> str:
    """A count with its total, share and interval."""
    return f"{share.count} of {share.of}, {share}" if share.of else str(share)


def quartiles_of(values: NDArray[np.float64], digits: int = 2) -> str:
    """The median, and the first and third quartile in brackets."""
    low, median, high = ("never" if math.isinf(value) else f"{value:.{digits}f}" for value in quartiles(values))
    return f"{median} ({low}-{high})" if len(values) else "none"
