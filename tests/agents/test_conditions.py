"""Conditions of play: what the options mean, what a run keeps of them, and who plays under them."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents.conditions import EXACT, Conditions, in_words
from agents.measuring.evaluation import play_points
from airhockey_env.cameras import ROBOT, Camera
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, RIGHT
from airhockey_env.tables import CHALLENGE, FIELDS, FULL_SIZE, TABLES


@dataclass(frozen=True)
class Options:
    """The options that commands share, with their defaults."""

    table: str = "full_size"
    randomize: str | None = None
    camera: str | None = None
    action_delay_ms: tuple[float, ...] = (0.0,)


def written(path: Path, fields: Mapping[str, Any]) -> str:
    """The name of a file of fields; YAML is easy to write for numbers by name."""
    lines = [f"{name}: {list(value) if isinstance(value, tuple) else value}" for name, value in fields.items()]
    path.write_text(json.dumps(fields) if path.suffix == ".json" else "\n".join(lines))
    return str(path)


def test_the_defaults() -> None:
    assert Conditions.of_options(Options()) == EXACT == Conditions()
    assert not EXACT.env_arguments()


def test_presets() -> None:
    conditions = Conditions.of_options(Options("challenge", "tables", "robot"))
    assert conditions == Conditions(CHALLENGE, TABLES, ROBOT)
    assert conditions.env_arguments().keys() == {"table", "randomize", "camera"}


@pytest.mark.parametrize("suffix", [".json", ".yml", ".yaml"])
def test_files(suffix: str, tmp_path: Path) -> None:
    conditions = Conditions.of_options(
        Options(
            written(tmp_path / f"table{suffix}", dataclasses.asdict(CHALLENGE)),
            written(tmp_path / f"ranges{suffix}", {"length": (1.9, 2), "drag_linear": (0.1, 0.2)}),
            written(tmp_path / f"camera{suffix}", {"delay_ms": 20, "noise_mm": (1.5, 2)}),
        )
    )
    assert conditions.table == CHALLENGE
    assert conditions.randomize == {"length": (1.9, 2.0), "drag_linear": (0.1, 0.2)}
    assert conditions.camera == Camera(delay_ms=20, noise_mm=(1.5, 2))


@pytest.mark.parametrize(
    ("option", "fields", "told"),
    [
        ("table", {"length": 2.0}, "without"),
        ("table", {**dataclasses.asdict(FULL_SIZE), "width": -1}, "width"),
        ("table", {**dataclasses.asdict(FULL_SIZE), "colour": 1}, "colour"),
        ("randomize", {"length": 2}, "length"),
        ("randomize", {"length": (3, 2)}, "length"),
        ("randomize", {"colour": (1, 2)}, "colour"),
        ("randomize", {"goal_width": (0.01, 0.02)}, "goal_width"),
        ("camera", {"delay_ms": -1}, "delay_ms"),
        ("camera", {"zoom": 2}, "zoom"),
    ],
)
@pytest.mark.parametrize("suffix", [".json", ".yml"])
def test_other_contents(option: str, fields: dict[str, Any], told: str, suffix: str, tmp_path: Path) -> None:
    name = written(tmp_path / f"given{suffix}", fields)
    with pytest.raises(ValueError, match=f"--{option} ") as error:
        Conditions.of_options(Options(**{option: name}))
    assert name in str(error.value)
    assert told in str(error.value)


@pytest.mark.parametrize("text", ["[1, 2]", "{", "1: 2", "&a [*a]", "\x00"])
@pytest.mark.parametrize("suffix", [".json", ".yml"])
@pytest.mark.parametrize("option", ["table", "randomize", "camera"])
def test_a_damaged_file(option: str, suffix: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / f"given{suffix}"
    path.write_text(text)
    with pytest.raises(ValueError, match=f"--{option}") as error:
        Conditions.of_options(Options(**{option: str(path)}))
    assert str(path) in str(error.value)


@pytest.mark.parametrize("suffix", [".json", ".yml"])
def test_a_huge_file(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"given{suffix}"
    path.write_text(" " * 2**21)
    with pytest.raises(ValueError, match="1,048,576"):
        Conditions.of_options(Options(table=str(path)))


def test_aliases_that_grow(tmp_path: Path) -> None:
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 9)]
    path = tmp_path / "laughs.yml"
    path.write_text("\n".join(lines))
    with pytest.raises(ValueError, match="10,000"):
        Conditions.of_options(Options(randomize=str(path)))


@pytest.mark.parametrize("delay", [(), (1.0, 2.0, 3.0), (-1.0,), (2.0, 1.0), (float("nan"),), (1e6,)])
def test_delays(delay: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="--action-delay-ms"):
        Conditions.of_options(Options(action_delay_ms=delay))
    assert Conditions.of_options(Options(action_delay_ms=(5.0, 9.0))).action_delay_ms == (5.0, 9.0)


def test_what_a_run_keeps() -> None:
    for options in (Options(), Options("challenge", "tables", "robots", (3.0, 4.0)), Options(action_delay_ms=(2.0,))):
        conditions = Conditions.of_options(options)
        kept = json.loads(json.dumps(conditions.as_dict()))
        assert Conditions.of_dict(kept) == conditions
    for damaged in ({}, {**kept, "table": {}}, {**kept, "camera": {"zoom": 1}}, {**kept, "more": 1}):
        with pytest.raises(ValueError, match=r"conditions|table|camera"):
            Conditions.of_dict(damaged)


def test_drawn() -> None:
    table = Conditions(CHALLENGE, {"length": (2.0, 2.2)}).drawn(seed=1).table
    assert 2.0 < table.length < 2.2
    assert dataclasses.replace(table, length=CHALLENGE.length) == CHALLENGE
    assert EXACT.drawn() == EXACT


def test_in_words() -> None:
    assert in_words(Options()) == "full_size table"
    said = in_words(Options("a/b.json", "tables", "robot", (1.0, 2.5)))
    assert all(part in said for part in ("b.json table", "tables", "robot", "1 to 2.5 ms"))


class TestWhoPlaysUnderThem:
    camera = Conditions(camera=Camera(delay_ms=500, noise_mm=100))

    @pytest.mark.parametrize("seat", [LEFT, RIGHT])
    def test_only_the_given_seats_have_the_camera(self, seat: int) -> None:
        game = Game(3, left=None, right=None, **self.camera.game_arguments(seat))
        game.reset(seed=0)
        for _ in range(10):
            game.step(np.ones((3, 2)), -np.ones((3, 2)))
        seen = [np.array_equal(game.observations(side), game.exact_observations(side)) for side in (LEFT, RIGHT)]
        assert seen[seat] is False
        assert seen[1 - seat] is True

    def test_the_evaluated_player_and_not_its_opponent(self) -> None:
        """A camera that shows next to nothing costs the player that has it most of its points."""
        one, both = (
            play_points("expert", "expert", 200, conditions=self.camera, shared=shared) for shared in (False, True)
        )
        assert one.losses > 2 * one.wins
        assert both.wins * 2 > both.losses

    def test_the_table(self) -> None:
        specs = []

        def observer(game: Game, own: int) -> Any:
            specs.extend(game.table_of(k) for k in range(game.num_tables))
            return lambda running: None

        play_points("idle", "striker", 4, conditions=Conditions(CHALLENGE), observer=observer)
        assert set(specs) == {CHALLENGE}
        specs.clear()
        play_points("idle", "striker", 4, conditions=Conditions(randomize=TABLES), observer=observer)
        assert len(set(specs)) == 4
        for name in FIELDS:
            low, high = TABLES.get(name, (getattr(FULL_SIZE, name),) * 2)
            assert all(low <= getattr(spec, name) <= high for spec in specs)
