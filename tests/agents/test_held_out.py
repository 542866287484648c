"""Tables and cameras that no training range contains."""

from __future__ import annotations

import json

import pytest

from agents.measuring.held_out import FILE, held_out_cameras, held_out_conditions, held_out_tables, reasons
from airhockey_env.cameras import CAMERAS
from airhockey_env.tables import TABLE_RANGES
from tests.helpers import ROOT


@pytest.mark.parametrize("ranges", TABLE_RANGES)
@pytest.mark.parametrize("name", held_out_tables())
def test_no_range_contains_a_held_out_table(name: str, ranges: str) -> None:
    table = held_out_tables()[name]
    assert any(not low <= getattr(table, field) <= high for field, (low, high) in TABLE_RANGES[ranges].items())


@pytest.mark.parametrize("camera", CAMERAS)
@pytest.mark.parametrize("name", held_out_cameras())
def test_no_named_camera_contains_a_held_out_camera(name: str, camera: str) -> None:
    held_out, ends = held_out_cameras()[name].fields(), CAMERAS[camera].ends()
    assert any(not low <= held_out[field] <= high for field, (low, high) in ends.items())


def test_the_page_describes_all_of_them() -> None:
    page = (ROOT / "docs" / "robustness.md").read_text(encoding="utf-8")
    for name, why in reasons().items():
        assert f"| `{name}` | {why.removesuffix('.')} |" in page


def test_the_file() -> None:
    entries = json.loads(FILE.read_text(encoding="utf-8"))
    names = [*entries["tables"], *entries["cameras"]]
    assert len(set(names)) == len(names)
    assert list(held_out_conditions()) == list(reasons()) == names
    assert all(len(why) > 20 for why in reasons().values())
    assert 4 <= len(held_out_tables()) <= 6 and 4 <= len(held_out_cameras()) <= 6
