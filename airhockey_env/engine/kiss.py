"""Where and when: the next kiss on a table.

Two discs kiss when they touch without overlapping. Seen from B, disc A travels along a straight line, the A' path;
the leg from that path to B's centre and the sum of the radii, which is the hypotenuse at the kiss, give the place of
the kiss on the path, and with the relative velocity its time. A wall is a line that the centre may not cross, a post
is a disc of radius 0, and the goal line between the posts is a sensor: crossing it is reported and ends the tick.

Kisses at the same instant are taken in a fixed order, so that runs repeat to the bit: pairs of discs by their
numbers (of two equally early pairs that share a disc, the one that approaches faster first), then for every disc the
end wall, the side wall, the posts (the one at +y first) and the goal line.
"""

from __future__ import annotations

import math

from airhockey_env.compiled import compiled
from airhockey_env.engine.records import DISC, GOAL, NOTHING, POST, WALL, Discs, Kiss
from airhockey_env.engine.tolerances import TOUCH_SPEED

END_WALL, SIDE_WALL = 0, 2  # numbers of walls: at +x, -x, +y, -y


@compiled
def kiss_time(dx, dy, vx, vy, reach):
    """Time until two discs kiss, or inf if they never do.

    Args:
        dx, dy: centre of A as seen from B, m.
        vx, vy: velocity of A as seen from B, m/s.
        reach: sum of the radii, m.

    Touching (or overlapping by rounding) and approaching is a kiss at time 0. Moving apart, not moving, missing
    and merely grazing are none.
    """
    approach = dx * vx + dy * vy  # distance times closing speed; negative when approaching
    if not approach < 0.0:
        return math.inf
    speed2 = vx * vx + vy * vy
    shared_leg = dx * vy - dy * vx  # times speed
    top_leg2 = reach * reach * speed2 - shared_leg * shared_leg  # squared, times speed squared
    if not top_leg2 > 0.0:
        return math.inf
    if dx * dx + dy * dy <= reach * reach:
        return 0.0 if approach < -TOUCH_SPEED * reach else math.inf
    return max(0.0, (-approach - math.sqrt(top_leg2)) / speed2)


@compiled
def _earlier_disc(discs, a, best):
    """The kiss of disc a with a disc of a higher number, if it comes before `best`."""
    position, velocity = discs.position, discs.velocity
    for b in range(a + 1, position.shape[0]):
        if discs.inverse_mass[a] + discs.inverse_mass[b] == 0.0:
            continue
        dx = position[a, 0] - position[b, 0]
        dy = position[a, 1] - position[b, 1]
        vx = velocity[a, 0] - velocity[b, 0]
        vy = velocity[a, 1] - velocity[b, 1]
        time = kiss_time(dx, dy, vx, vy, discs.radius[a] + discs.radius[b])
        if time < best.time:
            best = Kiss(time, DISC, a, b)
        elif time == best.time and best.kind == DISC and best.b == b:
            # A disc that two others reach at once meets the faster one first, whatever their numbers: so a table
            # turned by 180 degrees, where the numbers of the paddles are swapped, plays the same.
            ox = position[best.a, 0] - position[b, 0]
            oy = position[best.a, 1] - position[b, 1]
            ux = velocity[best.a, 0] - velocity[b, 0]
            uy = velocity[best.a, 1] - velocity[b, 1]
            if dx * vx + dy * vy < ox * ux + oy * uy:
                best = Kiss(time, DISC, a, b)
    return best


@compiled
def _earlier_edge(discs, a, surface, best):
    """The kiss of disc a with a wall or post, or its crossing of a goal line, if it comes before `best`."""
    x, y = discs.position[a, 0], discs.position[a, 1]
    vx, vy = discs.velocity[a, 0], discs.velocity[a, 1]
    radius = discs.radius[a]

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


@compiled
def next_kiss(discs, surface, horizon):
    """The earliest kiss on the table within `horizon` seconds; its kind is NOTHING, at `horizon`, if there is none."""
    best = Kiss(horizon, NOTHING, -1, -1)
    for a in range(discs.position.shape[0]):
        best = _earlier_disc(discs, a, best)
    for a in range(discs.position.shape[0]):
        if discs.inverse_mass[a] > 0.0:
            best = _earlier_edge(discs, a, surface, best)
    return best
