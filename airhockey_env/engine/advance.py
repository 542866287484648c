"""Simulate one table for one tick: find the next contact, move to it, resolve it, and repeat."""

from __future__ import annotations

from airhockey_env.compiled import compiled, inlined
from airhockey_env.engine.cluster import collapses, gather, settle
from airhockey_env.engine.impact import relieve, strike_disc, strike_edge
from airhockey_env.engine.kiss import at_edge, next_kiss
from airhockey_env.engine.motion import fly
from airhockey_env.engine.near import find_near, keep_near
from airhockey_env.engine.records import DISC, GOAL, NOTHING, WALL, Outcome


@compiled
def resolve(discs, kiss, surface, contacts, count, time):
    """Resolve a contact (not a goal). Returns the new number of contacts."""
    if kiss.kind == DISC:
        return strike_disc(discs, kiss.a, kiss.b, surface.disc_restitution, contacts, count, time)
    a = kiss.a
    x, y, nx, ny = at_edge(discs.position[a, 0], discs.position[a, 1], discs.radius[a], surface, kiss)
    discs.position[a, 0], discs.position[a, 1] = x, y
    return strike_edge(discs, a, nx, ny, surface, contacts, count, time)


@inlined
def advance(discs, surface, start, tick, limit, contacts, pause, near, cluster=None):
    """Simulate one table exactly, from `start` to `tick` seconds into a tick.

    Find the earliest kiss before moving, move everything to that time, resolve the contact, and repeat with the rest of
    the tick. Velocities are constant between contacts, so the only error is rounding.

    Args:
        discs: `Discs`; position and velocity change in place. `hits` must be zero at the start of a tick.
        surface: a `SURFACE` record.
        start, tick: s; `start` is 0 except when a paused tick continues.
        limit: contacts of one disc in one tick before it counts as squeezed: see `relieve`.
        contacts: `CONTACT` buffer, filled from its beginning in order of time.
        pause: return as soon as the buffer is full, instead of continuing without recording.
        near: None, or the `Near` pairs for the rest of the tick, for tables with many discs.
        cluster: None, or a `Cluster` to resolve collapsing clusters in one step; needs `near` and `pause`.

    Returns:
        Outcome. After a goal the disc's centre is on the goal line, and the rest of the tick is not simulated.
    """
    elapsed = start
    count = 0
    while True:
        kiss = next_kiss(discs, surface, tick - elapsed, near)
        fly(discs, kiss.time)
        if kiss.kind == NOTHING:
            return Outcome(tick, count, 0)
        elapsed += kiss.time
        if kiss.kind == GOAL:
            side = 1 if kiss.b == 0 else -1
            discs.position[kiss.a, 0] = side * surface.half_length
            return Outcome(elapsed, count, side)
        other = kiss.b if kiss.kind == DISC else -1
        if not relieve(discs, kiss.a, other, limit):
            settled = False
            if cluster is not None and collapses(cluster, kiss.a, other, elapsed, kiss.kind == WALL):
                touching = gather(cluster, discs, near, surface, kiss.a, other)
                if touching > contacts.shape[0] - count:
                    return Outcome(elapsed, count, 0)
                before = count
                count = settle(cluster, discs, touching, tick - elapsed, contacts, count, elapsed)
                find_near(near, discs, tick - elapsed)
                settled = count > before
            if not settled:
                count = resolve(discs, kiss, surface, contacts, count, elapsed)
                if near is not None:
                    keep_near(near, discs, kiss.a, other, tick - elapsed)
            if pause and count == contacts.shape[0]:
                return Outcome(elapsed, count, 0)
