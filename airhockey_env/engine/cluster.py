"""Inelastic collapse: resolve in one step a cluster of discs that would have countless lossy contacts.

Packed discs with a restitution below 1 have ever more contacts in ever less time. Each contact partly undoes the effect
of the previous one, as in the Gauss-Seidel method for a system of equations, and after hundreds of thousands of
contacts all touching discs move on together. Their final velocities can be described directly: of all velocities for
which no two touching discs approach, they are the closest to the present ones (in kinetic energy). The impulses that
lead there act along the lines of centres and only push, so momentum and angular momentum are conserved. Since zero is
one such set of velocities, the kinetic energy never increases. Discs that move on straight lines and do not approach at
the start never do, so a resolved pair has no further contact until something else touches one of its discs.

The impulses are the solution of a quadratic program over non-negative numbers, which MPRGP solves (Dostál and Schöberl
2005): conjugate gradients among the contacts that push, and projected gradient steps that may end or begin a push, each
of which decreases the energy. Each disc's mass is split among its contacts, which bounds the spectrum by 1 (Tonge,
Benevolenski and Voroshilov 2012).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled
from airhockey_env.engine.impact import record, stop
from airhockey_env.engine.tolerances import (
    COLLAPSE_CONTACTS,
    COLLAPSE_SHARE,
    COLLAPSE_TIME,
    SKIN,
    TABLE_CONTACTS,
    TOUCH_SPEED,
)

PAIRS = 8
"""Space for touching pairs, per disc. In the plane there are hardly more than 3, plus 2 walls."""

ITERATIONS = 4000
"""Iterations after which a cluster counts as squeezed: no velocities are found for which nothing approaches."""

STEP = 1.9
"""Length of a gradient step; must be below 2 divided by the largest eigenvalue, which is at most 1."""

SINGULAR = 1e-14
"""A direction whose curvature, relative to its squared length, is not above this counts as singular: nothing yields."""


class Cluster(NamedTuple):
    """The contact history needed to detect a collapse, and work arrays to resolve it."""

    patience: NDArray[np.float64]  # (2,) contacts in a row that do not count as a collapse yet: with discs, with walls
    last: NDArray[np.float64]  # (n,) s, time of the disc's last contact in this step
    quick: NDArray[np.int64]  # (n,) contacts in a row, each within COLLAPSE_TIME of the one before
    link: NDArray[np.int64]  # (n,) union-find: a disc of the same cluster, or itself
    degree: NDArray[np.float64]  # (n,) contacts that share the disc's mass
    moved: NDArray[np.float64]  # (n, 2) m/s, velocities with the impulses so far, or changes by a direction
    a: NDArray[np.int64]  # (m,) the contacts: disc,
    b: NDArray[np.int64]  # (m,) other disc, or -1 for a wall,
    normal: NDArray[np.float64]  # (m, 2) unit, from b to a,
    gap: NDArray[np.float64]  # (m,) m,
    scale: NDArray[np.float64]  # (m,) sqrt(kg), impulses are this times
    push: NDArray[np.float64]  # (m,) sqrt(J), the unknowns,
    slope: NDArray[np.float64]  # (m,) sqrt(J), gradient of the energy: scale times the separating speed
    direction: NDArray[np.float64]  # (m,)
    answer: NDArray[np.float64]  # (m,) what the direction changes in the slope


def patience(restitution: float) -> float:
    """Number of contacts in a row that do not count as a collapse yet; inf if hardly any energy is lost."""
    contacts, share = COLLAPSE_CONTACTS, 1.0
    while share > COLLAPSE_SHARE:
        contacts += 1
        share *= restitution
        if contacts > TABLE_CONTACTS:
            return math.inf
    return float(contacts)


def make_cluster(n: int, restitution: float, wall_restitution: float) -> Cluster:
    """Allocate a `Cluster` for a table of n discs."""
    m = n * PAIRS
    with_discs = patience(restitution)
    # A disc that others press against an elastic wall loses energy only at every other contact.
    with_walls = min(patience(wall_restitution), 2.0 * with_discs)
    return Cluster(
        patience=np.array([with_discs, with_walls]),
        last=np.zeros(n),
        quick=np.zeros(n, np.int64),
        link=np.zeros(n, np.int64),
        degree=np.zeros(n),
        moved=np.zeros((n, 2)),
        a=np.zeros(m, np.int64),
        b=np.zeros(m, np.int64),
        normal=np.zeros((m, 2)),
        gap=np.zeros(m),
        scale=np.zeros(m),
        push=np.zeros(m),
        slope=np.zeros(m),
        direction=np.zeros(m),
        answer=np.zeros(m),
    )


@compiled
def forget(cluster):
    """Reset the contact history at the start of a step."""
    for a in range(cluster.last.shape[0]):
        cluster.last[a] = -math.inf
        cluster.quick[a] = 0


@compiled
def collapses(cluster, a, b, time, by_wall):
    """Count a contact of disc a (with disc b, or a wall if b < 0) at `time` s; return whether it is in a collapse."""
    most = 0
    for disc in (a, b):
        if disc >= 0:
            cluster.quick[disc] = cluster.quick[disc] + 1 if time - cluster.last[disc] <= COLLAPSE_TIME else 1
            cluster.last[disc] = time
            most = max(most, cluster.quick[disc])
    return most > cluster.patience[1 if by_wall else 0]


@compiled
def _root(link, a):
    while link[a] != a:
        link[a] = link[link[a]]
        a = link[a]
    return a


@compiled
def _note(cluster, m, a, b, nx, ny, gap):
    """Add a contact, if there is space; return the number of contacts."""
    if m == cluster.a.shape[0]:
        return m
    cluster.a[m], cluster.b[m] = a, b
    cluster.normal[m, 0], cluster.normal[m, 1] = nx, ny
    cluster.gap[m] = max(0.0, gap)
    return m + 1


@compiled
def gather(cluster, discs, near, surface, a, b):
    """Collect the contacts of the cluster of discs a and b (or a wall if b < 0): all discs connected by touching ones.

    Walls and discs of infinite mass belong to the cluster but do not connect other discs. Returns the number of
    contacts.
    """
    position, radius, inverse_mass, link = discs.position, discs.radius, discs.inverse_mass, cluster.link
    n = position.shape[0]
    for c in range(n):
        link[c] = c
    whole = near.whole[0]
    m = 0
    for c in range(n):
        first, last = (c + 1, n) if whole else (near.start[c], near.start[c + 1])
        for k in range(first, last):
            d = k if whole else near.partner[k]
            dx, dy = position[c, 0] - position[d, 0], position[c, 1] - position[d, 1]
            reach = radius[c] + radius[d]
            most = reach * (1.0 + SKIN)
            distance2 = dx * dx + dy * dy
            if distance2 > most * most or inverse_mass[c] + inverse_mass[d] == 0.0:
                continue
            distance = math.sqrt(distance2)
            m = _note(cluster, m, c, d, dx / distance, dy / distance, distance - reach)
            if inverse_mass[c] > 0.0 and inverse_mass[d] > 0.0:
                one, other = _root(link, c), _root(link, d)
                link[max(one, other)] = min(one, other)
        if inverse_mass[c] > 0.0 and cluster.quick[c] > cluster.patience[1]:
            for axis in range(2):
                half = surface.half_length if axis == 0 else surface.half_width
                gap = half - radius[c] - abs(position[c, axis])
                if gap <= SKIN * radius[c]:
                    inwards = -1.0 if position[c, axis] > 0.0 else 1.0
                    m = _note(cluster, m, c, -1, inwards if axis == 0 else 0.0, inwards if axis == 1 else 0.0, gap)
    root = _root(link, a if inverse_mass[a] > 0.0 else b)
    kept = 0
    for k in range(m):  # keep the contacts of this cluster
        c, d = cluster.a[k], cluster.b[k]
        inside = c if inverse_mass[c] > 0.0 else d
        if _root(link, inside) == root:
            kept = _note(cluster, kept, c, d, cluster.normal[k, 0], cluster.normal[k, 1], cluster.gap[k])
    return kept


@compiled
def _weigh(cluster, discs, m):
    """Set the scale of every contact, and all pushes to 0."""
    inverse_mass, degree = discs.inverse_mass, cluster.degree
    for k in range(m):
        for disc in (cluster.a[k], cluster.b[k]):
            if disc >= 0:
                degree[disc] = 0.0
    for k in range(m):
        for disc in (cluster.a[k], cluster.b[k]):
            if disc >= 0:
                degree[disc] += 1.0
    for k in range(m):
        a, b = cluster.a[k], cluster.b[k]
        split = degree[a] * inverse_mass[a]
        if b >= 0:
            split += degree[b] * inverse_mass[b]
        cluster.scale[k] = 1.0 / math.sqrt(split)
        cluster.push[k] = 0.0


@compiled
def _apply(cluster, discs, m, push, still, into):
    """Write scale * separating speed of every contact under the given pushes into `into`.

    Args:
        still: start from rest instead of from the discs' velocities.
    """
    moved, inverse_mass = cluster.moved, discs.inverse_mass
    for k in range(m):
        for disc in (cluster.a[k], cluster.b[k]):
            if disc >= 0:
                moved[disc, 0] = 0.0 if still else discs.velocity[disc, 0]
                moved[disc, 1] = 0.0 if still else discs.velocity[disc, 1]
    for k in range(m):
        if push[k] != 0.0:
            a, b = cluster.a[k], cluster.b[k]
            impulse = push[k] * cluster.scale[k]
            px, py = impulse * cluster.normal[k, 0], impulse * cluster.normal[k, 1]
            moved[a, 0] += inverse_mass[a] * px
            moved[a, 1] += inverse_mass[a] * py
            if b >= 0:
                moved[b, 0] -= inverse_mass[b] * px
                moved[b, 1] -= inverse_mass[b] * py
    for k in range(m):
        a, b = cluster.a[k], cluster.b[k]
        vx, vy = moved[a, 0], moved[a, 1]
        if b >= 0:
            vx -= moved[b, 0]
            vy -= moved[b, 1]
        into[k] = cluster.scale[k] * (vx * cluster.normal[k, 0] + vy * cluster.normal[k, 1])


@compiled
def _settled(cluster, m, rest):
    """Whether no contact closes within the remaining `rest` seconds of the step."""
    for k in range(m):
        parting = cluster.slope[k] / cluster.scale[k]
        if not (parting >= -0.25 * TOUCH_SPEED or cluster.gap[k] + parting * rest > 0.0):
            return False
    return True


@compiled
def _begin(cluster, m):
    """Restart conjugate gradients with the gradient restricted to the contacts that push."""
    for k in range(m):
        cluster.direction[k] = cluster.slope[k] if cluster.push[k] > 0.0 else 0.0


@compiled
def _solve(cluster, discs, m, rest):
    """Find the pushes and the velocities that they lead to. Returns False if there is no solution."""
    push, slope, direction, answer = cluster.push, cluster.slope, cluster.direction, cluster.answer
    _weigh(cluster, discs, m)
    _apply(cluster, discs, m, push, False, slope)
    _begin(cluster, m)
    for _ in range(ITERATIONS):
        if _settled(cluster, m, rest):
            _apply(cluster, discs, m, push, False, slope)  # without the accumulated rounding errors
            if _settled(cluster, m, rest):
                return True
            _begin(cluster, m)
        idle2, free = 0.0, 0.0  # squared gradients: of contacts that should begin to push, and of those that push
        for k in range(m):
            if push[k] > 0.0:
                free += min(push[k] / STEP, slope[k]) * slope[k]
            elif slope[k] < 0.0:
                idle2 += slope[k] * slope[k]
        proportional = idle2 <= free
        if not proportional:
            for k in range(m):
                direction[k] = min(slope[k], 0.0) if push[k] <= 0.0 else 0.0
        _apply(cluster, discs, m, direction, True, answer)
        along, curvature, size = 0.0, 0.0, 0.0
        for k in range(m):
            along += slope[k] * direction[k]
            curvature += direction[k] * answer[k]
            size += direction[k] * direction[k]
        if not curvature > SINGULAR * size:
            return False
        length = along / curvature
        most = math.inf
        if proportional:
            for k in range(m):
                if direction[k] > 0.0:
                    most = min(most, push[k] / direction[k])
        if length <= most:
            for k in range(m):
                push[k] = max(0.0, push[k] - length * direction[k])
                slope[k] -= length * answer[k]
            if proportional:
                conjugate = 0.0
                for k in range(m):
                    if push[k] > 0.0:
                        conjugate += slope[k] * answer[k]
                conjugate /= curvature
                for k in range(m):
                    direction[k] = (slope[k] if push[k] > 0.0 else 0.0) - conjugate * direction[k]
            else:
                _begin(cluster, m)
        else:  # go until the first push ends, then take a projected gradient step, which may end more of them
            for k in range(m):
                push[k] = max(0.0, push[k] - most * direction[k])
                slope[k] -= most * answer[k]
            for k in range(m):
                if push[k] > 0.0:
                    push[k] = max(0.0, push[k] - STEP * slope[k])
            _apply(cluster, discs, m, push, False, slope)
            _begin(cluster, m)
    return False


@compiled
def _halt(cluster, discs, m):
    """Give a cluster the velocity of its centre of mass, or stop it if a wall or an immovable disc holds it."""
    mass, px, py = 0.0, 0.0, 0.0
    held = False
    for k in range(m):
        for disc in (cluster.a[k], cluster.b[k]):
            if disc < 0 or discs.inverse_mass[disc] == 0.0:
                held = True
            elif cluster.degree[disc] > 0.0:  # not yet counted
                cluster.degree[disc] = 0.0
                mass += 1.0 / discs.inverse_mass[disc]
                px += discs.velocity[disc, 0] / discs.inverse_mass[disc]
                py += discs.velocity[disc, 1] / discs.inverse_mass[disc]
    for k in range(m):
        for disc in (cluster.a[k], cluster.b[k]):
            if disc >= 0:
                discs.velocity[disc, 0] = 0.0 if held else px / mass
                discs.velocity[disc, 1] = 0.0 if held else py / mass


@compiled
def settle(cluster, discs, m, rest, contacts, count, time):
    """Resolve the m gathered contacts, with `rest` seconds left of the step. Returns the new number of contacts.

    If no velocities exist for which nothing approaches, driven discs are squeezing the cluster, and they give way. If
    there is still no solution (because of rounding, at extreme speeds or mass ratios), the cluster moves on as one
    body.
    """
    solved = _solve(cluster, discs, m, rest)
    if not solved:
        driven = False
        for k in range(m):
            for disc in (cluster.a[k], cluster.b[k]):
                if disc >= 0 and discs.inverse_mass[disc] == 0.0:
                    driven = True
                    stop(discs, disc)
        solved = driven and _solve(cluster, discs, m, rest)
    if not solved:
        _halt(cluster, discs, m)
        return count
    for k in range(m):
        impulse = cluster.push[k] * cluster.scale[k]
        a, b = cluster.a[k], cluster.b[k]
        for disc in (a, b):
            if disc >= 0:
                discs.velocity[disc, 0], discs.velocity[disc, 1] = cluster.moved[disc, 0], cluster.moved[disc, 1]
                cluster.quick[disc] += 1
                cluster.last[disc] = time
        if impulse > 0.0:
            nx, ny = cluster.normal[k, 0], cluster.normal[k, 1]
            x = discs.position[a, 0] - discs.radius[a] * nx
            y = discs.position[a, 1] - discs.radius[a] * ny
            record(contacts, count, time, a, b, x, y, nx, ny, impulse)
            count += 1
    return count
