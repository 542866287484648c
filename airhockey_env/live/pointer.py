"""Where a person points, between the moments at which it is reported."""

from __future__ import annotations

from collections import deque

GRASP = 0.016
"""s over which the pointer's velocity is measured, twice: about one picture, and a few reports of a mouse."""

MEMORY = 0.2
"""s for which a path is kept: more than a match may have to catch up with, and three times `GRASP`."""


class Pointer:
    """Where the pointer was in the last moments: a path through what was reported of it."""

    def __init__(self) -> None:
        self._path: deque[tuple[float, float, float]] = deque()  # s, m, m

    def __bool__(self) -> bool:
        return bool(self._path)

    def move(self, now: float, place: tuple[float, float]) -> None:
        """Note where the pointer is now."""
        self._path.append((now, *place))
        while len(self._path) > 2 and self._path[1][0] < now - MEMORY:
            self._path.popleft()

    def place(self, time: float) -> tuple[float, float]:
        """Where it was; between two reports on the straight line between them."""
        after = self._path[-1]
        if time >= after[0]:
            return after[1], after[2]
        for before in reversed(self._path):
            if before[0] <= time:
                share = (time - before[0]) / (after[0] - before[0])
                return before[1] + share * (after[1] - before[1]), before[2] + share * (after[2] - before[2])
            after = before
        return after[1], after[2]

    def velocity(self, time: float) -> tuple[float, float]:
        """The velocity that it will keep as far as one can tell: that of the last two moments. One that gets slower is
        taken to go on doing so; one that has stopped, jumped or turned back has none.
        """
        now, before, earlier = (self.place(time - k * GRASP) for k in range(3))
        vx, vy = (_kept((a - b) / GRASP, (b - c) / GRASP) for a, b, c in zip(now, before, earlier, strict=True))
        return vx, vy


def _kept(latest: float, earlier: float) -> float:
    """What is left of a velocity along one axis."""
    if latest * earlier <= 0.0:
        return 0.0
    if abs(latest) > abs(earlier):
        return earlier
    slower = 2.0 * latest - earlier
    return slower if slower * latest > 0.0 else 0.0
