"""`AirTable`: the physics engine without a game."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airhockey_env.checks import check_array, check_choice, check_number, check_pair, check_positive, fault
from airhockey_env.compiled import compiled, machine_code, records
from airhockey_env.engine.advance import advance
from airhockey_env.engine.cluster import forget, make_cluster
from airhockey_env.engine.discrete import advance_discrete
from airhockey_env.engine.near import FEWEST, find_near, make_near
from airhockey_env.engine.records import CONTACT, SURFACE, Discs
from airhockey_env.engine.tolerances import FARTHEST, GREATEST, MOST_CONTACTS, OVERLAP, TABLE_CONTACTS
from airhockey_env.threads import Threads

METHODS = ("continuous", "kiss", "overlap")


_RANGE = f"from {1.0 / GREATEST:g} to {GREATEST:g}"


def _in_range(lengths_or_masses: NDArray[np.float64]) -> NDArray[np.bool_]:
    return (lengths_or_masses >= 1.0 / GREATEST) & (lengths_or_masses <= GREATEST)


def _check_all(name: str, numbers: NDArray[np.float64], good: NDArray[np.bool_], allowed: str) -> None:
    """Raise the error about the first of these numbers that is not good."""
    if not good.all():
        raise fault(name, allowed, numbers[~good][0])


def _recorded(buffer: NDArray[np.void], count: int) -> NDArray[np.void]:
    """Return a copy of the first `count` contacts of a buffer, as a plain array."""
    return np.array(buffer[:count].view(np.ndarray))


@compiled
def play_part(discs, before, surface, start, dt, limit, contacts, near, cluster):
    """Simulate a step of `dt` seconds, or the rest of it, until the buffer of contacts is full.

    Args:
        discs, limit, contacts, near, cluster: see `advance`.
        before: (n, 4) buffer for positions and velocities before the step.
        surface: (1,) `SURFACE`.
        start: s into the step at which to continue; negative for a new step.

    Returns:
        The time reached in the step, s, and the number of contacts. The latter is -1 if a number is out of range; then
        nothing has moved.
    """
    n = discs.position.shape[0]
    if start < 0.0:
        start = 0.0
        for a in range(n):
            for axis in range(2):
                place, speed = abs(discs.position[a, axis]), abs(discs.velocity[a, axis])
                if not (place <= GREATEST and speed <= GREATEST and speed * dt <= FARTHEST):
                    return 0.0, -1
        for a in range(n):
            discs.hits[a] = 0
            before[a, 0], before[a, 1] = discs.position[a, 0], discs.position[a, 1]
            before[a, 2], before[a, 3] = discs.velocity[a, 0], discs.velocity[a, 1]
        if cluster is not None:
            forget(cluster)
    if near is not None:
        find_near(near, discs, dt - start)
    outcome = advance(discs, surface[0], start, dt, limit, contacts, True, near, cluster)
    if outcome.contacts < contacts.shape[0] and not outcome.elapsed < dt:
        for a in range(n):
            if discs.inverse_mass[a] == 0.0:  # discs that gave way (see `relieve`) do so for this step only
                discs.velocity[a, 0], discs.velocity[a, 1] = before[a, 2], before[a, 3]
    return outcome.elapsed, outcome.contacts


_play_parts: dict[bool, Callable[..., tuple[float, int]]] = {}
"""The machine code of `play_part`, keyed by whether there is no broad phase; compiled when first needed."""


class AirTable:
    """A frictionless air table with any number of discs, simulated with exact contact times.

    The table is centred on the origin with x along its length. Velocities are constant between contacts.

    Simultaneous contacts are resolved one after the other, in the order of the disc numbers. This makes runs
    reproducible to the bit, but the result depends on the numbering and need not be symmetric: when a puck hits two
    touching pucks at once (the second example), the one with the lower number leaves faster. Real pucks would collide
    with both at the same time, in a way that depends on their material and not on restitution alone.

    With a restitution below 1, pucks that are packed together have ever more contacts in ever less time (inelastic
    collapse). On tables with 12 discs or more, such a cluster is resolved in a single step, as one inelastic contact of
    all discs that are less than a hundredth of their radii apart: they get the velocities closest to their present ones
    for which no two of them approach. This conserves momentum and angular momentum and never increases the energy. See
    `airhockey_env.engine.cluster`.

    Args:
        positions: (N, 2) centres of the discs, m, each coordinate at most 1e50 in size. Discs must not overlap each
            other or extend beyond a wall.
        velocities: (N, 2) m/s, each component at most 1e50 in size.
        radii: scalar or (N,), m, from 1e-50 to 1e50. A disc of infinite mass may have radius 0 (a post).
        masses: scalar or (N,), kg, from 1e-50 to 1e50, or `inf`. A disc of mass `inf` is immovable or driven by the
            caller: it keeps its velocity, passes through walls and other such discs, and only gives way (stops for the
            rest of the step) when it squeezes a puck.
        restitution: restitution between discs, 0 to 1.
        wall_restitution: restitution between disc and wall, 0 to 1.
        size: (length, width) of the table, m, greater than 0 and up to 1e50; None for no walls.
        method: how a step detects and resolves contacts. `"continuous"` resolves contacts exactly, in order of time, at
            any speed and for any step. `"kiss"` moves discs that overlap at the end of the step back to where they
            first touched. `"overlap"` takes the normal from the overlapping positions, as many simulations do.
            docs/kiss_study.md compares them.

    Attributes:
        time: s since construction.

    Raises:
        ValueError: an argument has the wrong shape or is out of range, or discs overlap. The message names the
            argument.

    Example:
        >>> table = AirTable([[-0.5, 0.0], [0.0, 0.03]], [[2.0, 0.0], [0.0, 0.0]], radii=0.05)
        >>> contacts = table.step(0.5)
        >>> contacts[["a", "b"]].tolist()
        [(0, 1)]

        >>> table = AirTable([[-0.3, 0.0], [0.0, 0.05], [0.0, -0.05]], [[1.0, 0.0], [0, 0], [0, 0]], radii=0.05)
        >>> contacts = table.step(0.5)
        >>> table.velocities.round(3).tolist()
        [[-0.125, -0.217], [0.75, 0.433], [0.375, -0.217]]
    """

    def __init__(
        self,
        positions: ArrayLike,
        velocities: ArrayLike,
        radii: ArrayLike,
        masses: ArrayLike = 1.0,
        restitution: float = 1.0,
        wall_restitution: float = 1.0,
        size: tuple[float, float] | None = (2.0, 1.0),
        method: str = "continuous",
    ) -> None:
        try:
            n = len(positions)  # type: ignore[arg-type]
        except TypeError as error:
            raise fault("positions", "an (N, 2) array in m", positions) from error
        if n == 0:
            raise ValueError("positions must hold at least one disc, got none")
        self.method: str = check_choice("method", method, METHODS)
        self.time: float = 0.0
        self._positions = check_array("positions", positions, (n, 2), "an (N, 2) array in m")
        self._velocities = check_array("velocities", velocities, (n, 2), "an (N, 2) array in m/s, N as in positions")
        self._check_motion()
        self._radii = check_array("radii", radii, (n,), "a number or an (N,) array in m")
        self._masses = check_array("masses", masses, (n,), "a number or an (N,) array in kg")
        posts = (self._radii == 0.0) & np.isinf(self._masses)
        driven = self._masses == math.inf
        _check_all("masses", self._masses, _in_range(self._masses) | driven, f"{_RANGE} kg, or inf")
        _check_all("radii", self._radii, _in_range(self._radii) | posts, f"{_RANGE} m, or 0 where the mass is inf")
        self._surface = records(1, SURFACE)
        self._surface["disc_restitution"] = check_number("restitution", restitution, 0, 1)
        self._surface["wall_restitution"] = check_number("wall_restitution", wall_restitution, 0, 1)
        self._surface["wall_tangential"] = 1.0
        self.size: tuple[float, float] | None = self._check_size(size)
        half_length, half_width = (math.inf, math.inf) if self.size is None else (0.5 * s for s in self.size)
        self._surface["half_length"] = half_length
        self._surface["half_width"] = half_width
        self._inverse_masses = 1.0 / self._masses
        self._check_places()
        self._hits = np.zeros(n, np.int32)
        self._buffer = records(max(64, 4 * n), CONTACT)
        self._before = np.zeros((n, 4))
        self._threads = Threads(1)
        self._near = make_near(n) if n >= FEWEST else None
        self._cluster = make_cluster(n, float(restitution), float(wall_restitution)) if n >= FEWEST else None

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) centres, m, as the live array. Assigning moves the discs, with the same checks as the constructor."""
        return self._positions

    @positions.setter
    def positions(self, value: ArrayLike) -> None:
        before = self._positions
        self._positions = check_array("positions", value, before.shape, "an (N, 2) array in m")
        try:
            self._check_motion()
            self._check_places()
        except ValueError:
            self._positions = before
            raise

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s, as the live array. Modify or assign it to drive discs."""
        return self._velocities

    @velocities.setter
    def velocities(self, value: ArrayLike) -> None:
        before = self._velocities
        self._velocities = check_array("velocities", value, before.shape, "an (N, 2) array in m/s")
        try:
            self._check_motion()
        except ValueError:
            self._velocities = before
            raise

    @property
    def radii(self) -> NDArray[np.float64]:
        """(N,) radii, m; a copy."""
        return self._radii.copy()

    @property
    def masses(self) -> NDArray[np.float64]:
        """(N,) masses, kg; a copy."""
        return self._masses.copy()

    @property
    def energy(self) -> float:
        """Kinetic energy of all discs of finite mass, J."""
        finite = np.isfinite(self._masses)
        return float(0.5 * np.sum(self._masses[finite] * np.sum(self._velocities[finite] ** 2, axis=1)))

    def step(self, dt: float) -> NDArray[np.void]:
        """Simulate `dt` seconds. Threads may share a table; calls are then executed one at a time.

        All contacts of the step are returned, up to 4,194,304, so memory grows with `dt`. Simulate long times on a
        lossless table in many steps.

        Args:
            dt: s, greater than 0.

        Returns:
            A structured array with one row per contact, in order of time: `time` (s into this step), `a`, `b` (numbers
            of the discs, a < b; b is -1 for a wall), `x`, `y` (where they touch, m), `nx`, `ny` (unit normal from b
            to a) and `impulse` (N s, on a along the normal, on b against it).

        Raises:
            ValueError: `dt` is not a finite number greater than 0; it is so long that there would be too many contacts
                or a disc would travel more than 1e300 m; or a position or velocity was set to NaN or beyond 1e50. The
                table is left as it was before the step.
        """
        dt = check_positive("dt", dt)
        if not math.isfinite(self.time + dt):
            raise fault("dt", f"so short that the table's time, which is {self.time} s, stays finite", dt)
        with self._threads.lock:
            contacts = self._step_continuous(dt) if self.method == "continuous" else self._step_discrete(dt)
            self.time += dt
        return contacts

    def _discs(self) -> Discs:
        return Discs(self._positions, self._velocities, self._radii, self._inverse_masses, self._hits)

    def _step_continuous(self, dt: float) -> NDArray[np.void]:
        limit = int(min(TABLE_CONTACTS * max(1.0, dt), 2.0**30))
        discs, buffer, near = self._discs(), self._buffer, self._near
        cluster = None if near is None else self._cluster
        play = _play_parts.get(near is None)
        if play is None:
            arguments = (discs, self._before, self._surface, -1.0, dt, limit, buffer, near, cluster)
            play = _play_parts[near is None] = machine_code(play_part, *arguments)
        elapsed, count = play(discs, self._before, self._surface, -1.0, dt, limit, buffer, near, cluster)
        if count < 0:
            self._check_motion(dt)
        if count < len(buffer) and not elapsed < dt:
            return _recorded(buffer, count)
        parts, total = [_recorded(buffer, count)], count
        while count == len(buffer) or elapsed < dt:
            if total > MOST_CONTACTS:
                self._positions[:], self._velocities[:] = self._before[:, :2], self._before[:, 2:]
                raise ValueError(
                    f"dt must be so short that a step has at most {MOST_CONTACTS} contacts, got {dt} s, in which there "
                    "are more: play several shorter steps"
                )
            buffer = records(min(2 * len(buffer), MOST_CONTACTS), CONTACT)  # full: continue where it paused
            elapsed, count = play(discs, self._before, self._surface, elapsed, dt, limit, buffer, near, cluster)
            parts.append(_recorded(buffer, count))
            total += count
        return np.concatenate(parts)

    def _step_discrete(self, dt: float) -> NDArray[np.void]:
        self._check_motion(dt)
        positions, velocities = self._positions.copy(), self._velocities.copy()
        buffer = self._buffer
        while True:
            count = advance_discrete(self._discs(), self._surface[0], dt, self.method == "kiss", buffer)
            if count <= len(buffer):
                contacts = _recorded(buffer, count)
                return contacts[np.argsort(contacts["time"], kind="stable")]
            buffer = records(count, CONTACT)  # too small: simulate the step again
            self._positions[:], self._velocities[:] = positions, velocities

    def _check_motion(self, dt: float = 0.0) -> None:
        for name, array in (("positions", self._positions), ("velocities", self._velocities)):
            _check_all(name, array, np.abs(array) <= GREATEST, f"finite, from {-GREATEST} to {GREATEST}")
        fastest = float(np.abs(self._velocities).max())
        if not fastest * dt <= FARTHEST:
            raise fault("dt", f"so short that no disc travels more than {FARTHEST} m", dt)

    @staticmethod
    def _check_size(size: tuple[float, float] | None) -> tuple[float, float] | None:
        if size is None:
            return None
        lengths = check_pair("size", size, also="None")
        _check_all("size", lengths, (lengths > 0.0) & (lengths <= GREATEST), f"greater than 0 and at most {GREATEST} m")
        length, width = lengths.tolist()
        return length, width

    def _check_places(self) -> None:
        movable = self._inverse_masses > 0.0
        half = np.array([self._surface["half_length"][0], self._surface["half_width"][0]])
        beyond = np.abs(self._positions) + self._radii[:, None] - half
        if (beyond[movable] > OVERLAP).any():
            a = int(np.flatnonzero(movable)[np.argmax(beyond[movable].max(axis=1))])
            raise ValueError(
                f"positions must lie on the table: disc {a} at {tuple(self._positions[a].tolist())} reaches over a "
                f"wall by {beyond[a].max():.3g} m"
            )
        order = np.argsort(self._positions[:, 0] - self._radii)
        for k, a in enumerate(order):
            for b in order[k + 1 :]:
                if self._positions[b, 0] - self._radii[b] > self._positions[a, 0] + self._radii[a]:
                    break
                depth = self._radii[a] + self._radii[b] - math.dist(self._positions[a], self._positions[b])
                if depth > OVERLAP and (movable[a] or movable[b]):
                    raise ValueError(
                        f"positions must not overlap: discs {min(a, b)} and {max(a, b)} overlap by {depth:.3g} m"
                    )
