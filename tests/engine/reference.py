"""An independent reference of the `continuous` method, with 60 digits.

It shares no code and no formula with the engine: the kiss is a root of the quadratic |d + v t|^2 = reach^2, and the
bounce is the one with masses (KISS.md's step 6) and not the one with inverse masses. Discs may have infinite mass.
"""

from __future__ import annotations

from dataclasses import dataclass

from mpmath import inf, mp, mpf, sqrt, workdps

DIGITS = 60
NEVER = inf


class TooManyContacts(Exception):
    """A squeeze without an end: nothing that a reference could settle."""


@dataclass
class Disc:
    x: mpf
    y: mpf
    vx: mpf
    vy: mpf
    radius: mpf
    mass: mpf

    @property
    def movable(self) -> bool:
        return self.mass != inf


def _kiss_time(a: Disc, b: Disc) -> mpf:
    dx, dy, vx, vy = b.x - a.x, b.y - a.y, b.vx - a.vx, b.vy - a.vy
    quadratic, half_linear = vx * vx + vy * vy, dx * vx + dy * vy
    constant = dx * dx + dy * dy - (a.radius + b.radius) ** 2
    resting = mpf(10) ** -(DIGITS // 2)
    if half_linear >= -resting:
        return NEVER
    discriminant = half_linear * half_linear - quadratic * constant
    if discriminant <= 0:
        return NEVER
    return max(mpf(0), constant / (-half_linear + sqrt(discriminant)))


def _wall_time(place: mpf, velocity: mpf, limit: mpf) -> mpf:
    if velocity == 0:
        return NEVER
    wall = limit if velocity > 0 else -limit
    return max(mpf(0), (wall - place) / velocity)


def _normal_after(mass, normal, other_mass, other_normal, restitution):
    """KISS.md, step 6, and its limits."""
    if mass == inf:
        return normal
    if other_mass == inf:
        return -restitution * normal + (1 + restitution) * other_normal
    moved = (mass - restitution * other_mass) * normal + (1 + restitution) * other_mass * other_normal
    return moved / (mass + other_mass)


def _bounce_discs(a: Disc, b: Disc, restitution: mpf) -> mpf:
    """The impulse."""
    nx, ny = a.x - b.x, a.y - b.y
    length = sqrt(nx * nx + ny * ny)
    nx, ny = nx / length, ny / length
    before_a, before_b = a.vx * nx + a.vy * ny, b.vx * nx + b.vy * ny
    after_a = _normal_after(a.mass, before_a, b.mass, before_b, restitution)
    after_b = _normal_after(b.mass, before_b, a.mass, before_a, restitution)
    for disc, change in ((a, after_a - before_a), (b, after_b - before_b)):
        disc.vx += change * nx
        disc.vy += change * ny
    return a.mass * (after_a - before_a) if a.movable else b.mass * (before_b - after_b)


class Reference:
    """A table of exact discs. Arguments as those of `AirTable`; `nudge` is added to every starting coordinate."""

    def __init__(self, scene, nudge=0.0):
        with workdps(DIGITS):
            signs = [1, -1, -1, 1, 1, 1, -1]
            self.discs = []
            for k, (place, velocity) in enumerate(zip(scene.positions, scene.velocities, strict=True)):
                shift = [mpf(nudge) * signs[(4 * k + c) % 7] for c in range(4)]
                self.discs.append(
                    Disc(
                        mpf(float(place[0])) + shift[0],
                        mpf(float(place[1])) + shift[1],
                        mpf(float(velocity[0])) + shift[2],
                        mpf(float(velocity[1])) + shift[3],
                        mpf(float(scene.radii[k])),
                        mpf(float(scene.masses[k])),
                    )
                )
            self.size = None if scene.size is None else tuple(mpf(s) / 2 for s in scene.size)
            self.restitution = mpf(scene.restitution)
            self.wall_restitution = mpf(scene.wall_restitution)

    def _next(self):
        """(time, a, b, axis) of the earliest event; b is -1 for a wall."""
        best = (NEVER, -1, -1, 0)
        for a, disc in enumerate(self.discs):
            for b in range(a + 1, len(self.discs)):
                if disc.movable or self.discs[b].movable:
                    best = min(best, (_kiss_time(disc, self.discs[b]), a, b, 0), key=lambda event: event[0])
            if self.size is not None and disc.movable:
                for axis, (place, velocity) in enumerate(((disc.x, disc.vx), (disc.y, disc.vy))):
                    time = _wall_time(place, velocity, self.size[axis] - disc.radius)
                    best = min(best, (time, a, -1, axis), key=lambda event: event[0])
        return best

    def _move(self, time):
        for disc in self.discs:
            disc.x += disc.vx * time
            disc.y += disc.vy * time

    def step(self, dt: float, most: int = 200) -> list[tuple[float, int, int, float]]:
        """Play `dt` seconds; return (time, a, b, impulse) of every contact."""
        contacts = []
        with workdps(DIGITS):
            elapsed, dt = mpf(0), mpf(dt)
            while True:
                time, a, b, axis = self._next()
                if elapsed + time > dt:
                    self._move(dt - elapsed)
                    return contacts
                self._move(time)
                elapsed += time
                disc = self.discs[a]
                if b >= 0:
                    impulse = _bounce_discs(disc, self.discs[b], self.restitution)
                else:
                    name = "vy" if axis else "vx"
                    before = getattr(disc, name)
                    setattr(disc, name, -self.wall_restitution * before)
                    impulse = disc.mass * abs(getattr(disc, name) - before)
                contacts.append((float(elapsed), a, b, float(impulse)))
                if len(contacts) > most:
                    raise TooManyContacts

    def state(self):
        """All coordinates and velocity components, as numbers of 60 digits."""
        return [number for disc in self.discs for number in (disc.x, disc.y, disc.vx, disc.vy)]

    def growth(self, nudged: Reference, nudge: float) -> float:
        """By how much a small error at the start has grown, as seen from a twin that started with `nudge`."""
        with mp.workdps(DIGITS):
            return float(max(abs(p - q) for p, q in zip(self.state(), nudged.state(), strict=True)) / mpf(nudge))
