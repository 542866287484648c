"""Hostile play: two paddles that do to the puck what no fair player would, with the laws checked after every step.

`python -m tests.hostile --steps 1e8 --seed 0` looks for trouble for as long as you like; `--tables randomized` does so
on tables that the game draws anew for every episode.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numba
import numpy as np

from airhockey_env.compiled import records
from airhockey_env.engine.records import CONTACT
from airhockey_env.game import Game
from airhockey_env.kernel import begin, step_table
from airhockey_env.observations import observe, view
from airhockey_env.physics import FIELDS, check_ranges, spec_of
from airhockey_env.random_stream import draw, draw_between
from airhockey_env.records import CONTACT_ROWS, LEFT, OBSERVATION_SIZE, PUCK, RIGHT, TABLE
from airhockey_env.tables import CHALLENGE, FULL_SIZE, IDEAL, TableSpec

OVERLAP = 1e-9
"""m: a deeper overlap is a failure."""
ROUNDING = 1e-12
"""Share by which a speed may exceed its cap."""

RATES = (10.0, 24.0, 50.0, 120.0, 240.0)
SPECS: dict[str, TableSpec] = {
    "full_size": FULL_SIZE,
    "challenge": CHALLENGE,
    "ideal": IDEAL,
    "violent": dataclasses.replace(IDEAL, paddle_speed=40.0, paddle_acceleration=5000.0, puck_speed=100.0),
    "dead": dataclasses.replace(FULL_SIZE, wall_restitution=0.0, wall_tangential=0.0, paddle_restitution=0.0),
    "cramped": TableSpec(
        length=0.9, width=0.27, goal_width=0.11, puck_radius=0.05, puck_mass=0.05, paddle_radius=0.06,
        wall_restitution=0.9, wall_tangential=0.9, paddle_restitution=0.9,
        drag_constant=0.1, drag_linear=0.1, drag_quadratic=0.1,
    ),
}  # fmt: skip

RANDOM = "random"
"""Every seed and rate plays on a table of its own."""
RANDOMIZED = "randomized"
"""Every seed and rate has ranges of its own, from which `randomize` draws a table for every episode."""
TABLES = (*SPECS, RANDOM, RANDOMIZED)

EPISODE = 200
"""Steps after which a randomized episode ends at the latest; 3 points end it too."""


def random_spec(rng: np.random.Generator) -> TableSpec:
    """Any table, within a factor of two to three of real ones."""
    while True:
        length, width, goal = rng.uniform((1.0, 0.5, 0.1), (3.0, 1.5, 0.6))
        puck, paddle, mass = rng.uniform((0.02, 0.03, 0.005), (0.07, 0.09, 0.1))
        kept = rng.uniform(0.0, 1.0, 3)
        drag = rng.uniform(0.0, (0.1, 1.0, 0.2))
        paddle_speed, acceleration, puck_speed = rng.uniform((1.0, 5.0, 5.0), (10.0, 300.0, 30.0))
        try:
            return TableSpec(
                length, width, goal, puck, mass, paddle, *kept, *drag, paddle_speed, acceleration, puck_speed
            )
        except ValueError:  # they do not fit together
            continue


def random_ranges(spec: TableSpec, rng: np.random.Generator) -> dict[str, tuple[float, float]]:
    """For every field, a range from that of `spec` to that of another table, wherever all that lies between will do."""
    while True:
        other = random_spec(rng)
        pairs = {name: (getattr(spec, name), getattr(other, name)) for name in FIELDS}
        ranges = {name: (min(pair), max(pair)) for name, pair in pairs.items()}
        try:
            check_ranges(spec, ranges)
        except ValueError:  # some draws would not fit together
            continue
        return ranges


def table_of(name: str, seed: int, control_hz: float) -> dict[str, Any]:
    """The arguments of `Game` for a name of `TABLES`."""
    if name in SPECS:
        return {"table": SPECS[name]}
    rng = np.random.default_rng((seed, int(control_hz)))
    spec = random_spec(rng)
    return {"table": spec} if name == RANDOM else {"table": spec, "randomize": random_ranges(spec, rng)}


CHASE, AHEAD, PIN, JITTER, SHAKE, WANDER, MODES = range(7)

FAILURES = (
    "nothing",
    "a number is not finite",
    "the puck overlaps a paddle",
    "the puck overlaps a wall or post, or has escaped",
    "a paddle has left its part of the table",
    "the puck is faster than its cap",
    "a paddle is faster than its cap",
    "an observation is out of [-1, 1]",
    "a contact is not sane",
    "the puck gained speed without a paddle",
    "a drawn table is out of its ranges",
)
(FINE, FINITE, PADDLE, EDGE, CONFINED, PUCK_SPEED, PADDLE_SPEED, OBSERVED, CONTACTS, ENERGY, RANGES) = range(
    len(FAILURES)
)

compiled_here = numba.njit(nogil=True, error_model="numpy")  # not cached: the package's cache knows the package only


class Report(NamedTuple):
    """What a run of hostile play came to."""

    steps: int
    worst: float  # m, the deepest overlap seen, of whatever kind
    paddle_contacts: int
    edge_contacts: int
    crowded: int  # steps with as many contacts as are kept, or more
    pinned: int  # steps that ended with the puck touching a paddle and an edge
    points: int
    drawn: int  # tables that `randomize` drew
    failure: str  # "" if there was none


@compiled_here
def _push(seen, reach, dx, dy):
    """Push the puck along the unit vector (dx, dy): from behind it, at full speed."""
    to_x, to_y = seen.puck_x - seen.x, seen.puck_y - seen.y
    along = to_x * dx + to_y * dy
    if along > 0.8 * math.sqrt(to_x * to_x + to_y * to_y):
        return to_x + 0.5 * reach * dx, to_y + 0.5 * reach * dy
    return to_x - 1.4 * reach * dx, to_y - 1.4 * reach * dy


@compiled_here
def _hostile(table, physics, player, mode, whim):
    """A hostile action of length 1 or more in the player's own view; `whim`, 0 to 1, chooses within the mode."""
    if mode == JITTER:
        return (1.0 if draw(table) < 0.5 else -1.0), (1.0 if draw(table) < 0.5 else -1.0)
    if mode == WANDER:
        return draw_between(table, -1.5, 1.5), draw_between(table, -1.5, 1.5)
    seen = view(table, player)
    reach = physics.radius[player] + physics.radius[PUCK]
    x, y = seen.puck_x - seen.x, seen.puck_y - seen.y
    if mode == AHEAD:
        lead = whim * 0.3
        x, y = x + lead * seen.puck_vx, y + lead * seen.puck_vy
    elif mode == SHAKE:
        sign = 1.0 if table.steps % 2 == 0 else -1.0
        x, y = sign * x, sign * y
        if whim < 0.5:
            x, y = -y, x
    elif mode == PIN:
        side = 1.0 if seen.puck_y > 0.0 else -1.0
        if whim < 0.2:  # on the side wall
            x, y = _push(seen, reach, 0.0, side)
        elif whim < 0.4:  # on the own end wall
            x, y = _push(seen, reach, -1.0, 0.0)
        elif whim < 0.6:  # into the own corner
            x, y = _push(seen, reach, -math.sqrt(0.5), side * math.sqrt(0.5))
        elif whim < 0.8:  # on a post
            px = -physics.half_length - seen.puck_x
            py = side * physics.half_goal - seen.puck_y
            away = max(math.sqrt(px * px + py * py), 1e-9)
            x, y = _push(seen, reach, px / away, py / away)
        else:  # at the other player
            x, y = _push(seen, reach, 1.0, 0.0)
    length = max(math.sqrt(x * x + y * y), 1e-9)
    return 1.5 * x / length, 1.5 * y / length


@compiled_here
def _ambush(table, physics):
    """Put the puck on an edge and a paddle against it, both at great speed, if there is room."""
    p, v = table.position, table.velocity
    r = physics.radius[PUCK]
    x_most, y_most = physics.half_length - r, physics.half_width - r
    x, y = draw_between(table, -x_most, x_most), draw_between(table, -y_most, y_most)
    where = draw(table)
    if where < 0.3:
        y = y_most if draw(table) < 0.5 else -y_most
    if 0.2 < where < 0.6:
        x = x_most if draw(table) < 0.5 else -x_most
    if where > 0.8:  # around a post
        end, side = (1.0 if draw(table) < 0.5 else -1.0), (1.0 if draw(table) < 0.5 else -1.0)
        angle = draw_between(table, 0.0, 0.5 * math.pi)
        x = end * (physics.half_length - r * math.cos(angle))
        y = side * (physics.half_goal - r * math.sin(angle))
    player = LEFT if x < 0.0 else RIGHT
    angle = draw_between(table, -math.pi, math.pi)
    reach = physics.radius[player] + r
    px, py = x + reach * math.cos(angle), y + reach * math.sin(angle)
    near, far = physics.radius[player], physics.half_length - physics.radius[player]
    if not near <= abs(px) <= far or px * x < 0.0 or abs(py) > physics.half_width - physics.radius[player]:
        return
    other = RIGHT if player == LEFT else LEFT
    if math.sqrt((x - p[other, 0]) ** 2 + (y - p[other, 1]) ** 2) < reach:
        return
    p[PUCK, 0], p[PUCK, 1], p[player, 0], p[player, 1] = x, y, px, py
    speed = physics.puck_speed * draw(table)
    angle = draw_between(table, -math.pi, math.pi)
    v[PUCK, 0], v[PUCK, 1] = speed * math.cos(angle), speed * math.sin(angle)
    speed = physics.paddle_speed * draw(table)
    angle = draw_between(table, -math.pi, math.pi)
    v[player, 0], v[player, 1] = speed * math.cos(angle), speed * math.sin(angle)


@compiled_here
def _edge_depth(x, y, r, physics):
    """How deep a puck is in a wall or post, m; negative if it is clear of them."""
    x, y = abs(x), abs(y)
    depth = y + r - physics.half_width
    if y >= physics.half_goal:
        return max(depth, x + r - physics.half_length)
    post = r - math.sqrt((x - physics.half_length) ** 2 + (y - physics.half_goal) ** 2)
    return max(depth, post, x - physics.half_length)


@compiled_here
def _sane(contacts, count, physics):
    """Whether the contacts of a step are what contacts can be."""
    before = 0.0
    for k in range(count):
        c = contacts[k]
        if not before <= c.time <= physics.tick or not c.impulse > 0.0:
            return False
        if not (c.a == PUCK and c.b == -1) and not ((c.a == LEFT or c.a == RIGHT) and c.b == PUCK):
            return False
        if not abs(c.nx * c.nx + c.ny * c.ny - 1.0) < 1e-9:
            return False
        if not (abs(c.x) <= physics.half_length + OVERLAP and abs(c.y) <= physics.half_width + OVERLAP):
            return False
        before = c.time
    return True


@compiled_here
def _check(table, physics, contacts, served, speed_before, seen, tally):
    """The first law that the table breaks, or FINE; keeps the worst overlap and counts in `tally`."""
    p, v = table.position, table.velocity
    total = 0.0
    for disc in range(3):
        total += abs(p[disc, 0]) + abs(p[disc, 1]) + abs(v[disc, 0]) + abs(v[disc, 1])
    if not total < math.inf:
        return FINITE

    r = physics.radius[PUCK]
    gap = math.inf
    for player in (LEFT, RIGHT):
        dx, dy = p[PUCK, 0] - p[player, 0], p[PUCK, 1] - p[player, 1]
        gap = min(gap, math.sqrt(dx * dx + dy * dy) - physics.radius[player] - r)
        forward = 1.0 if player == LEFT else -1.0
        ahead, radius = forward * p[player, 0], physics.radius[player]
        out = max(
            ahead + radius, -ahead + radius - physics.half_length, abs(p[player, 1]) + radius - physics.half_width
        )
        tally[0] = max(tally[0], out)
        if out > OVERLAP:
            return CONFINED
        if math.sqrt(v[player, 0] ** 2 + v[player, 1] ** 2) > physics.paddle_speed * (1.0 + ROUNDING):
            return PADDLE_SPEED
    edge = _edge_depth(p[PUCK, 0], p[PUCK, 1], r, physics)
    tally[0] = max(tally[0], -gap, edge)
    if -gap > OVERLAP:
        return PADDLE
    if edge > OVERLAP:
        return EDGE
    if gap < OVERLAP and edge > -OVERLAP:
        tally[4] += 1

    speed = math.sqrt(v[PUCK, 0] ** 2 + v[PUCK, 1] ** 2)
    if speed > physics.puck_speed * (1.0 + ROUNDING):
        return PUCK_SPEED
    if not _sane(contacts, table.n_contacts, physics):
        return CONTACTS
    with_paddles = 0
    for k in range(table.n_contacts):
        with_paddles += contacts[k].b == PUCK
    tally[1] += with_paddles
    tally[2] += table.n_contacts - with_paddles
    crowded = table.n_contacts == contacts.shape[0]
    tally[3] += crowded
    if not (served or crowded or with_paddles) and speed > speed_before * (1.0 + ROUNDING):
        return ENERGY

    for player in (LEFT, RIGHT):
        observe(table, physics, player, seen, 0)
        for k in range(seen.shape[1]):
            if not -1.0 <= seen[0, k] <= 1.0:
                return OBSERVED
    return FINE


@compiled_here
def _in_ranges(physics, ranges):
    """Whether a table's fields are what `randomize` may draw."""
    outside = 0
    for k in range(ranges.shape[0]):
        outside += not ranges[k, 0] <= physics.spec[k] <= ranges[k, 1]
    return outside == 0


@compiled_here
def _end(table, tally):
    """Keep the score of an episode."""
    tally[5] += table.score[0] + table.score[1]
    table.score[0] = 0
    table.score[1] = 0


@compiled_here
def _play(tables, physics, settings, ranges, modes, whims, steps, before, tally):
    """Play hostile steps on every table; stops at the first failure with the table as it was before in `before[0]`.

    Returns the number of the failure and of the table.
    """
    contacts = np.zeros(CONTACT_ROWS, CONTACT)
    seen = np.zeros((1, OBSERVATION_SIZE), np.float32)
    actions = np.zeros((2, 2))
    rules = settings[0]
    for i in range(tables.shape[0]):
        table = tables[i]
        law = physics[i if rules.randomized else 0]
        for step in range(steps):
            if rules.randomized and (step == 0 or table.done):
                _end(table, tally)
                begin(table, law, rules, ranges, 0)
                tally[6] += 1
                if not _in_ranges(law, ranges):
                    return RANGES, i
            for player in (LEFT, RIGHT):
                if draw(table) < 0.03:
                    modes[i, player] = int(MODES * draw(table))
                    whims[i, player] = draw(table)
                ax, ay = _hostile(table, law, player, modes[i, player], whims[i, player])
                actions[player, 0], actions[player, 1] = ax, ay
            if draw(table) < 0.01:
                _ambush(table, law)
            before[0] = table
            speed = math.sqrt(table.velocity[PUCK, 0] ** 2 + table.velocity[PUCK, 1] ** 2)
            score, clock = table.score[0] + table.score[1], table.clock
            step_table(table, law, rules, actions[0, 0], actions[0, 1], actions[1, 0], actions[1, 1], contacts)
            served = table.score[0] + table.score[1] != score or (clock == law.clock_limit and table.clock == 0)
            failure = _check(table, law, contacts, served, speed, seen, tally)
            if failure != FINE:
                return failure, i
        _end(table, tally)
    return FINE, 0


def play_hostile(name: str, control_hz: float, steps: int, seed: int, tables: int = 16) -> Report:
    """At least `steps` hostile steps on a table of `TABLES` at a control rate, spread over `tables` games."""
    arguments = table_of(name, seed, control_hz)
    if name == RANDOMIZED:
        arguments |= {"points": 3, "max_episode_steps": EPISODE}
    else:
        arguments |= {"points": 2**30}  # one episode
    game = Game(tables, control_hz=control_hz, opponent="idle", **arguments)
    game.seed([seed * tables + i for i in range(tables)])
    game.reset()
    each = -(-steps // tables)
    before = records(1, TABLE)
    tally = np.zeros(7)
    tally[0] = -math.inf
    modes, whims = np.zeros((tables, 2), np.int64), np.zeros((tables, 2))
    number, i = _play(game.tables, game.physics, game.settings, game.ranges, modes, whims, each, before, tally)
    failure = ""
    if number != FINE:
        law = game.physics[i if game.randomized else 0]
        failure = f"{FAILURES[number]}; before the step: {before[0]}, on {law}"
    else:
        for law in game.physics:
            spec_of(law)  # raises an error if it is no table
    return Report(each * tables, tally[0], *(int(count) for count in tally[1:]), failure)


def hunt(steps: int, seed: int, names: Sequence[str] = TABLES, chunk: int = 200_000):
    """Hostile play on every table named, at every rate of `RATES`, in turn; yields (name, rate, seed, Report)."""
    places = [(name, rate) for name in names for rate in RATES]
    chunk = min(chunk, -(-steps // len(places)))
    played = 0
    while played < steps:
        for name, rate in places:
            report = play_hostile(name, rate, chunk, seed)
            played += report.steps
            yield name, rate, seed, report
            if played >= steps:
                return
        seed += 1


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.hostile", description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=float, default=1e7, help="steps to play in all")
    parser.add_argument("--seed", type=int, default=0, help="first seed; each round of all tables takes the next")
    parser.add_argument("--tables", nargs="+", choices=TABLES, default=TABLES, metavar="NAME",
                        help=f"tables to play on: {', '.join(TABLES)} (all by default)")  # fmt: skip
    arguments = parser.parse_args()
    if not arguments.steps >= 1 or arguments.seed < 0:
        parser.error("--steps must be at least 1 and --seed at least 0")
    totals: dict[str, Report] = {}
    seeds: set[int] = set()
    play_hostile("full_size", 50.0, 1, 0)  # compile before the clock runs
    start = time.perf_counter()
    failures = 0
    for name, rate, seed, report in hunt(int(arguments.steps), arguments.seed, arguments.tables):
        seeds.add(seed)
        if report.failure:
            failures += 1
            print(f"FAILED on {name} at {rate:g} Hz, seed {seed}: {report.failure}", flush=True)
        old = totals.get(name)
        if old is not None:
            added = [a + b for a, b in zip(old, report, strict=True)]
            report = Report(*added)._replace(worst=max(old.worst, report.worst))
        totals[name] = report
    elapsed = time.perf_counter() - start
    print(f"{'table':10s} {'steps':>12s} {'worst overlap':>14s} {'paddle':>11s} {'edge':>11s} {'crowded':>9s} "
          f"{'pinned':>9s} {'points':>8s} {'drawn':>8s}")  # fmt: skip
    for name, r in totals.items():
        print(f"{name:10s} {r.steps:12d} {r.worst:12.3g} m {r.paddle_contacts:11d} {r.edge_contacts:11d} "
              f"{r.crowded:9d} {r.pinned:9d} {r.points:8d} {r.drawn:8d}")  # fmt: skip
    steps = sum(r.steps for r in totals.values())
    worst = max(r.worst for r in totals.values())
    print(f"{steps} steps, seeds {min(seeds)} to {max(seeds)}, {steps / elapsed:.3g} steps/s, "
          f"worst overlap {worst:.3g} m, {failures} failures")  # fmt: skip
    return 1 if failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
