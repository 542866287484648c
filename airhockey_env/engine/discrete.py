"""The methods "kiss" and "overlap", which only detect contacts at the end of a tick. For study and comparison.

Both move everything for the whole tick and then resolve the overlapping pairs one by one, in the order of their
numbers. `"kiss"` goes back to the kiss point along the incoming velocities, so its normal is exact. `"overlap"` takes
the normal from the overlapping positions; its error grows with the speed of the discs and with the tick. Neither
detects discs that passed through each other within the tick.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import compiled
from airhockey_env.engine.impact import exchange, record, strike_disc, strike_edge
from airhockey_env.engine.motion import fly


@compiled
def _shift(discs, a, time):
    discs.position[a, 0] += discs.velocity[a, 0] * time
    discs.position[a, 1] += discs.velocity[a, 1] * time


@compiled
def _penetration_time(dx, dy, vx, vy, reach, tick):
    """Time since two overlapping, approaching discs touched, s; at most the tick.

    (dx, dy) and (vx, vy) are A's centre and velocity relative to B at the end of the tick. The hypotenuse of the large
    triangle runs from the start of the A' path to B. The leg that it shares with the small triangle and the sum of the
    radii give the small triangle's top leg, and with it the distance from the kiss to the end of the path.
    docs/kiss_study.md has a picture.
    """
    pathx, pathy = vx * tick, vy * tick  # the A' path
    length = math.sqrt(pathx * pathx + pathy * pathy)
    ux, uy = pathx / length, pathy / length
    to_b_x, to_b_y = pathx - dx, pathy - dy  # from A1 to B1
    projection = to_b_x * ux + to_b_y * uy
    shared_x, shared_y = to_b_x - projection * ux, to_b_y - projection * uy
    top_leg = math.sqrt(max(0.0, reach * reach - (shared_x * shared_x + shared_y * shared_y)))
    travel = length - (projection - top_leg)
    # Use the larger component, so that the denominator is not close to zero.
    time = travel * ux / vx if abs(vx) >= abs(vy) else travel * uy / vy
    return min(max(0.0, time), tick)


@compiled
def _mend_pair_by_kiss(discs, a, b, surface, tick, contacts, count):
    dx = discs.position[a, 0] - discs.position[b, 0]
    dy = discs.position[a, 1] - discs.position[b, 1]
    vx = discs.velocity[a, 0] - discs.velocity[b, 0]
    vy = discs.velocity[a, 1] - discs.velocity[b, 1]
    penetration = _penetration_time(dx, dy, vx, vy, discs.radius[a] + discs.radius[b], tick)
    _shift(discs, a, -penetration)
    _shift(discs, b, -penetration)
    count = strike_disc(discs, a, b, surface.disc_restitution, contacts, count, tick - penetration)
    _shift(discs, a, penetration)
    _shift(discs, b, penetration)
    return count


@compiled
def _mend_pair_by_overlap(discs, a, b, surface, tick, contacts, count):
    dx = discs.position[a, 0] - discs.position[b, 0]
    dy = discs.position[a, 1] - discs.position[b, 1]
    distance = math.sqrt(dx * dx + dy * dy)
    if distance == 0.0:  # one on top of the other: no normal can be read from the positions
        return count
    nx, ny = dx / distance, dy / distance
    vx, vy = discs.velocity[a, 0] - discs.velocity[b, 0], discs.velocity[a, 1] - discs.velocity[b, 1]
    approach = vx * nx + vy * ny
    penetration = min((distance - discs.radius[a] - discs.radius[b]) / approach, tick)
    before_a = discs.velocity[a, 0] * nx + discs.velocity[a, 1] * ny
    before_b = discs.velocity[b, 0] * nx + discs.velocity[b, 1] * ny
    impulse = exchange(discs, a, b, nx, ny, approach, surface.disc_restitution)
    push_a = (discs.velocity[a, 0] * nx + discs.velocity[a, 1] * ny - before_a) * penetration
    push_b = (discs.velocity[b, 0] * nx + discs.velocity[b, 1] * ny - before_b) * penetration
    discs.position[a, 0] += push_a * nx
    discs.position[a, 1] += push_a * ny
    discs.position[b, 0] += push_b * nx
    discs.position[b, 1] += push_b * ny
    x = discs.position[b, 0] + discs.radius[b] * nx
    y = discs.position[b, 1] + discs.radius[b] * ny
    record(contacts, count, tick - penetration, a, b, x, y, nx, ny, impulse)
    return count + 1


@compiled
def _mend_wall(discs, a, axis, surface, tick, contacts, count):
    half = surface.half_length if axis == 0 else surface.half_width
    sign = 1.0 if discs.position[a, axis] > 0.0 else -1.0
    depth = sign * discs.position[a, axis] - (half - discs.radius[a])
    into = sign * discs.velocity[a, axis]
    if depth <= 0.0 or into <= 0.0:
        return count
    penetration = min(depth / into, tick)
    _shift(discs, a, -penetration)
    nx = -sign if axis == 0 else 0.0
    ny = -sign if axis == 1 else 0.0
    count = strike_edge(discs, a, nx, ny, surface, contacts, count, tick - penetration)
    _shift(discs, a, penetration)
    return count


@compiled
def advance_discrete(discs, surface, tick, by_kiss, contacts):
    """Simulate one table for a tick of `tick` seconds with `"kiss"` (or else `"overlap"`); return the contact count.

    The buffer receives the first contacts in the order in which they were resolved, with the times computed for them.
    """
    fly(discs, tick)
    count = 0
    n = discs.position.shape[0]
    for a in range(n):
        for b in range(a + 1, n):
            if discs.inverse_mass[a] + discs.inverse_mass[b] == 0.0:
                continue
            dx = discs.position[a, 0] - discs.position[b, 0]
            dy = discs.position[a, 1] - discs.position[b, 1]
            reach = discs.radius[a] + discs.radius[b]
            vx = discs.velocity[a, 0] - discs.velocity[b, 0]
            vy = discs.velocity[a, 1] - discs.velocity[b, 1]
            if dx * dx + dy * dy < reach * reach and dx * vx + dy * vy < 0.0:
                if by_kiss:
                    count = _mend_pair_by_kiss(discs, a, b, surface, tick, contacts, count)
                else:
                    count = _mend_pair_by_overlap(discs, a, b, surface, tick, contacts, count)
    for a in range(n):
        if discs.inverse_mass[a] > 0.0:
            count = _mend_wall(discs, a, 0, surface, tick, contacts, count)
            count = _mend_wall(discs, a, 1, surface, tick, contacts, count)
    return count
