"""Robustness: which conditions are played, what is counted, and the command."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from agents.conditions import EXACT
from agents.measuring.evaluation import Result, play_points
from agents.measuring.held_out import held_out_conditions
from agents.measuring.robustness import GRIDS, LISTS, PARTS, Cell, conditions_of_part, measure, together
from tests.helpers import Call


@pytest.mark.parametrize("part", GRIDS)
def test_the_cells_of_a_grid(part: str) -> None:
    grid = GRIDS[part]()
    assert list(grid.cells) == [(down, across) for down in grid.down.values for across in grid.across.values]
    described = [json.dumps(conditions.as_dict()) for conditions in grid.cells.values()]
    assert len(set(described)) == len(described)


def test_the_grids_vary_what_they_say() -> None:
    camera = GRIDS["camera"]().cells[20, 4].camera
    assert camera is not None
    assert (camera.delay_ms, camera.noise_mm, camera.opponent_noise_mm) == (20, 4, 4)
    table = GRIDS["table"]().cells[0.25, 0.9].table
    assert (table.drag_linear, table.wall_restitution, table.wall_tangential) == (0.25, 0.9, 0.9)


def test_the_lists() -> None:
    assert conditions_of_part("held_out") == held_out_conditions()
    assert conditions_of_part("named")["full_size"] == EXACT


def test_a_cell_is_an_evaluation_under_its_conditions() -> None:
    players = {"one": "goalie", "two": "expert"}
    cells = [cell for _, cell in measure(players, "idle", 10, opponent_name="nobody", parts=["named"], seed=3)]
    assert [(cell.name, cell.player) for cell in cells] == [
        (name, player) for name in LISTS["named"]() for player in players
    ]
    for cell in cells[:6]:
        played = play_points(players[cell.player], "idle", 10, name="nobody", seed=3, conditions=cell.conditions)
        assert cell.result == played
        assert cell.conditions == LISTS["named"]()[cell.name]


def test_together() -> None:
    def cell(name: str, wins: int, losses: int) -> Cell:
        return Cell("held_out", name, "player", EXACT, Result("striker", wins, losses, 1, 1.0))

    summary = together([cell("a", 50, 50), cell("b", 90, 10), cell("c", 40, 60)])
    assert summary.mean == pytest.approx(0.6)
    reach = 1.96 * math.sqrt((0.25 + 0.09 + 0.24) / 100) / 3
    assert summary.interval == pytest.approx((0.6 - reach, 0.6 + reach), abs=1e-4)
    assert summary.worst.name == "c"
    undecided = together([cell("a", 50, 50), cell("b", 0, 0)])
    assert math.isnan(undecided.mean)
    assert undecided.worst.name == "a"


@pytest.mark.parametrize("only", [None, *PARTS])
def test_the_command(only: str | None, tmp_path: Path, call: Call) -> None:
    from PIL import Image

    arguments = ["--points", "2", "--json", "robust.json", "--plot", "robust.png", *(["--only", only] if only else [])]
    printed = call("robustness", "adept", "goalie", *arguments)
    written = json.loads((tmp_path / "robust.json").read_text(), parse_constant=pytest.fail)
    parts = PARTS if only is None else (only,)
    expected = [part for part in parts for _ in conditions_of_part(part)]
    assert [cell["part"] for cell in written["cells"][::2]] == expected
    assert {cell["player"] for cell in written["cells"]} == {"adept", "goalie"}
    assert set(written["together"]) == set(parts) & set(LISTS)
    assert all(cell["points"] == 2 and set(cell["conditions"]) == set(EXACT.as_dict()) for cell in written["cells"])
    assert "adept" in printed and "goalie" in printed
    with Image.open(tmp_path / "robust.png") as picture:
        assert min(picture.size) > 300
