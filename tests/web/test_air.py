"""The air table's session without a browser: scenes, links, contacts, edits, bounds."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from airhockey_env import AirTable
from airhockey_env.air_table import METHODS
from airhockey_env.web.fan import PHASES, SECONDS
from airhockey_env.web.messages import Refused
from airhockey_env.web.scenes import FASTEST, MOST_PUCKS, SCENES, Puck, Scene
from airhockey_env.web.sessions.air import LONGEST
from tests.web.test_sessions import Ask, session

POOL = SCENES["pool_shot"]


def air(scene: Scene | str = POOL) -> Ask:
    """A session that shows a scene at 0 s."""
    raw = session("air", answer_seconds=10.0)

    def ask(message: str, now: float, **fields: Any) -> Any:
        answer = raw(message, now, **fields)
        return json.loads(answer) if isinstance(answer, bytes) else answer  # bytes are what took long

    ask("start", 0.0, scene=scene if isinstance(scene, str) else scene.text)
    return ask


def rows(state: dict[str, Any], method: str, what: str = "positions") -> np.ndarray:
    """The (N, 2) rows of one method."""
    n = len(state[what]) // len(METHODS)
    k = METHODS.index(method)
    return np.array(state[what][k * n : (k + 1) * n])


# Scenes


@pytest.mark.parametrize("name", SCENES)
def test_named_scenes_are_links_to_the_bit(name: str) -> None:
    scene = SCENES[name]
    assert Scene.parse(scene.text) == scene == Scene.parse(f"scene={name}")
    assert len(scene.text) <= LONGEST
    answer = air(f"scene={name}")("restart", 1.0)
    assert Scene.parse(answer["text"]) == scene
    assert [Puck(**puck) for puck in answer["pucks"]] == list(scene.pucks)


def test_the_longest_scene_fits_into_a_message() -> None:
    third = -100.0 / 3.0
    places = [(-0.9 + 0.2 * (k % 8) + 1e-16, 0.3 * (k // 8) - 1.0 / 3.0) for k in range(MOST_PUCKS)]
    scene = Scene(tuple(Puck(x, y, third, third, 1.0 / 30.0, 1.0 / 30.0) for x, y in places), tick=1.0 / 30.0)
    assert len(scene.text) <= LONGEST and air(scene)("restart", 0.0)["text"] == scene.text


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "pucks"),
        ("scene=nobody", "scene"),
        ("scene=pool_shot&tick=0.02", "scene"),
        ("pucks=0,0,0,0,0.05", "pucks"),
        ("pucks=0,0,0,0,0.05,nobody", "pucks"),
        ("pucks=0,0,0,0,nan,1", "radius"),
        ("pucks=0,0,0,0,0.05,inf", "mass"),
        (f"pucks=0,0,{2 * FASTEST},0,0.05,1", "vx"),
        ("pucks=3,0,0,0,0.05,1", "x of puck 1"),
        ("pucks=0.99,0,0,0,0.05,1", "positions.*puck 1"),
        ("pucks=0,0,0,0,0.05,1;0.01,0,0,0,0.05,1", "positions.*pucks 1 and 2"),  # counted as on the page
        ("pucks=0,0,0,0,0.05,1&tick=0", "tick"),
        ("pucks=0,0,0,0,0.05,1&restitution=1.1", "restitution"),
        ("pucks=0,0,0,0,0.05,1&tick=0.02&tick=0.02", "tick"),
        (";".join(["pucks=0,0,0,0,0.05,1"] * (MOST_PUCKS + 1)), "pucks"),
        ("x" * (LONGEST + 1), "scene"),
    ],
)
def test_links_that_are_none_end_the_session(text: str, named: str) -> None:
    with pytest.raises(Refused, match=named):
        session("air")("start", 0.0, scene=text)


# Contacts


def engine_contact(scene: Scene, method: str) -> tuple[float, np.void]:
    """The start of the tick, s, and the row of the first contact between pucks, from the engine alone."""
    table = scene.tables()[method]
    for _ in range(1000):
        before = table.time
        for contact in table.step(scene.tick):
            if contact["b"] >= 0:
                return before, contact
    raise AssertionError("no contact")


def shown_contact(ask: Ask, method: str) -> dict[str, Any]:
    """The first contact that the session tells of."""
    for k in range(200):
        for contact in ask("step", float(k), until_contact=True)["contacts"]:
            if contact["method"] == method:
                return contact
    raise AssertionError("no contact")


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.6])
@pytest.mark.parametrize("method", METHODS)
def test_the_triangles_are_the_engines(method: str, phase: float) -> None:
    scene = replace(POOL, phase=phase)
    before, row = engine_contact(scene, method)
    _, exact = engine_contact(scene, "continuous")
    told = shown_contact(air(scene), method)
    assert told["penetration_time"] == pytest.approx(scene.tick - exact["time"], abs=1e-12)
    assert told["ideal"] == pytest.approx(np.degrees(np.arctan2(exact["ny"], exact["nx"])), abs=1e-9)
    assert told["used"] == pytest.approx(np.degrees(np.arctan2(row["ny"], row["nx"])), abs=1e-9)
    assert told["hypotenuse"] == pytest.approx(sum(told["radii"]), abs=1e-12)  # that is what kissing means
    assert told["shared_leg"] ** 2 + told["top_leg"] ** 2 == pytest.approx(told["hypotenuse"] ** 2, abs=1e-12)
    assert told["shared_leg"] == pytest.approx(POOL.pucks[0].y, abs=1e-12)
    assert told["penetration_time"] * 3.0 == pytest.approx(np.subtract(told["end"], told["kiss"])[0], abs=1e-12)
    assert told["time"] == pytest.approx(before + exact["time"], abs=1e-12)
    _, approximate = engine_contact(scene, "overlap")
    if told["approximate"] is not None:
        assert told["approximate"] == pytest.approx(np.degrees(np.arctan2(approximate["ny"], approximate["nx"])))
        assert told["between"] == pytest.approx(abs(told["ideal"] - told["approximate"]))


@pytest.mark.parametrize("method", ["continuous", "kiss"])
@pytest.mark.parametrize("name", SCENES)
def test_every_contact_is_a_kiss_whatever_came_before_it_in_the_tick(name: str, method: str) -> None:
    ask, count = air(f"scene={name}"), 0
    for k in range(60):
        for told in ask("step", float(k))["contacts"]:
            if told["method"] == method and told["start"] is not None:
                reach = sum(told["radii"])
                if method == "kiss" and (told["contact_time"] == 0.0 or np.hypot(*told["start"]) < reach):
                    continue  # they overlapped already when the tick began
                count += 1
                assert told["hypotenuse"] == pytest.approx(reach, abs=1e-9)
                assert told["used"] == told["ideal"]
    assert count > 0 or (name, method) == ("tunnelling_at_speed", "kiss")


def test_a_contact_that_no_overlap_shows_has_no_approximate_normal() -> None:
    told = shown_contact(air(SCENES["tunnelling_at_speed"]), "continuous")
    assert told["approximate"] is None and told["between"] is None
    assert np.hypot(*told["end"]) > sum(told["radii"])


# Time


def test_tables_go_with_the_clock_and_show_parts_of_a_tick() -> None:
    ask = air()
    assert ask("speed", 0.0, speed=0.5) is None
    state = {}
    for k in range(13):
        state = ask("turn", k / 60)
    assert state["elapsed"] == pytest.approx(0.1) and state["ticks"] == 5 and state["playing"]
    exact = AirTable(*(np.array([[*p][i : i + 2] for p in POOL.pucks]) for i in (0, 2)), radii=0.05)
    exact.step(0.1)
    assert rows(state, "continuous") == pytest.approx(exact.positions, abs=1e-4)
    state = ask("turn", 0.2 + 0.01)
    assert state["ticks"] == 5 and rows(state, "kiss")[0, 0] > exact.positions[0, 0]
    assert ask("turn", 900.0)["elapsed"] == pytest.approx(0.105 + 0.05)  # and not minutes


def test_looking_changes_nothing() -> None:
    often, seldom = air(SCENES["reversal"]), air(SCENES["reversal"])
    for ask in (often, seldom):
        ask("speed", 0.0, speed=1.0)
    for k in range(1, 601):
        often("turn", k / 600)
        if k % 60 == 0:
            seldom("turn", k / 600)
    one, other = often("step", 1.0), seldom("step", 1.0)
    while one["ticks"] < other["ticks"]:
        one = often("step", 1.0)
    while other["ticks"] < one["ticks"]:
        other = seldom("step", 1.0)
    assert one["positions"] == other["positions"] and one["energy"] == other["energy"]


def test_time_is_turned_round() -> None:
    ask = air(SCENES["pool_shot"])
    for _ in range(12):
        ask("step", 0.0)
    assert ask("reverse", 0.0) is None
    state = {}
    for _ in range(12):
        state = ask("step", 0.0)
        assert state["ticks"] == 24 or state["returned"] is None
    returned = dict(zip(METHODS, state["returned"], strict=True))
    assert returned["continuous"] < 1e-12 < 1e-3 < returned["overlap"]


def test_the_clock_goes_back_with_time() -> None:
    ask = air(SCENES["pool_shot"])
    contact = shown_contact(ask, "continuous")
    before = ask("step", 0.0)["clock"]
    ask("reverse", 0.0)
    for ticks in (1, 2):
        assert ask("step", 0.0)["clock"] == pytest.approx(before - ticks * POOL.tick)
    ask("restart", 0.0)
    for _ in range(12):
        ask("step", 0.0)
    ask("reverse", 0.0)
    assert shown_contact(ask, "continuous")["time"] == pytest.approx(contact["time"], abs=1e-12)


def test_time_that_is_turned_round_again_and_again_comes_back_to_the_start() -> None:
    ask = air(SCENES["reversal"])
    for ticks in (10, 5, 5):
        for _ in range(ticks):
            ask("step", 0.0)
        ask("reverse", 0.0)
    states = [ask("step", 0.0) for _ in range(10)]
    assert [state["clock"] == pytest.approx(0.0) for state in states] == [False] * 9 + [True]
    assert [state["returned"] is not None for state in states] == [False] * 9 + [True]


def test_a_search_for_a_contact_ends_at_the_start() -> None:
    ask = air(Scene((Puck(-0.5, 0.0, -0.1), Puck(0.5, 0.0, 0.1))))
    for _ in range(5):
        ask("step", 0.0)
    ask("reverse", 0.0)
    state = ask("step", 0.0, until_contact=True)
    assert state["clock"] == pytest.approx(0.0) and state["returned"] == pytest.approx([0.0] * 3, abs=1e-12)


@pytest.mark.parametrize("name", SCENES)
def test_a_named_scene_keeps_its_name_unless_it_is_changed(name: str) -> None:
    ask = air(f"scene={name}")
    assert [ask("restart", 0.0)["name"], ask("settings", 0.0, phase=0.01)["name"]] == [name] * 2
    assert ask("settings", 0.0, tick=0.03)["name"] == ""


def test_energy_and_momentum_are_kept_until_the_wall() -> None:
    ask = air()
    state = {}
    for _ in range(14):
        state = ask("step", 0.0)
    assert state["energy"] == pytest.approx([4.5] * 3) and state["momentum"] == pytest.approx([3.0] * 3)


# What a person does


def test_a_puck_is_held_and_thrown() -> None:
    ask = air()
    ask("speed", 0.0, speed=1.0)
    state = {}
    for k in range(30):
        state = ask("turn", k / 60, hold=[1, 0.5, 0.3])
    for method in METHODS:
        assert rows(state, method)[1] == pytest.approx([0.5, 0.3], abs=1e-2)
    assert ask("throw", 0.5, puck=1, velocity=[-2.0, 1.0]) is None
    for method in METHODS:
        assert rows(ask("turn", 0.5), method, "velocities")[1].tolist() == [-2.0, 1.0]


def test_pucks_are_added_changed_and_removed() -> None:
    ask = air()
    ask("step", 0.0)
    answer = ask("add", 1.0, position=[0.5, -0.2], radius=0.1, mass=4.0)
    assert answer["pucks"][2] == {"x": 0.5, "y": -0.2, "vx": 0.0, "vy": 0.0, "radius": 0.1, "mass": 4.0}
    assert answer["pucks"][0]["x"] == pytest.approx(POOL.pucks[0].x + 0.06)  # as it is now, and time begins again
    assert answer["elapsed"] == 0.0 and answer["revision"] == "1"
    answer = ask("change", 2.0, puck=2, velocity=[1.0, 2.0], mass=2.0, method="kiss")
    assert answer["pucks"][2] == {"x": 0.5, "y": -0.2, "vx": 1.0, "vy": 2.0, "radius": 0.1, "mass": 2.0}
    answer = ask("remove", 3.0, puck=0)
    assert [puck["mass"] for puck in answer["pucks"]] == [1.0, 2.0]
    answer = ask("settings", 4.0, tick=0.05, restitution=0.5, phase=0.25)
    assert (answer["tick"], answer["restitution"], answer["phase"]) == (0.05, 0.5, 0.25)
    assert Scene.parse(answer["text"]).tick == 0.05
    assert air(answer["text"])("restart", 0.0)["pucks"] == answer["pucks"]


@pytest.mark.parametrize(
    ("kind", "fields", "named"),
    [
        ("add", {"position": [0.0, 0.0], "radius": 0.05, "mass": 1.0}, "positions"),
        ("add", {"position": [0.5, 0.0], "radius": 0.9, "mass": 1.0}, "radius"),
        ("change", {"puck": 0, "position": [0.999, 0.0]}, "positions"),
        ("change", {"puck": 0, "mass": 0.0}, "mass"),
        ("change", {"puck": 0, "velocity": [101.0, 0.0]}, "vx"),
        ("settings", {"tick": 1.0}, "tick"),
    ],
)
def test_mistakes_are_told_and_change_nothing(kind: str, fields: dict[str, Any], named: str) -> None:
    ask = air()
    answer = ask(kind, 1.0, **fields)
    assert answer["type"] == "note" and named in answer["text"]
    assert ask("restart", 1.0)["text"] == POOL.text


def test_pucks_and_contacts_are_bounded() -> None:
    places = [(-0.85 + 0.1 * (k % 8), -0.4 + 0.1 * (k // 8)) for k in range(MOST_PUCKS)]
    ask = air(Scene(tuple(Puck(x, y, 50.0, 1.0, 0.02) for x, y in places)))
    assert "pucks" in ask("add", 0.0, position=[0.8, 0.4], radius=0.05, mass=1.0)["text"]
    answer = ask("step", 0.0)
    assert len(answer["contacts"]) <= 12 and len(json.dumps(answer)) < 20_000


@pytest.mark.parametrize(
    "scene", [replace(POOL, restitution=0.5), Scene((Puck(0.0, 0.0, mass=0.1), Puck(0.5, 0.0, mass=100.0)))]
)
def test_scenes_that_may_have_many_contacts_hold_up_nobody(scene: Scene) -> None:
    ask = session("air")
    ask("start", 0.0, scene=scene.text)
    assert isinstance(ask("step", 0.0), bytes) and isinstance(ask("turn", 0.0), bytes)  # from another thread


def test_scenes_with_slow_ticks_are_played_in_another_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("airhockey_env.web.sessions.air.SLOW", -1.0)
    ask = session("air")
    ask("start", 0.0, scene="scene=pool_shot")
    assert ask("step", 0.0)["ticks"] == 1
    assert json.loads(ask("step", 0.0))["ticks"] == 2


def test_the_last_puck_stays() -> None:
    ask = air(Scene((Puck(0.0, 0.0),)))
    assert "pucks" in ask("remove", 0.0, puck=0)["text"]


@pytest.mark.parametrize(
    ("kind", "fields", "named"),
    [
        ("turn", {"hold": [2, 0, 0]}, "hold"),
        ("turn", {"hold": [0.5, 0, 0]}, "hold"),
        ("turn", {"hold": [0, 0]}, "hold"),
        ("turn", {"hold": [0, 1e5, 0]}, "hold"),
        ("throw", {"puck": 0, "velocity": [0, 11]}, "velocity"),
        ("speed", {"speed": 5.0}, "speed"),
        ("speed", {"speed": -1.0}, "speed"),
        ("remove", {"puck": 2}, "puck"),
        ("remove", {"puck": 0, "method": "magic"}, "method"),
        ("change", {"puck": 0, "position": "here"}, "position"),
        ("change", {"puck": 0, "colour": 1}, "colour"),
        ("settings", {"size": [1, 1]}, "size"),
        ("keep", {"method": 1}, "method"),
        ("reverse", {"until": 1.0}, "until"),
        ("fan", {"phases": 1000}, "phases"),
    ],
)
def test_what_no_page_sends_ends_the_session(kind: str, fields: dict[str, Any], named: str) -> None:
    with pytest.raises(Refused, match=named):
        air()(kind, 0.0, **fields)


@pytest.mark.parametrize("kind", ["turn", "step", "restart", "reverse", "throw", "settings", "keep", "fan"])
def test_nothing_can_be_done_before_a_scene(kind: str) -> None:
    with pytest.raises(Refused, match="start one first"):
        session("air")(kind, 0.0)


# The fan


def test_the_outcome_depends_on_the_phase_unless_the_method_is_exact() -> None:
    answer = air()("fan", 0.0)
    assert len(answer["phases"]) == PHASES
    assert answer["spread"]["continuous"] < 1e-12
    assert answer["spread"]["kiss"] < 1e-12  # slow enough to be seen at every phase
    assert answer["spread"]["overlap"] > 0.1
    table = POOL.tables()["continuous"]
    table.step(SECONDS)
    for paths in answer["paths"]["continuous"]:
        assert np.array(paths)[:, -1] == pytest.approx(table.positions, abs=1e-4)


def test_many_pucks_have_no_fan() -> None:
    assert air("scene=break_of_a_rack")("fan", 0.0)["type"] == "note"
