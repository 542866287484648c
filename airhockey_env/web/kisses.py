"""The geometry of contacts: the two triangles, the two normals and t_p, from what the engine reports.

Everything is seen from puck B, whose centre at the start of the tick is the origin. docs/kiss_study.md has a picture.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.air_table import AirTable

MOST = 200
"""The most contacts of a tick that are described: the first ones."""

_Floats = NDArray[np.float64]


def kisses(
    table: AirTable, positions: _Floats, velocities: _Floats, tick: float, contacts: NDArray[np.void]
) -> list[dict[str, Any]]:
    """Describe the contacts between pucks in one tick.

    All methods change the end of a puck's path within the tick in the same way: a contact at `time` that changes its
    velocity by dv moves it by dv * (tick - time). This gives the motion that led to each contact.

    Args:
        table: after the tick.
        positions, velocities: (N, 2) m and m/s, before the tick.
        tick: s.
        contacts: what `AirTable.step` returned for the tick.

    Returns:
        See `_describe`; contacts of which a picture cannot be drawn are left out.
    """
    ends, velocities = positions + velocities * tick, velocities.copy()
    radii, masses, found = table.radii, table.masses, []
    if table.method != "continuous":  # the order in which they were resolved: pairs by number, then walls
        contacts = contacts[np.lexsort((contacts["nx"] == 0.0, contacts["b"], contacts["a"], contacts["b"] < 0))]
    for contact in contacts[:MOST]:
        a, b, time = int(contact["a"]), int(contact["b"]), float(contact["time"])
        normal = np.array([contact["nx"], contact["ny"]])
        if b >= 0:
            starts = ends[[a, b]] - velocities[[a, b]] * tick
            kiss = _describe(table.method, starts, velocities[[a, b]], radii[[a, b]], tick, time, normal)
            if kiss is not None:
                found.append({"method": table.method, "a": a, "b": b, **kiss})
        for disc, sign in ((a, 1.0), (b, -1.0)):
            if disc >= 0:
                change = sign * float(contact["impulse"]) / masses[disc] * normal
                velocities[disc] += change
                ends[disc] += change * (tick - time)
    return found


def _describe(
    method: str, starts: _Floats, velocities: _Floats, radii: _Floats, tick: float, time: float, normal: _Floats
) -> dict[str, Any] | None:
    """The contact of puck A with puck B, or None if they do not move relative to each other or overlapped before.

    Args:
        method: that of the table.
        starts, velocities: (2, 2) centres at the start of the tick and incoming velocities of A and B, m and m/s.
        radii: (2,) m.
        tick: s.
        time: of the contact, s into the tick, from the engine.
        normal: (2,) the normal that the method used, from the engine.

    Returns:
        Lengths in m, times in s, angles in degrees; places seen from B: `start` (A1), `kiss` (A2K'), `end` (A2'),
        `foot` (where the shared leg meets the path). `approximate` is None if the pucks do not overlap at the end of
        the tick: a test for overlaps would not have seen this contact.
    """
    used = normal
    if method == "overlap":  # its own time and normal are approximate; the exact ones are those of the pair alone
        try:
            pair = AirTable(starts, velocities, radii, size=None)
        except ValueError:
            return None
        exact = pair.step(tick)
        if not len(exact):
            return None
        time, normal = float(exact["time"][0]), np.array([exact["nx"][0], exact["ny"][0]])
    start, velocity = starts[0] - starts[1], velocities[0] - velocities[1]
    speed = math.hypot(*velocity)
    if speed == 0.0:
        return None
    path = velocity / speed
    end, kiss = start + tick * velocity, start + time * velocity
    foot = start - (start @ path) * path
    reach = float(radii.sum())
    overlaps = math.hypot(*end) < reach
    return {
        "tick": tick,
        "contact_time": time,
        "penetration_time": tick - time,
        "start": start.tolist(),
        "kiss": kiss.tolist(),
        "end": end.tolist(),
        "foot": foot.tolist(),
        "radii": radii.tolist(),
        "path": speed * tick,
        "projection": math.dist(start, foot),
        "shared_leg": math.hypot(*foot),
        "top_leg": math.dist(foot, kiss),
        "hypotenuse": math.hypot(*kiss),
        "ideal": angle(normal),
        "approximate": angle(end) if overlaps else None,
        "between": _between(normal, end) if overlaps else None,
        "used": angle(used),
        "place": (starts[1] + time * velocities[1] + radii[1] * normal).tolist(),
        "normal": used.tolist(),
    }


def angle(vector: _Floats) -> float:
    """Direction, degrees from x."""
    return math.degrees(math.atan2(vector[1], vector[0]))


def _between(one: _Floats, other: _Floats) -> float:
    """Angle between two directions, degrees."""
    return math.degrees(abs(math.atan2(one[0] * other[1] - one[1] * other[0], one @ other)))
