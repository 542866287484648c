"""Scenes of the air table: what a visitor sets up, as a text that fits into a link, and the named ones."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.air_table import METHODS, AirTable

SIZE = (2.0, 1.0)
"""Length and width of the table, m."""
MOST_PUCKS = 24
TICKS = (0.004, 0.1)
"""Shortest and longest tick, s."""
RADII = (0.01, 0.25)
"""Smallest and largest radius, m."""
MASSES = (0.01, 100.0)
"""Smallest and largest mass, kg."""
FASTEST = 100.0
"""Greatest component of a velocity, m/s."""


class Puck(NamedTuple):
    """A puck: its centre, m, velocity, m/s, radius, m, and mass, kg."""

    x: float
    y: float
    vx: float = 0.0
    vy: float = 0.0
    radius: float = 0.05
    mass: float = 1.0


_PUCK_RANGES = (
    (-0.5 * SIZE[0], 0.5 * SIZE[0]),
    (-0.5 * SIZE[1], 0.5 * SIZE[1]),
    (-FASTEST, FASTEST),
    (-FASTEST, FASTEST),
    RADII,
    MASSES,
)
_RANGES = {"tick": TICKS, "restitution": (0.0, 1.0), "wall_restitution": (0.0, 1.0), "phase": (0.0, 1.0)}


@dataclass(frozen=True)
class Scene:
    """Pucks on a table of `SIZE` with walls, and how it is stepped.

    Args:
        pucks: 1 to `MOST_PUCKS`, within the ranges above.
        tick: s.
        restitution: between pucks, 0 to 1.
        wall_restitution: 0 to 1.
        phase: where in a tick the motion starts, 0 to 1: every puck starts the way of so much of a tick earlier. An
            exact method has the same result for every phase.

    Raises:
        ValueError: something is out of range; the message names it.
    """

    pucks: tuple[Puck, ...]
    tick: float = 0.02
    restitution: float = 1.0
    wall_restitution: float = 1.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        if not 1 <= len(self.pucks) <= MOST_PUCKS:
            raise ValueError(f"pucks must be 1 to {MOST_PUCKS}, got {len(self.pucks)}")
        for number, puck in enumerate(self.pucks):
            for name, value, (low, high) in zip(Puck._fields, puck, _PUCK_RANGES, strict=True):
                _check(f"{name} of puck {number + 1}", value, low, high)
        for name, (low, high) in _RANGES.items():
            _check(name, getattr(self, name), low, high)

    @classmethod
    def parse(cls, text: str) -> Scene:
        """Read what `text` wrote, or "scene=NAME" for a named scene.

        Raises:
            ValueError: the text is none of these, or something is out of range.
        """
        fields: dict[str, Any] = {}
        for part in text.split("&"):
            name, equals, value = part.partition("=")
            if not equals or name in fields or name not in ("scene", "pucks", *_RANGES):
                raise ValueError(f"the link must hold pucks and {', '.join(_RANGES)}, each once, got {part[:40]!r}")
            fields[name] = value
        if "scene" in fields:
            if len(fields) > 1 or fields["scene"] not in SCENES:
                raise ValueError(f"scene must be one of {', '.join(SCENES)}, alone, got {text[:40]!r}")
            return SCENES[fields["scene"]]
        rows = fields.pop("pucks", "").split(";")
        if len(rows) > MOST_PUCKS:
            raise ValueError(f"pucks must be 1 to {MOST_PUCKS}, got {len(rows)}")
        pucks = []
        for row in rows:
            numbers = row.split(",")
            if len(numbers) != len(Puck._fields):
                raise ValueError(f"pucks must be {', '.join(Puck._fields)} each, got {row[:40]!r}")
            pucks.append(Puck(*(_read("pucks", number) for number in numbers)))
        return cls(tuple(pucks), **{name: _read(name, value) for name, value in fields.items()})

    @property
    def text(self) -> str:
        """The scene as a text without blanks, from which `parse` makes the same scene to the bit."""
        pucks = ";".join(",".join(_written(number) for number in puck) for puck in self.pucks)
        return "&".join([f"pucks={pucks}", *(f"{name}={_written(getattr(self, name))}" for name in _RANGES)])

    @property
    def name(self) -> str:
        """The named scene that this is, whatever its phase; empty if it is none."""
        start = replace(self, phase=0.0)
        return next((name for name, scene in SCENES.items() if scene == start), "")

    @property
    def radii(self) -> NDArray[np.float64]:
        """(N,) m."""
        return np.array([puck.radius for puck in self.pucks])

    @property
    def masses(self) -> NDArray[np.float64]:
        """(N,) kg."""
        return np.array([puck.mass for puck in self.pucks])

    @property
    def many_contacts(self) -> bool:
        """Whether a tick may have thousands of contacts: pucks that collapse, or a light one between heavy ones."""
        lossy = self.restitution < 1.0 or self.wall_restitution < 1.0
        return lossy or float(self.masses.max() / self.masses.min()) > 100.0

    def tables(self) -> dict[str, AirTable]:
        """The scene on one table for each method.

        Raises:
            ValueError: pucks overlap each other or a wall.
        """
        velocities = np.array([[puck.vx, puck.vy] for puck in self.pucks])
        positions = np.array([[puck.x, puck.y] for puck in self.pucks]) - self.phase * self.tick * velocities
        settings = (self.radii, self.masses, self.restitution, self.wall_restitution, SIZE)
        try:
            return {method: AirTable(positions, velocities, *settings, method) for method in METHODS}
        except ValueError as error:
            raise ValueError(_of_pucks(str(error))) from error

    def moved(self, positions: NDArray[np.float64], velocities: NDArray[np.float64]) -> Scene:
        """The same pucks somewhere else: (N, 2) m and m/s."""
        rows = zip(self.pucks, positions.tolist(), velocities.tolist(), strict=True)
        pucks = (puck._replace(x=x, y=y, vx=vx, vy=vy) for puck, (x, y), (vx, vy) in rows)
        return replace(self, pucks=tuple(pucks), phase=0.0)


def _check(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ValueError(f"{name} must be from {low:g} to {high:g}, got {value:g}")


def _read(name: str, text: str) -> float:
    try:
        return float(text)  # its range is checked with the scene, NaN included
    except ValueError:
        raise ValueError(f"{name} must be numbers, got {text[:40]!r}") from None


def _of_pucks(text: str) -> str:
    """What an air table says about discs, which it counts from 0, about pucks, which people count from 1."""
    return re.sub(r"\b(discs?|and) (\d+)\b", lambda m: f"{m[1].replace('disc', 'puck')} {int(m[2]) + 1}", text)


def _written(number: float) -> str:
    return repr(number).removesuffix(".0")


# Named scenes ---------------------------------------------------------------------------------------------------------


def _pool_shot() -> Scene:
    """The picture of the method: a fast puck hits one that rests, 0.6 of the sum of their radii off its centre."""
    return Scene((Puck(-0.675, 0.06, 3.0), Puck(0.0, 0.0)))


def _cradle() -> Scene:
    return Scene((Puck(-0.6, 0.0, 1.5), *(Puck(0.1 * k, 0.0) for k in range(5))))


def _rack() -> Scene:
    """Fifteen pucks in a triangle, half a millimetre apart, and one that breaks it."""
    radius, pucks = 0.03, [Puck(-0.7, 0.004, 6.0, 0.0, 0.03)]
    pitch = 2.0 * radius + 0.0005
    for row in range(5):
        for k in range(row + 1):
            x, y = 0.15 + row * pitch * math.sqrt(0.75), (k - 0.5 * row) * pitch
            pucks.append(Puck(round(x, 5), round(y, 5), radius=radius))
    return Scene(tuple(pucks), tick=0.01)


def _tunnelling() -> Scene:
    """A puck that travels three times the sum of the radii in a tick: whether it is seen to hit is luck."""
    return Scene((Puck(-0.83, 0.01, 12.0, 0.0, 0.03, 0.2), *(Puck(x, 0.0, radius=0.05) for x in (-0.45, 0.1, 0.62))))


def _reversal() -> Scene:
    """A dozen pucks in all directions, to turn the time round with."""
    pucks = []
    for k in range(12):
        x, y, direction = -0.75 + 0.5 * (k % 4), -0.3 + 0.3 * (k // 4), 2.4 * k
        pucks.append(Puck(x, y, round(1.5 * math.cos(direction), 3), round(1.5 * math.sin(direction), 3)))
    return Scene(tuple(pucks))


def _sizes() -> Scene:
    return Scene(
        (
            Puck(-0.6, 0.1, 0.8, 0.1, 0.18, 8.0),
            Puck(0.5, -0.2, -0.4, 0.3, 0.12, 3.0),
            Puck(0.1, 0.3, 0.5, -0.9, 0.07, 1.0),
            Puck(0.75, 0.3, -1.2, -0.4, 0.04, 0.3),
            Puck(-0.1, -0.35, 0.2, 1.5, 0.025, 0.1),
        )
    )


SCENES = {
    "pool_shot": _pool_shot(),
    "newtons_cradle": _cradle(),
    "break_of_a_rack": _rack(),
    "tunnelling_at_speed": _tunnelling(),
    "reversal": _reversal(),
    "large_and_small": _sizes(),
}
