"""Tables and cameras for evaluation only: each is plausible, and lies outside of every range that agents train on.

held_out.json lists them with what they stand for. Do not train on them, and do not choose between agents by them.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from agents.conditions import Conditions
from agents.files import read_json
from airhockey_env.cameras import ROBOT, Camera
from airhockey_env.tables import PRESETS, TableSpec

FILE = Path(__file__).with_name("held_out.json")


def held_out_tables() -> dict[str, TableSpec]:
    """The held-out tables by name."""
    return {
        name: dataclasses.replace(PRESETS[entry["preset"]], **entry["fields"])
        for name, entry in _read("tables").items()
    }


def held_out_cameras() -> dict[str, Camera]:
    """The held-out cameras by name."""
    return {name: Camera(**entry["fields"]) for name, entry in _read("cameras").items()}


def held_out_conditions() -> dict[str, Conditions]:
    """Every held-out table through the camera `ROBOT`, and every held-out camera on the full-size table, by name."""
    return {
        **{name: Conditions(table, camera=ROBOT) for name, table in held_out_tables().items()},
        **{name: Conditions(camera=camera) for name, camera in held_out_cameras().items()},
    }


def reasons() -> dict[str, str]:
    """What each of the tables and cameras stands for, by name."""
    return {name: entry["why"] for part in ("tables", "cameras") for name, entry in _read(part).items()}


def _read(part: str) -> dict[str, Any]:
    return read_json(FILE, {part: {}})[part]
