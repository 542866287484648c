"""Tables: the presets' numbers, and what a `TableSpec` refuses."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from airhockey_env import PRESETS, AirHockeyEnv, Game, TableSpec
from airhockey_env.tables import CHALLENGE, FULL_SIZE, IDEAL, TABLES, resolve_table
from tests.api.apis import APIS
from tests.helpers import INF, NAN, begin, snapshot

FIELDS = [field.name for field in dataclasses.fields(TableSpec)]
SHARES = ["wall_restitution", "wall_tangential", "paddle_restitution"]
DRAGS = ["drag_constant", "drag_linear", "drag_quadratic"]

MEASURED = {
    "full_size": {
        "length": 2.362, "width": 1.144, "goal_width": 0.3345, "puck_radius": 0.0413, "puck_mass": 0.037,
        "paddle_radius": 0.0505, "wall_restitution": 0.785, "wall_tangential": 0.66, "paddle_restitution": 0.8,
        "drag_constant": 0.0145, "drag_linear": 0.0, "drag_quadratic": 0.0348,
    },
    "challenge": {
        "length": 1.948, "width": 1.038, "goal_width": 0.25, "puck_radius": 0.03165, "puck_mass": 0.010,
        "paddle_radius": 0.04815, "wall_restitution": 0.79, "wall_tangential": 0.84, "paddle_restitution": 0.8,
        "drag_constant": 0.0, "drag_linear": 0.5, "drag_quadratic": 0.0,
    },
    "ideal": {
        "length": 2.362, "width": 1.144, "goal_width": 0.3345, "puck_radius": 0.0413, "puck_mass": 0.037,
        "paddle_radius": 0.0505, "wall_restitution": 1.0, "wall_tangential": 1.0, "paddle_restitution": 1.0,
        "drag_constant": 0.0, "drag_linear": 0.0, "drag_quadratic": 0.0,
    },
}  # fmt: skip


def test_presets_are_the_measured_tables():
    assert PRESETS == {"full_size": FULL_SIZE, "challenge": CHALLENGE, "ideal": IDEAL}
    for name, numbers in MEASURED.items():
        spec = dataclasses.asdict(PRESETS[name])
        assert {field: spec[field] for field in numbers} == numbers


@pytest.mark.parametrize("spec", PRESETS.values(), ids=PRESETS)
def test_presets_keep_to_the_rules_and_to_people(spec):
    assert 2.0 * spec.paddle_radius <= 0.103  # greatest mallet that the rules allow
    hardest = (1.0 + FULL_SIZE.paddle_restitution) * spec.paddle_speed
    assert 8.0 < hardest < 9.7 < spec.puck_speed  # the hardest shot at a still puck; people's peak


@pytest.mark.parametrize("name", ["full_size", "challenge"])
def test_the_named_ranges_contain_the_measured_tables(name):
    for field, (low, high) in TABLES.items():
        assert low <= MEASURED[name][field] <= high


def glide(table, speed):
    return table["drag_constant"] + table["drag_linear"] * speed + table["drag_quadratic"] * speed**2


def test_the_named_ranges_cover_the_measured_drags_and_more():
    least, greatest = (glide({name: ends[side] for name, ends in TABLES.items()}, 2.0) for side in (0, 1))
    measured = [glide(MEASURED[name], 2.0) for name in ("full_size", "challenge")]
    assert measured[1] > 6.0 * measured[0]
    assert least < measured[0] and greatest > measured[1]


@pytest.mark.parametrize("api", APIS)
def test_every_api_draws_from_named_ranges(api):
    named, written = (APIS[api](randomize=ranges) for ranges in ("tables", TABLES))
    assert snapshot(begin(named)) == snapshot(begin(written))
    drawn = named.get_attr("table") if hasattr(named, "env_method") else named.table
    for table in drawn if isinstance(drawn, (list, tuple)) else [drawn]:
        for field in FIELDS:
            low, high = TABLES.get(field, (getattr(FULL_SIZE, field),) * 2)
            assert low <= getattr(table, field) <= high


def test_a_game_draws_from_named_ranges():
    named, written = (Game(3, randomize=ranges) for ranges in ("tables", TABLES))
    for game in (named, written):
        game.reset(seed=5)
    assert named.get_state().tobytes() == written.get_state().tobytes()
    assert named.table_of(0) != named.table_of(1)


@pytest.mark.parametrize("api", APIS)
def test_ranges_without_that_name(api):
    with pytest.raises(ValueError, match=r"^randomize .*'tables'.*'worlds'"):
        APIS[api](randomize="worlds")


@pytest.mark.parametrize("name", FIELDS)
def test_fields_refuse_what_no_table_has(name):
    if name in SHARES:
        bad, good = (-1e-9, 1.0 + 1e-9), (0.0, 1.0)
    else:
        bad, good = ((-1e-9,), (0.0,)) if name in DRAGS else ((0.0, -1e-300), ())
    for value in (*bad, NAN, INF, "1", True, None):
        with pytest.raises(ValueError, match=rf"^{name} .*got {value!r}"):
            dataclasses.replace(FULL_SIZE, **{name: value})
    for value in good:
        assert getattr(dataclasses.replace(FULL_SIZE, **{name: value}), name) == value


# Each limit between fields: what is just too much, and what just fits.
LIMITS = [
    ("goal_width", {"goal_width": 0.0826}, {"goal_width": 0.0827}),
    ("goal_width", {"width": 0.5, "goal_width": 0.4175}, {"width": 0.5, "goal_width": 0.417}),
    ("width", {"width": 0.18, "goal_width": 0.09, "paddle_radius": 0.049},
     {"width": 0.19, "goal_width": 0.09, "paddle_radius": 0.049}),
    ("length", {"length": 0.73}, {"length": 0.74}),
    ("paddle_radius", {"length": 2.0, "width": 1.2, "puck_radius": 0.01, "paddle_radius": 0.2},
     {"length": 2.0, "width": 1.2, "puck_radius": 0.01, "paddle_radius": 0.199}),
    ("puck_speed", {"puck_speed": 5.0}, {"puck_speed": 5.001}),
    ("puck_speed", {"paddle_speed": 12.0}, {"paddle_speed": 11.999}),
]  # fmt: skip


@pytest.mark.parametrize(("name", "bad", "good"), LIMITS)
def test_fields_must_fit_each_other(name, bad, good):
    with pytest.raises(ValueError, match=rf"^{name} "):
        dataclasses.replace(FULL_SIZE, **bad)
    dataclasses.replace(FULL_SIZE, **good)


@pytest.mark.parametrize("good", [good for _, _, good in LIMITS], ids=str)
@pytest.mark.parametrize("rate", [10, 240])
def test_tables_that_just_fit_can_be_played(good, rate):
    env = AirHockeyEnv(table=dataclasses.replace(FULL_SIZE, **good), control_hz=rate)
    rng = np.random.default_rng(1)
    observation, _ = env.reset(seed=1)
    for _ in range(300):
        assert observation in env.observation_space
        observation, _, over, _, _ = env.step(rng.uniform(-1.0, 1.0, 2))
        if over:
            observation, _ = env.reset()


def test_fields_are_floats():
    assert type(dataclasses.replace(FULL_SIZE, length=np.float32(2.0)).length) is float


def test_specs_are_frozen_values():
    with pytest.raises(dataclasses.FrozenInstanceError):
        FULL_SIZE.length = 3.0
    assert TableSpec(**dataclasses.asdict(FULL_SIZE)) == FULL_SIZE
    assert hash(FULL_SIZE) == hash(TableSpec(**dataclasses.asdict(FULL_SIZE)))
    heavier = dataclasses.replace(FULL_SIZE, puck_mass=0.05)
    assert heavier.puck_mass == 0.05 and heavier != FULL_SIZE and FULL_SIZE.puck_mass == 0.037


def test_tables_by_name_or_spec():
    assert resolve_table("challenge") is CHALLENGE
    own = dataclasses.replace(IDEAL, length=2.0)
    assert resolve_table(own) is own and AirHockeyEnv(table=own).table is own
    for bad in ("huge", "", None, 3, ["ideal"], {"length": 2.0}):
        with pytest.raises(ValueError, match=r"^table "):
            resolve_table(bad)


def test_tables_by_a_mapping_of_fields():
    for preset in PRESETS.values():
        assert resolve_table(dataclasses.asdict(preset)) == preset
    needed = {name: value for name, value in dataclasses.asdict(IDEAL).items() if "speed" not in name}
    assert resolve_table(needed) == IDEAL  # the others have defaults
    for name in ("length", "drag_linear"):
        with pytest.raises(ValueError, match=rf"^table .*'{name}'"):
            resolve_table({k: v for k, v in needed.items() if k != name})
    with pytest.raises(ValueError, match=r"^table .*'lenght'"):
        resolve_table({**needed, "lenght": 2.0})
    with pytest.raises(ValueError, match=r"^width "):
        resolve_table({**needed, "width": "1.0"})
