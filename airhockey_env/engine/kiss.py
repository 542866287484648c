"""Collision detection: where and when the next kiss on a table happens.

Two discs kiss when they touch without overlapping. Seen from B, disc A travels along a straight line, the A' path. The
perpendicular from B's centre to that path and the sum of the radii, which is the hypotenuse at the kiss, determine the
position of the kiss on the path, and with the relative velocity its time. A wall is a line that the centre may not
cross, a post is a disc of radius 0, and the goal line between the posts is a sensor: crossing it is reported and ends
the tick.

Simultaneous kisses are taken in a fixed order, so that runs are reproducible to the bit: in the order of the disc
numbers, and for each disc first its pairs with higher-numbered discs (if two such pairs share a disc, the one that
approaches faster), then the end wall, the side wall, the posts (the one at +y first), and the goal line.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import compiled, inlined
from airhockey_env.engine.records import DISC, GOAL, NOTHING, POST, WALL, Kiss
from airhockey_env.engine.tolerances import TOUCH_GAP, TOUCH_SPEED

END_WALL, SIDE_WALL = 0, 2  # numbers of walls: at +x, -x, +y, -y


@inlined
def kiss_time(dx, dy, vx, vy, reach):
    """Time until two discs kiss, s, or inf if they never do.

    Discs that touch (or overlap by rounding) and approach each other kiss at time 0. Discs that separate, do not move,
    miss each other or merely graze do not kiss.

    Args:
        dx, dy: centre of A relative to B, m.
        vx, vy: velocity of A relative to B, m/s.
        reach: sum of the radii, m.
    """
    approach = dx * vx + dy * vy  # distance times closing speed; negative when approaching
    if not approach < 0.0:
        return math.inf
    speed2 = vx * vx + vy * vy
    shared_leg = dx * vy - dy * vx  # times speed
    top_leg2 = reach * reach * speed2 - shared_leg * shared_leg  # squared, times speed squared
    if not top_leg2 > 0.0:
        return math.inf
    distance2, reach2 = dx * dx + dy * dy, reach * reach
    if distance2 <= reach2 * (1.0 + TOUCH_GAP):
        if approach >= -TOUCH_SPEED * reach:  # at rest on each other
            return math.inf
        if distance2 <= reach2:
            return 0.0
    return max(0.0, (-approach - math.sqrt(top_leg2)) / speed2)


@compiled
def _share_a_disc(a, b, best):
    """Whether the pairs (a, b) and `best` have a disc in common, given that a < b and best.a <= a."""
    return best.a == a or best.b == a or best.b == b


@compiled
def _faster(discs, a, b, best):
    """Whether discs a and b approach each other faster than the pair `best`."""
    position, velocity = discs.position, discs.velocity
    dx, dy = position[a, 0] - position[b, 0], position[a, 1] - position[b, 1]
    vx, vy = velocity[a, 0] - velocity[b, 0], velocity[a, 1] - velocity[b, 1]
    ox, oy = position[best.a, 0] - position[best.b, 0], position[best.a, 1] - position[best.b, 1]
    ux, uy = velocity[best.a, 0] - velocity[best.b, 0], velocity[best.a, 1] - velocity[best.b, 1]
    return dx * vx + dy * vy < ox * ux + oy * uy


@inlined
def reaches_edge(x, y, vx, vy, radius, surface, time):
    """Whether a disc starts beyond where it would touch an edge, or is there after `time` seconds.

    Most discs are far from all edges; only these have to be asked more closely.
    """
    reach_x, reach_y = surface.half_length - radius, surface.half_width - radius
    return abs(x) > reach_x or abs(x + vx * time) > reach_x or abs(y + vy * time) > reach_y


@compiled
def _earlier_edge(x, y, vx, vy, radius, surface, a, best):
    """Return the earlier of `best` and the first kiss of disc a with a wall, a post or a goal line."""
    end = 1.0 if vx > 0.0 else -1.0
    limit = surface.half_length - radius
    if end * (x + vx * best.time) > limit and vx != 0.0:
        time = max(0.0, (limit - end * x) / (end * vx))
        if time < best.time and abs(y + vy * time) >= surface.half_goal:
            best = Kiss(time, WALL, a, END_WALL if end > 0.0 else END_WALL + 1)

    side = 1.0 if vy > 0.0 else -1.0
    limit = surface.half_width - radius
    if side * (y + vy * best.time) > limit and vy != 0.0:
        time = max(0.0, (limit - side * y) / (side * vy))
        if time < best.time:
            best = Kiss(time, WALL, a, SIDE_WALL if side > 0.0 else SIDE_WALL + 1)

    if surface.half_goal > 0.0:
        for number in range(2):
            end = 1.0 if number == 0 else -1.0
            if max(end * x, end * (x + vx * best.time)) <= surface.half_length - radius:
                continue
            for post in range(2):
                side = 1.0 if post == 0 else -1.0
                time = kiss_time(x - end * surface.half_length, y - side * surface.half_goal, vx, vy, radius)
                if time < best.time:
                    best = Kiss(time, POST, a, 2 * number + post)
            if end * vx > 0.0:
                time = max(0.0, (surface.half_length - end * x) / (end * vx))
                if time < best.time:
                    best = Kiss(time, GOAL, a, number)
    return best


@inlined
def at_edge(x, y, radius, surface, kiss):
    """Where a disc at (x, y) kisses the wall or post of `kiss`, which `_earlier_edge` numbered, and the unit normal.

    Returns (x, y, nx, ny). On a wall the disc is put exactly there: rounding must not add up.
    """
    first = 1.0 if kiss.b % 2 == 0 else -1.0
    if kiss.kind == POST:
        end, side = 1.0 if kiss.b // 2 == 0 else -1.0, first
        dx, dy = x - end * surface.half_length, y - side * surface.half_goal
        distance = math.sqrt(dx * dx + dy * dy)
        return x, y, dx / distance, dy / distance
    if kiss.b == SIDE_WALL or kiss.b == SIDE_WALL + 1:
        return x, first * (surface.half_width - radius), 0.0, -first
    return first * (surface.half_length - radius), y, -first, 0.0


@inlined
def _earlier_pair(discs, a, b, best):
    """Return the earlier of `best` and the kiss of discs a and b."""
    position, velocity = discs.position, discs.velocity
    time = kiss_time(
        position[a, 0] - position[b, 0],
        position[a, 1] - position[b, 1],
        velocity[a, 0] - velocity[b, 0],
        velocity[a, 1] - velocity[b, 1],
        discs.radius[a] + discs.radius[b],
    )
    if time < best.time:
        best = Kiss(time, DISC, a, b)
    elif time == best.time and best.kind == DISC and _share_a_disc(a, b, best) and _faster(discs, a, b, best):
        # A disc that two others reach at once meets the faster one first, whatever their numbers. Thus a table
        # turned by 180 degrees, where the numbers of the paddles are swapped, behaves the same.
        best = Kiss(time, DISC, a, b)
    return best


@inlined
def next_kiss(discs, surface, horizon, near):
    """The earliest kiss on the table within `horizon` seconds. If there is none, its kind is NOTHING at time `horizon`.

    Args:
        near: `Near`, the pairs to check, or None for all pairs.
    """
    position, velocity, radius, inverse_mass = discs.position, discs.velocity, discs.radius, discs.inverse_mass
    best = Kiss(horizon, NOTHING, -1, -1)
    n = position.shape[0]
    for a in range(n):
        x, y = position[a, 0], position[a, 1]
        vx, vy = velocity[a, 0], velocity[a, 1]
        if near is None:
            for b in range(a + 1, n):
                if inverse_mass[a] + inverse_mass[b] != 0.0:
                    best = _earlier_pair(discs, a, b, best)
        else:
            whole = near.whole[0]
            first, last = (a + 1, n) if whole else (near.start[a], near.start[a + 1])
            for k in range(first, last):
                b = k if whole else near.partner[k]
                if inverse_mass[a] + inverse_mass[b] != 0.0:
                    best = _earlier_pair(discs, a, b, best)
        if inverse_mass[a] > 0.0 and reaches_edge(x, y, vx, vy, radius[a], surface, best.time):
            best = _earlier_edge(x, y, vx, vy, radius[a], surface, a, best)
    return best
