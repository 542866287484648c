"""Random tables for the tests of the engine."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from airhockey_env.air_table import AirTable

laws = settings(deadline=None, derandomize=True, max_examples=200)
"""For every law: the same examples in every run, and no limit on time (the first call compiles)."""

seeds = st.integers(0, 2**32 - 1)


@dataclass(frozen=True)
class Scene:
    """The arguments of an `AirTable`, all arrays written out."""

    positions: np.ndarray
    velocities: np.ndarray
    radii: np.ndarray
    masses: np.ndarray
    restitution: float = 1.0
    wall_restitution: float = 1.0
    size: tuple[float, float] | None = (2.0, 1.0)

    def table(self, **changes: Any) -> AirTable:
        return AirTable(**{field.name: getattr(self, field.name) for field in dataclasses.fields(self)} | changes)


def random_scene(
    rng: np.random.Generator,
    discs: tuple[int, int] = (1, 6),
    speed: float = 6.0,
    walls: bool | None = None,
    elastic: bool | None = None,
    heavy: float = 0.0,
    radii: tuple[float, float] = (0.03, 0.1),
) -> Scene:
    """A table with discs of different sizes and masses that lie apart.

    Args:
        discs: least and greatest number.
        speed: greatest speed, m/s.
        walls, elastic: drawn at random if None.
        heavy: share of discs of infinite mass.
        radii: least and greatest; many discs of the default ones would find no room.
    """
    n = int(rng.integers(discs[0], discs[1] + 1))
    walls = bool(rng.random() < 0.7) if walls is None else walls
    elastic = bool(rng.random() < 0.5) if elastic is None else elastic
    half = np.array([1.0, 0.5]) if walls else np.array([0.5, 0.3])
    sizes = rng.uniform(*radii, n)
    positions = np.empty((n, 2))
    for a in range(n):
        while True:
            positions[a] = rng.uniform(-1.0, 1.0, 2) * (half - sizes[a])
            if all(math.dist(positions[a], positions[b]) > sizes[a] + sizes[b] for b in range(a)):
                break
    angle = rng.uniform(0.0, 2.0 * math.pi, n)
    velocities = rng.uniform(0.0, speed, (n, 1)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    masses = np.where(rng.random(n) < heavy, math.inf, 10.0 ** rng.uniform(-1.0, 1.0, n))
    restitution, wall_restitution = (1.0, 1.0) if elastic else rng.uniform(0.3, 1.0, 2)
    return Scene(
        positions, velocities, sizes, masses, float(restitution), float(wall_restitution), (2.0, 1.0) if walls else None
    )


def momentum(table: AirTable) -> np.ndarray:
    """Of the discs of finite mass, N s."""
    finite = np.isfinite(table.masses)
    return (table.masses[finite, None] * table.velocities[finite]).sum(axis=0)


def deepest_overlap(table: AirTable) -> float:
    """Of two discs that can meet, or of a disc and a wall, m; 0 or less if there is none."""
    depths = [-math.inf]
    masses, radii = table.masses, table.radii
    for a in range(len(radii)):
        for b in range(a):
            if math.isfinite(masses[a]) or math.isfinite(masses[b]):
                depths.append(radii[a] + radii[b] - math.dist(table.positions[a], table.positions[b]))
        if table.size is not None and math.isfinite(masses[a]):
            depths.append(float((np.abs(table.positions[a]) + radii[a] - 0.5 * np.array(table.size)).max()))
    return max(depths)
