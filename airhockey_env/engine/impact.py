"""The effect of a contact: the impulse along the normal, and the treatment of squeezed discs."""

from __future__ import annotations

import math

from airhockey_env.compiled import compiled


@compiled
def record(contacts, count, time, a, b, x, y, nx, ny, impulse):
    """Write contact number `count` into the buffer, if there is space."""
    if count < contacts.shape[0]:
        contact = contacts[count]
        contact.time = time
        contact.a = a
        contact.b = b
        contact.x = x
        contact.y = y
        contact.nx = nx
        contact.ny = ny
        contact.impulse = impulse


@compiled
def exchange(discs, a, b, nx, ny, approach, restitution):
    """Exchange momentum between discs a and b along the unit normal (from b to a); return the impulse, N s.

    `approach` is the velocity of a relative to b along the normal, m/s, negative. Inverse masses make the textbook
    formula work for immovable discs too: they keep their velocity. Tangential velocities do not change.
    """
    impulse = -(1.0 + restitution) * approach / (discs.inverse_mass[a] + discs.inverse_mass[b])
    discs.velocity[a, 0] += impulse * discs.inverse_mass[a] * nx
    discs.velocity[a, 1] += impulse * discs.inverse_mass[a] * ny
    discs.velocity[b, 0] -= impulse * discs.inverse_mass[b] * nx
    discs.velocity[b, 1] -= impulse * discs.inverse_mass[b] * ny
    return impulse


@compiled
def strike_disc(discs, a, b, restitution, contacts, count, time):
    """Resolve a contact of two discs. Returns the new number of contacts."""
    position, velocity = discs.position, discs.velocity
    dx = position[a, 0] - position[b, 0]
    dy = position[a, 1] - position[b, 1]
    distance = math.sqrt(dx * dx + dy * dy)
    vx = velocity[a, 0] - velocity[b, 0]
    vy = velocity[a, 1] - velocity[b, 1]
    approach = dx * vx + dy * vy
    if not approach < 0.0:  # they only graze each other, by rounding: no normal velocity, nothing changes
        return count
    nx, ny = dx / distance, dy / distance
    impulse = exchange(discs, a, b, nx, ny, approach / distance, restitution)
    x = position[b, 0] + discs.radius[b] * nx
    y = position[b, 1] + discs.radius[b] * ny
    record(contacts, count, time, a, b, x, y, nx, ny, impulse)
    return count + 1


@compiled
def strike_edge(discs, a, nx, ny, surface, contacts, count, time):
    """Resolve a contact of a disc with a wall or post. Returns the new number of contacts."""
    vx, vy = discs.velocity[a, 0], discs.velocity[a, 1]
    normal = vx * nx + vy * ny
    if not normal < 0.0:
        return count
    tangent = vy * nx - vx * ny
    normal_after = -surface.wall_restitution * normal
    tangent_after = surface.wall_tangential * tangent
    discs.velocity[a, 0] = normal_after * nx - tangent_after * ny
    discs.velocity[a, 1] = normal_after * ny + tangent_after * nx
    x = discs.position[a, 0] - discs.radius[a] * nx
    y = discs.position[a, 1] - discs.radius[a] * ny
    impulse = (normal_after - normal) / discs.inverse_mass[a]
    record(contacts, count, time, a, -1, x, y, nx, ny, impulse)
    return count + 1


@compiled
def stop(discs, a):
    """Set the velocity of disc a to 0."""
    discs.velocity[a, 0] = 0.0
    discs.velocity[a, 1] = 0.0


@compiled
def relieve(discs, a, b, limit):
    """Count a contact of disc a (with disc b, or an edge if b < 0), and stop discs that have too many.

    A puck that is squeezed between a moving paddle and a wall, or discs that lose energy while they rattle in a
    shrinking gap, have infinitely many contacts in a finite time. When a disc of finite mass has had more than `limit`
    contacts in a tick, the driven disc that it touches therefore gives way: it stops for the rest of the tick. Beyond
    2 * `limit` contacts both discs are stopped and do not bounce. This is the only case in which momentum is lost
    between discs of finite mass.

    Every bounce increases a bounded count, and a stopped disc can only be moved again by a bounce, so a tick has at
    most about 5 * n * `limit` contacts.

    Returns:
        True if the discs were stopped and the contact must not be resolved.
    """
    count = 0
    if discs.inverse_mass[a] > 0.0:
        discs.hits[a] += 1
        count = discs.hits[a]
    if b >= 0 and discs.inverse_mass[b] > 0.0:
        discs.hits[b] += 1
        count = max(count, discs.hits[b])
    if count <= limit:
        return False
    if discs.inverse_mass[a] == 0.0:
        stop(discs, a)
    if b >= 0 and discs.inverse_mass[b] == 0.0:
        stop(discs, b)
    if count <= 2 * limit:
        return False
    stop(discs, a)
    if b >= 0:
        stop(discs, b)
    return True
