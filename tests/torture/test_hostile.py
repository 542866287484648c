"""The laws hold whatever the paddles do, on every table, at every rate; `tests.torture` plays and checks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from airhockey_env.engine.records import CONTACT
from airhockey_env.game import Game
from airhockey_env.kernel.state import CONTACT_ROWS, LEFT, OBSERVATION_SIZE, PUCK, RIGHT
from airhockey_env.tables import FIELDS, FULL_SIZE, check_randomize
from tests.torture import hostile, laws, tables

STEPS = 12_000


@pytest.mark.parametrize("name", tables.SPECS)
def test_the_laws_hold_in_hostile_play(name):
    reports = [hostile.play_hostile(name, rate, STEPS, seed=5) for rate in tables.RATES]
    assert [report.failure for report in reports] == [""] * len(tables.RATES)
    # It was hostile: contacts of both kinds, squeezed pucks, pinned pucks and points.
    paddle, edge, crowded, pinned, points = np.sum([report[2:7] for report in reports], axis=0)
    assert min(paddle, edge) > STEPS / 4
    assert min(crowded, pinned) > STEPS / 200
    assert points > 5


@pytest.mark.parametrize("seed", range(4))
def test_the_laws_hold_in_hostile_play_on_random_tables(seed):
    for rate in tables.RATES:
        assert hostile.play_hostile(tables.RANDOM, rate, 2000, seed).failure == ""


@pytest.mark.parametrize("seed", range(4))
def test_the_laws_hold_in_hostile_play_on_tables_drawn_anew_for_every_episode(seed):
    for rate in tables.RATES:
        report = hostile.play_hostile(tables.RANDOMIZED, rate, STEPS, seed)
        assert report.failure == ""
        assert report.drawn >= STEPS / hostile.EPISODE


def test_hostile_tables_are_drawn_widely():
    """A few tables from a few ranges cover most of what tables may be."""
    drawn = []
    for seed in range(20):
        game = Game(50, right="idle", **tables.table_of(tables.RANDOMIZED, seed, 50.0))
        assert game.randomized == FIELDS
        game.reset(seed=0)
        drawn.append(game.parameters["spec"])
    specs = np.concatenate(drawn)
    assert len(np.unique(specs, axis=0)) == len(specs)
    share = specs[:, FIELDS.index("wall_restitution")]
    assert share.min() < 0.1 and share.max() > 0.9
    length, speed = specs[:, FIELDS.index("length")], specs[:, FIELDS.index("paddle_speed")]
    assert length.max() > 2.0 * length.min() and speed.max() > 4.0 * speed.min()


def test_hostile_play_repeats_to_the_bit():
    first, second = (hostile.play_hostile(tables.RANDOMIZED, 50.0, 4000, seed=8) for _ in range(2))
    assert first == second
    assert first != hostile.play_hostile(tables.RANDOMIZED, 50.0, 4000, seed=9)


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
        contacts["time"], contacts["a"], contacts["b"], contacts["ny"], contacts["impulse"] = 0.01, PUCK, -1, 1.0, 0.1
        for name, value in values.items():
            contacts[name][1] = value

    return change


HALF_LENGTH, HALF_WIDTH, HALF_GOAL = 0.5 * FULL_SIZE.length, 0.5 * FULL_SIZE.width, 0.5 * FULL_SIZE.goal_width
R = FULL_SIZE.puck_radius
REACH = R + FULL_SIZE.paddle_radius
DEEP = 3.0 * laws.OVERLAP


def check(before, game, contacts, reward=0.0, terminated=False, truncated=False):
    work = np.zeros((2, 1, OBSERVATION_SIZE), np.float32), laws.new_tally()
    kept = contacts, 2 if contacts["time"].any() else 0
    told = reward, terminated, truncated
    return laws.check_step(before, game.states[0], game.parameters[0], game.settings[0], *kept, *told, *work)


@pytest.mark.parametrize(
    ("change", "failure"),
    [
        (lambda table, contacts: None, laws.FINE),
        (_set("position", (PUCK, 0), math.nan), laws.FINITE),
        (_set("velocity", (RIGHT, 1), math.inf), laws.FINITE),
        (_put((-0.8 * HALF_LENGTH + REACH - DEEP, 0.0)), laws.PADDLE),
        (_put((0.8 * HALF_LENGTH, REACH - DEEP)), laws.PADDLE),
        (_put((0.3, HALF_WIDTH - R + DEEP)), laws.EDGE),
        (_put((0.3, HALF_WIDTH - R - DEEP)), laws.FINE),
        (_put((-HALF_LENGTH + R - DEEP, 0.4)), laws.EDGE),
        (_put((HALF_LENGTH, HALF_GOAL - R + DEEP)), laws.EDGE),
        (_put((HALF_LENGTH, HALF_GOAL - R - DEEP)), laws.FINE),
        (_put((HALF_LENGTH + DEEP, 0.0)), laws.EDGE),
        (_put((9.0, 0.0)), laws.EDGE),
        (_set("position", (LEFT, 0), 0.1), laws.CONFINED),
        (_set("position", (RIGHT, 1), -HALF_WIDTH), laws.CONFINED),
        (_set("velocity", (PUCK, 0), -12.001), laws.PUCK_SPEED),
        (_set("velocity", (LEFT, 1), 5.001), laws.PADDLE_SPEED),
        (_set("velocity", (PUCK, 0), 1.5), laws.ENERGY),
        (_set("clock", (), 400), laws.OBSERVED),
        (_set("clock", (), 0), laws.CLOCK),
        (_set("side", (), 1), laws.FINE),
        (_set("side", (), -1), laws.CLOCK),
        (_set("score", (0,), 1), laws.SCORE),
        (_set("score", (1,), -1), laws.SCORE),
        (_set("steps", (), 2), laws.ENDED),
        (_set("done", (), True), laws.ENDED),
        (_contact(), laws.FINE),
        (_contact(time=0.009), laws.CONTACTS),
        (_contact(time=0.021), laws.CONTACTS),
        (_contact(a=LEFT), laws.CONTACTS),
        (_contact(b=RIGHT), laws.CONTACTS),
        (_contact(nx=0.1), laws.CONTACTS),
        (_contact(impulse=0.0), laws.CONTACTS),
        (_contact(x=1.5), laws.CONTACTS),
    ],
)
def test_each_check_sees_what_it_is_for(change, failure):
    game = Game(1, right="idle")
    game.reset()
    game.states["side"] = 1
    game.states["position"][0, PUCK] = (0.2, 0.1)
    contacts = np.zeros(CONTACT_ROWS, CONTACT)
    before = game.states[0].copy()
    before["velocity"][PUCK] = 1.0, 0.0
    game.states["steps"], game.states["clock"] = 1, 1
    change(game.states, contacts)
    assert check(before, game, contacts) == failure


@pytest.mark.parametrize(
    ("told", "failure"),
    [
        ({"reward": 1.0, "terminated": True}, laws.FINE),
        ({"reward": -1.0, "terminated": True}, laws.SCORE),
        ({"reward": 1.0}, laws.ENDED),
        ({"reward": 1.0, "terminated": True, "truncated": True}, laws.ENDED),
    ],
)
def test_the_check_of_a_goal_sees_what_it_is_for(told, failure):
    game = Game(1, right="idle")
    game.reset()
    game.states["side"], game.states["clock"] = 1, 3
    before = game.states[0].copy()
    game.states["position"][0, PUCK] = HALF_LENGTH, 0.0
    game.states["score"][0, LEFT], game.states["steps"], game.states["done"] = 1, 1, True
    if "terminated" not in told:
        game.states["done"], game.states["clock"] = False, 0
    assert check(before, game, np.zeros(CONTACT_ROWS, CONTACT), **told) == failure


def test_the_check_of_ranges_sees_what_it_is_for():
    game = Game(1, right="idle")
    assert laws.in_ranges(game.parameters[0], check_randomize(FULL_SIZE, {"length": (FULL_SIZE.length, 2.5)}))
    assert not laws.in_ranges(game.parameters[0], check_randomize(FULL_SIZE, {"length": (2.4, 2.5)}))
    assert not laws.in_ranges(game.parameters[0], check_randomize(FULL_SIZE, {"drag_linear": (0.1, 0.2)}))
