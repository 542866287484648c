"""The engine for people who want physics and no game."""

from __future__ import annotations

import math
from collections.abc import Callable
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airhockey_env.compiled import compiled, machine_code, records
from airhockey_env.engine.advance import advance
from airhockey_env.engine.cluster import forget, make_cluster
from airhockey_env.engine.discrete import advance_discrete
from airhockey_env.engine.near import FEWEST, find_near, make_near
from airhockey_env.engine.records import CONTACT, SURFACE, Discs
from airhockey_env.engine.tolerances import OVERLAP, TABLE_CONTACTS

METHODS = ("continuous", "kiss", "overlap")


def _array(name: str, value: ArrayLike, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    """`value` as a fresh float64 array of the given shape (scalars are spread), or an error that names it."""
    try:
        array = np.asarray(value, dtype=np.float64)
        array = np.array(np.broadcast_to(array, shape) if array.ndim == 0 else array, order="C")
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be {what}, got {value!r}") from error
    if array.shape != shape:
        raise ValueError(f"{name} must be {what}, that is of shape {shape}; got shape {array.shape}")
    if np.isnan(array).any():
        raise ValueError(f"{name} must be {what}, got NaN")
    return array


def _shown(value: object) -> str:
    """As Python writes it: from version 2 on NumPy says of its own numbers that they are."""
    return repr(value.item() if isinstance(value, np.generic) else value)


def _share(name: str, value: float) -> float:
    if isinstance(value, bool) or not isinstance(value, Real) or not 0.0 <= value <= 1.0:
        raise ValueError(f"{name} must be a number from 0 to 1, got {_shown(value)}")
    return float(value)


def _recorded(buffer: NDArray[np.void], count: int) -> NDArray[np.void]:
    """The first contacts of a buffer, as a plain array of their own."""
    return np.array(buffer[:count].view(np.ndarray))


@compiled
def play_part(discs, driven, surface, start, dt, limit, contacts, near, cluster):
    """Play a step of `dt` seconds, or what is left of it, until the buffer of contacts is full.

    Args:
        discs, limit, contacts, near, cluster: see `advance`.
        driven: (n, 2), keeps the velocities of driven discs.
        surface: (1,) `SURFACE`.
        start: s; negative for a new step.

    Returns:
        (s that were played, contacts); contacts are -1 if something is not finite, and nothing has moved then.
    """
    n = discs.position.shape[0]
    if start < 0.0:
        start = 0.0
        for a in range(n):
            for axis in range(2):
                if not (math.isfinite(discs.position[a, axis]) and math.isfinite(discs.velocity[a, axis])):
                    return 0.0, -1
        for a in range(n):
            discs.hits[a] = 0
            driven[a, 0], driven[a, 1] = discs.velocity[a, 0], discs.velocity[a, 1]
        if cluster is not None:
            forget(cluster)
    if near is not None:
        find_near(near, discs, dt - start)
    outcome = advance(discs, surface[0], start, dt, limit, contacts, True, near, cluster)
    if outcome.contacts < contacts.shape[0] and not outcome.elapsed < dt:
        for a in range(n):
            if discs.inverse_mass[a] == 0.0:  # those that gave way did so for this step only
                discs.velocity[a, 0], discs.velocity[a, 1] = driven[a, 0], driven[a, 1]
    return outcome.elapsed, outcome.contacts


_play_parts: dict[tuple[bool, bool], Callable[..., tuple[float, int]]] = {}
"""The machine code of `play_part` without and with pairs that are near, once it is needed."""


class AirTable:
    """Any number of pucks on an air table: no friction, exact kisses.

    The table is centred on the origin with x along its length. Velocities are constant between contacts.

    Args:
        positions: (N, 2) centres of the discs, m. Neither overlapping each other nor reaching over a wall.
        velocities: (N, 2) m/s.
        radii: scalar or (N,), m. Greater than 0, or 0 for a disc of infinite mass: a post.
        masses: scalar or (N,), kg, greater than 0. A disc of mass `inf` is immovable, or driven from outside: it keeps
            its velocity, passes through walls and other such discs, and gives way (stops for the rest of the step)
            only where it squeezes a puck.
        restitution: of disc on disc, 0 to 1.
        wall_restitution: of disc on wall, 0 to 1.
        size: (length, width) of the table, m, or None for no walls.
        method: how a step finds and resolves contacts. `"continuous"`: exact, earliest kiss first, at any speed and
            any step. `"kiss"`: discs that overlap at the end of the step are taken back to their kiss point.
            `"overlap"`: the normal is taken from the overlapping positions, as is often done. See the README.

    Attributes:
        time: s since construction.

    Raises:
        ValueError: an argument is of the wrong shape or range, or discs overlap. The message names the argument.

    Example:
        >>> table = AirTable([[-0.5, 0.0], [0.0, 0.03]], [[2.0, 0.0], [0.0, 0.0]], radii=0.05)
        >>> contacts = table.step(0.5)
        >>> len(contacts), contacts["a"][0], contacts["b"][0]
        (1, 0, 1)
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
        if method not in METHODS:
            raise ValueError(f"method must be one of {METHODS}, got {method!r}")
        try:
            n = len(positions)  # type: ignore[arg-type]
        except TypeError as error:
            raise ValueError(f"positions must be an (N, 2) array, got {positions!r}") from error
        if n == 0:
            raise ValueError("positions must hold at least one disc, got none")
        self.method = method
        self.time = 0.0
        self._positions = _array("positions", positions, (n, 2), "an (N, 2) array in m")
        self._velocities = _array("velocities", velocities, (n, 2), "an (N, 2) array in m/s, N as in positions")
        self._check_motion()
        self._radii = _array("radii", radii, (n,), "a number or an (N,) array in m")
        self._masses = _array("masses", masses, (n,), "a number or an (N,) array in kg")
        if not (self._masses > 0.0).all():
            raise ValueError(f"masses must be greater than 0 (inf is allowed), got {self._masses.min()}")
        post = (self._radii == 0.0) & np.isinf(self._masses)
        good = ((self._radii > 0.0) & np.isfinite(self._radii)) | post
        if not good.all():
            raise ValueError(
                f"radii must be finite and greater than 0 (0 for a disc of infinite mass), got {self._radii[~good][0]}"
            )
        self._surface = records(1, SURFACE)
        self._surface["disc_restitution"] = _share("restitution", restitution)
        self._surface["wall_restitution"] = _share("wall_restitution", wall_restitution)
        self._surface["wall_tangential"] = 1.0
        self.size = self._check_size(size)
        half_length, half_width = (math.inf, math.inf) if self.size is None else (0.5 * s for s in self.size)
        self._surface["half_length"] = half_length
        self._surface["half_width"] = half_width
        self._inverse_masses = 1.0 / self._masses
        self._check_places()
        self._hits = np.zeros(n, np.int32)
        self._buffer = records(max(64, 4 * n), CONTACT)
        self._driven = np.zeros((n, 2))
        self._near = make_near(n) if n >= FEWEST else None
        self._cluster = make_cluster(n, float(restitution), float(wall_restitution)) if n >= FEWEST else None

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) centres, m. The live array; assigning places the discs anew, with the constructor's checks."""
        return self._positions

    @positions.setter
    def positions(self, value: ArrayLike) -> None:
        before = self._positions
        self._positions = _array("positions", value, before.shape, "an (N, 2) array in m")
        try:
            self._check_motion()
            self._check_places()
        except ValueError:
            self._positions = before
            raise

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s. The live array; change or assign it to drive discs."""
        return self._velocities

    @velocities.setter
    def velocities(self, value: ArrayLike) -> None:
        before = self._velocities
        self._velocities = _array("velocities", value, before.shape, "an (N, 2) array in m/s")
        try:
            self._check_motion()
        except ValueError:
            self._velocities = before
            raise

    @property
    def radii(self) -> NDArray[np.float64]:
        """(N,) m; a copy."""
        return self._radii.copy()

    @property
    def masses(self) -> NDArray[np.float64]:
        """(N,) kg; a copy."""
        return self._masses.copy()

    @property
    def energy(self) -> float:
        """Kinetic energy of the discs of finite mass, J."""
        finite = np.isfinite(self._masses)
        return float(0.5 * np.sum(self._masses[finite] * np.sum(self._velocities[finite] ** 2, axis=1)))

    def step(self, dt: float) -> NDArray[np.void]:
        """Play `dt` seconds.

        Every contact of the step is collected, so memory grows with `dt`: on a table whose pucks lose nothing, play a
        long time in many steps.

        Args:
            dt: s, greater than 0.

        Returns:
            A structured array, one row a contact, in the order of time: `time` (s into this step), `a`, `b` (numbers
            of the discs, a < b; b is -1 for a wall), `x`, `y` (where they touch, m), `nx`, `ny` (unit normal from b
            to a) and `impulse` (N s, along the normal on a, against it on b).

        Raises:
            ValueError: `dt` is not a finite number greater than 0, or a position or velocity was set to NaN or
                infinity. Nothing has moved then.
        """
        if isinstance(dt, bool) or not isinstance(dt, Real) or not (0.0 < dt < math.inf):
            raise ValueError(f"dt must be a finite number of seconds greater than 0, got {_shown(dt)}")
        dt = float(dt)
        contacts = self._step_continuous(dt) if self.method == "continuous" else self._step_discrete(dt)
        self.time += dt
        return contacts

    def _discs(self) -> Discs:
        return Discs(self._positions, self._velocities, self._radii, self._inverse_masses, self._hits)

    def _step_continuous(self, dt: float) -> NDArray[np.void]:
        limit = int(min(TABLE_CONTACTS * max(1.0, dt), 2.0**30))
        discs, buffer, near, cluster = self._discs(), self._buffer, self._near, self._cluster
        kind = (near is None, cluster is None)
        play = _play_parts.get(kind)
        if play is None:
            arguments = (discs, self._driven, self._surface, -1.0, dt, limit, buffer, near, cluster)
            play = _play_parts[kind] = machine_code(play_part, *arguments)
        elapsed, count = play(discs, self._driven, self._surface, -1.0, dt, limit, buffer, near, cluster)
        if count < 0:
            self._check_motion()
        if count < len(buffer) and not elapsed < dt:
            return _recorded(buffer, count)
        parts = [_recorded(buffer, count)]
        while count == len(buffer) or elapsed < dt:
            buffer = records(2 * len(buffer), CONTACT)  # full: go on where it paused, with more room
            elapsed, count = play(discs, self._driven, self._surface, elapsed, dt, limit, buffer, near, cluster)
            parts.append(_recorded(buffer, count))
        return np.concatenate(parts)

    def _step_discrete(self, dt: float) -> NDArray[np.void]:
        self._check_motion()
        positions, velocities = self._positions.copy(), self._velocities.copy()
        buffer = self._buffer
        while True:
            count = advance_discrete(self._discs(), self._surface[0], dt, self.method == "kiss", buffer)
            if count <= len(buffer):
                contacts = _recorded(buffer, count)
                return contacts[np.argsort(contacts["time"], kind="stable")]
            buffer = records(count, CONTACT)  # too small: play the step again
            self._positions[:], self._velocities[:] = positions, velocities

    def _check_motion(self) -> None:
        for name, array in (("positions", self._positions), ("velocities", self._velocities)):
            if not np.isfinite(array).all():
                raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)][0]}")

    @staticmethod
    def _check_size(size: tuple[float, float] | None) -> tuple[float, float] | None:
        if size is None:
            return None
        length, width = _array("size", size, (2,), "(length, width) in m, or None")
        if not (0.0 < length < math.inf and 0.0 < width < math.inf):
            raise ValueError(f"size must be two finite lengths greater than 0, or None; got ({length}, {width})")
        return float(length), float(width)

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
