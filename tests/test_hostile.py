"""The laws hold whatever the paddles do, on every table, at every rate; `tests.hostile` plays and checks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from airhockey_env.engine.records import CONTACT
from airhockey_env.game import Game
from airhockey_env.physics import FIELDS, check_ranges
from airhockey_env.records import CONTACT_ROWS, LEFT, PUCK, RIGHT
from airhockey_env.tables import FULL_SIZE
from tests import hostile

STEPS = 12_000


@pytest.mark.parametrize("name", hostile.SPECS)
def test_the_laws_hold_in_hostile_play(name):
    reports = [hostile.play_hostile(name, rate, STEPS, seed=5) for rate in hostile.RATES]
    assert [report.failure for report in reports] == [""] * len(hostile.RATES)
    # It was hostile: contacts of both kinds, squeezed pucks, pinned pucks and points.
    paddle, edge, crowded, pinned, points = np.sum([report[2:7] for report in reports], axis=0)
    assert min(paddle, edge) > STEPS / 4
    assert min(crowded, pinned) > STEPS / 200
    assert points > 5


@pytest.mark.parametrize("seed", range(4))
def test_the_laws_hold_in_hostile_play_on_random_tables(seed):
    for rate in hostile.RATES:
        assert hostile.play_hostile(hostile.RANDOM, rate, 2000, seed).failure == ""


@pytest.mark.parametrize("seed", range(4))
def test_the_laws_hold_in_hostile_play_on_tables_drawn_anew_for_every_episode(seed):
    for rate in hostile.RATES:
        report = hostile.play_hostile(hostile.RANDOMIZED, rate, STEPS, seed)
        assert report.failure == ""
        assert report.drawn >= STEPS / hostile.EPISODE


def test_hostile_tables_are_drawn_widely():
    """A few tables from a few ranges cover most of what tables may be."""
    drawn = []
    for seed in range(20):
        game = Game(50, opponent="idle", **hostile.table_of(hostile.RANDOMIZED, seed, 50.0))
        assert game.randomized == FIELDS
        game.seed(range(50))
        game.reset()
        drawn.append(game.physics["spec"])
    specs = np.concatenate(drawn)
    assert len(np.unique(specs, axis=0)) == len(specs)
    share = specs[:, FIELDS.index("wall_restitution")]
    assert share.min() < 0.1 and share.max() > 0.9
    length, speed = specs[:, FIELDS.index("length")], specs[:, FIELDS.index("paddle_speed")]
    assert length.max() > 2.0 * length.min() and speed.max() > 4.0 * speed.min()


def test_hostile_play_repeats_to_the_bit():
    first, second = (hostile.play_hostile(hostile.RANDOMIZED, 50.0, 4000, seed=8) for _ in range(2))
    assert first == second
    assert first != hostile.play_hostile(hostile.RANDOMIZED, 50.0, 4000, seed=9)


def _put(position):
    def change(table, contacts):
        table["position"][0, PUCK] = position

    return change


def _set(name, index, value):
    def change(table, contacts):
        table[name][(0, *index)] = value

    return change


def _contact(**values):
    def change(table, contacts):
        table["n_contacts"] = 2
        contacts["time"], contacts["a"], contacts["b"], contacts["ny"], contacts["impulse"] = 0.01, PUCK, -1, 1.0, 0.1
        for name, value in values.items():
            contacts[name][1] = value

    return change


HALF_LENGTH, HALF_WIDTH, HALF_GOAL = 0.5 * FULL_SIZE.length, 0.5 * FULL_SIZE.width, 0.5 * FULL_SIZE.goal_width
R = FULL_SIZE.puck_radius
REACH = R + FULL_SIZE.paddle_radius
DEEP = 3.0 * hostile.OVERLAP


@pytest.mark.parametrize(
    ("change", "failure"),
    [
        (lambda table, contacts: None, hostile.FINE),
        (_set("position", (PUCK, 0), math.nan), hostile.FINITE),
        (_set("velocity", (RIGHT, 1), math.inf), hostile.FINITE),
        (_put((-0.8 * HALF_LENGTH + REACH - DEEP, 0.0)), hostile.PADDLE),
        (_put((0.8 * HALF_LENGTH, REACH - DEEP)), hostile.PADDLE),
        (_put((0.3, HALF_WIDTH - R + DEEP)), hostile.EDGE),
        (_put((0.3, HALF_WIDTH - R - DEEP)), hostile.FINE),
        (_put((-HALF_LENGTH + R - DEEP, 0.4)), hostile.EDGE),
        (_put((HALF_LENGTH, HALF_GOAL - R + DEEP)), hostile.EDGE),
        (_put((HALF_LENGTH, HALF_GOAL - R - DEEP)), hostile.FINE),
        (_put((HALF_LENGTH + DEEP, 0.0)), hostile.EDGE),
        (_put((9.0, 0.0)), hostile.EDGE),
        (_set("position", (LEFT, 0), 0.1), hostile.CONFINED),
        (_set("position", (RIGHT, 1), -HALF_WIDTH), hostile.CONFINED),
        (_set("velocity", (PUCK, 0), -12.001), hostile.PUCK_SPEED),
        (_set("velocity", (LEFT, 1), 5.001), hostile.PADDLE_SPEED),
        (_set("velocity", (PUCK, 0), 1.5), hostile.ENERGY),
        (_set("clock", (), 400), hostile.OBSERVED),
        (_contact(), hostile.FINE),
        (_contact(time=0.009), hostile.CONTACTS),
        (_contact(time=0.021), hostile.CONTACTS),
        (_contact(a=LEFT), hostile.CONTACTS),
        (_contact(b=RIGHT), hostile.CONTACTS),
        (_contact(nx=0.1), hostile.CONTACTS),
        (_contact(impulse=0.0), hostile.CONTACTS),
        (_contact(x=1.5), hostile.CONTACTS),
    ],
)
def test_each_check_sees_what_it_is_for(change, failure):
    game = Game(1, opponent="idle")
    game.reset()
    game.tables["position"][0, PUCK] = (0.2, 0.1)
    contacts = np.zeros(CONTACT_ROWS, CONTACT)
    change(game.tables, contacts)
    tally, seen = np.zeros(7), np.zeros((1, 13), np.float32)
    assert hostile._check(game.tables[0], game.physics[0], contacts, False, 1.0, seen, tally) == failure


def test_the_check_of_ranges_sees_what_it_is_for():
    game = Game(1, opponent="idle")
    assert hostile._in_ranges(game.physics[0], check_ranges(FULL_SIZE, {"length": (FULL_SIZE.length, 2.5)}))
    assert not hostile._in_ranges(game.physics[0], check_ranges(FULL_SIZE, {"length": (2.4, 2.5)}))
    assert not hostile._in_ranges(game.physics[0], check_ranges(FULL_SIZE, {"drag_linear": (0.1, 0.2)}))
