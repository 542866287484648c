"""Goal mouths: posts bounce, goal lines report, and nothing gets stuck in or through a post."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given

from airhockey_env.compiled import records
from airhockey_env.engine.advance import advance
from airhockey_env.engine.records import CONTACT, SURFACE, Discs
from airhockey_env.engine.tolerances import GAME_CONTACTS
from tests.engine.scenes import laws, seeds

HALF_LENGTH, HALF_WIDTH, HALF_GOAL, RADIUS = 1.0, 0.5, 0.15, 0.04
TICK = 0.02


def surface(restitution=1.0, tangential=1.0, half_goal=HALF_GOAL):
    record = records(1, SURFACE)
    record["half_length"], record["half_width"], record["half_goal"] = HALF_LENGTH, HALF_WIDTH, half_goal
    record["wall_restitution"], record["wall_tangential"], record["disc_restitution"] = restitution, tangential, 0.8
    return record[0]


def puck(position, velocity, radius=RADIUS):
    return Discs(
        np.array([position], float), np.array([velocity], float), np.array([radius]), np.array([1.0]),
        np.zeros(1, np.int32),
    )  # fmt: skip


def play(discs, table, tick=TICK, limit=GAME_CONTACTS):
    discs.hits[:] = 0
    contacts = records(64, CONTACT)
    outcome = advance(discs, table, 0.0, tick, limit, contacts, False, None)
    return outcome, contacts[: outcome.contacts]


def assert_in_bounds(discs, a, half_goal=HALF_GOAL):
    """Disc a overlaps no post and no wall, and lies beyond the end walls' line only inside a mouth."""
    (x, y), radius = np.abs(discs.position[a]), discs.radius[a]
    assert math.hypot(x - HALF_LENGTH, y - half_goal) >= radius - 1e-9
    assert y <= HALF_WIDTH - radius + 1e-9
    assert x <= HALF_LENGTH - radius + 1e-9 or (y < half_goal and x <= HALF_LENGTH)


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("offset", [0.0, 0.109, -0.109])
def test_a_goal_is_reported_with_its_side_and_the_centre_on_the_line(side, offset):
    discs = puck([side * 0.9, offset], [side * 10.0, 0.0])
    outcome, contacts = play(discs, surface())
    assert (outcome.goal, len(contacts)) == (side, 0)
    assert outcome.elapsed == pytest.approx(0.01)
    assert discs.position[0, 0] == side * HALF_LENGTH
    assert discs.position[0, 1] == offset
    assert discs.velocity[0].tolist() == [side * 10.0, 0.0]


@pytest.mark.parametrize("y", [0.151, 0.3, -0.2])
def test_beside_the_goal_there_is_a_wall(y):
    discs = puck([0.9, y], [10.0, 0.0])
    outcome, contacts = play(discs, surface(restitution=0.5))
    assert outcome.goal == 0
    assert [(c["nx"], c["ny"]) for c in contacts] == [(-1.0, 0.0)]
    assert discs.velocity[0].tolist() == [-5.0, 0.0]


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("post", [-1, 1])
def test_a_post_bounces_along_its_ideal_normal(side, post):
    """0.024 off the post's line is a normal of (0.8, 0.6) for a puck of 0.04."""
    discs = puck([side * 0.9, post * (HALF_GOAL - 0.024)], [side * 10.0, 0.0])
    outcome, contacts = play(discs, surface(restitution=0.5, tangential=0.75))
    assert outcome.goal == 0
    (contact,) = contacts
    assert (contact["nx"], contact["ny"]) == pytest.approx((-side * 0.8, -post * 0.6))
    assert (contact["x"], contact["y"]) == pytest.approx((side * HALF_LENGTH, post * HALF_GOAL))
    assert contact["b"] == -1
    normal, tangent = np.array([-side * 0.8, -post * 0.6]), np.array([post * 0.6, -side * 0.8])
    assert discs.velocity[0] @ normal == pytest.approx(0.5 * 8.0)
    assert discs.velocity[0] @ tangent == pytest.approx(0.75 * np.array([side * 10.0, 0.0]) @ tangent)


def test_a_goal_in_the_middle_of_a_tick_ends_it_there():
    discs = puck([0.5, 0.4], [50.0, -40.0])
    outcome, _ = play(discs, surface(), tick=1.0)
    assert outcome.goal in (-1, 0, 1)
    discs = puck([0.5, 0.0], [50.0, 0.0])
    outcome, _ = play(discs, surface(), tick=1.0)
    assert (outcome.goal, outcome.elapsed) == (1, pytest.approx(0.01))


@laws
@given(seeds)
def test_a_puck_in_the_mouth_scores_or_leaves_and_never_touches_a_post_too_deeply(seed):
    rng = np.random.default_rng(seed)
    table = surface(restitution=rng.uniform(0.3, 1.0), tangential=rng.uniform(0.3, 1.0))
    side = rng.choice([-1.0, 1.0])
    place = [side * rng.uniform(HALF_LENGTH - RADIUS, HALF_LENGTH), rng.uniform(-1, 1) * (HALF_GOAL - RADIUS)]
    angle = rng.uniform(0.0, 2.0 * math.pi)
    discs = puck(place, rng.uniform(0.1, 25.0) * np.array([math.cos(angle), math.sin(angle)]))
    for _ in range(50):
        outcome, _ = play(discs, table)
        assert_in_bounds(discs, 0)
        if outcome.goal:
            assert outcome.goal == np.sign(discs.position[0, 0])
            assert abs(discs.position[0, 0]) == HALF_LENGTH
            assert abs(discs.position[0, 1]) <= HALF_GOAL - RADIUS + 1e-9
            break


@laws
@given(seeds)
def test_a_puck_on_the_whole_table_stays_on_it_until_it_scores(seed):
    rng = np.random.default_rng(seed)
    table = surface(restitution=rng.uniform(0.8, 1.0))
    discs = puck(rng.uniform(-1, 1, 2) * [0.9, 0.4], rng.uniform(-20.0, 20.0, 2))
    for _ in range(200):
        outcome, _ = play(discs, table)
        assert_in_bounds(discs, 0)
        if outcome.goal:
            assert abs(discs.position[0, 0]) == HALF_LENGTH
            break


@laws
@given(seeds)
def test_a_goal_narrower_than_the_puck_lets_none_through(seed):
    rng = np.random.default_rng(seed)
    half_goal = rng.uniform(0.2, 0.95) * RADIUS
    discs = puck(rng.uniform(-1, 1, 2) * [0.9, 0.05], rng.uniform(-1, 1, 2) * [25.0, 1.0])
    for _ in range(50):
        outcome, _ = play(discs, surface(half_goal=half_goal))
        assert outcome.goal == 0
        assert_in_bounds(discs, 0, half_goal)


@laws
@given(seeds)
def test_a_paddle_that_stirs_in_the_mouth_never_presses_the_puck_through_a_post(seed):
    rng = np.random.default_rng(seed)
    table = surface(restitution=rng.uniform(0.0, 1.0), tangential=0.7)
    discs = Discs(
        np.array([[0.8, 0.0], [0.95, 0.0]]), np.zeros((2, 2)), np.array([0.05, RADIUS]), np.array([0.0, 1.0]),
        np.zeros(2, np.int32),
    )  # fmt: skip
    for _ in range(60):
        # The paddle heads for the puck, more or less, as a player's would, and stays off the end wall.
        way = discs.position[1] - discs.position[0]
        drive = rng.uniform(0.5, 4.0) * way / math.hypot(*way) + rng.normal(0.0, 0.5, 2)
        if discs.position[0, 0] + drive[0] * TICK > HALF_LENGTH - 0.05:
            drive[0] = 0.0
        discs.velocity[0] = drive
        outcome, _ = play(discs, table)
        assert math.dist(*discs.position) >= 0.05 + RADIUS - 1e-9
        if outcome.goal:
            break
        assert_in_bounds(discs, 1)
