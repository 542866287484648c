"""Training runs that go on while they are watched: the newest policy, and the records so far."""

from __future__ import annotations

import contextlib
import json
import math
from pathlib import Path
from typing import Any

from airhockey_env.files import parse_json
from airhockey_env.opponents.policy import MlpPolicy

MOST_BYTES = 64 * 2**20
"""The largest evaluations.json that is read."""
MOST_ROWS = 400
"""Rows of a table of records that a page is given: about as many as it has pixels for."""


class Run:
    """The folder of a training run; its files are read again when they have changed.

    Args:
        folder: as a training command writes it: policy.npz, evaluations.json and config.json.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._policy: MlpPolicy | None = None
        self._policy_stamp: tuple[int, int] | None = None
        self._records: dict[str, Any] = {}
        self._records_stamp: tuple[int, int] | None = None

    def policy(self) -> tuple[MlpPolicy | None, float]:
        """The newest policy, None before there is one; and when it was written, s since 1970.

        A file that cannot be read (it is being replaced by hand, say) leaves the last policy that could.
        """
        path = self.folder / "policy.npz"
        stamp = _stamp(path)
        if stamp is not None and stamp != self._policy_stamp:
            with contextlib.suppress(OSError, ValueError):
                self._policy, self._policy_stamp = MlpPolicy.load(path), stamp
        return self._policy, (self._policy_stamp or (0, 0))[0] * 1e-9

    def records(self) -> dict[str, Any]:
        """What the run has recorded: {"goal": steps of the whole run or None, "evaluations": rows, "updates": rows}.

        Rows are objects with `steps` and further numbers, or pairs of numbers (intervals); of many rows, some.
        """
        path = self.folder / "evaluations.json"
        stamp = _stamp(path)
        if stamp != self._records_stamp:
            read = _read_json(path)
            if read or not self._records:
                tables = {name: _rows(read.get(name)) for name in ("evaluations", "updates")}
                self._records = {"goal": _goal(self.folder / "config.json"), **tables}
                self._records_stamp = stamp
        return self._records or {"goal": _goal(self.folder / "config.json"), "evaluations": [], "updates": []}


def _stamp(path: Path) -> tuple[int, int] | None:
    """Tells a file from one that has replaced it: time, ns, and size."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size


def _read_json(path: Path) -> dict[str, Any]:
    """The object in a file; empty if there is none, or the file is being written."""
    try:
        if path.stat().st_size > MOST_BYTES:
            return {}
        content = parse_json(path.read_text(encoding="utf-8"), constants=True)
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def _goal(config: Path) -> int | None:
    steps = _read_json(config).get("steps")
    return steps if type(steps) is int else None


def _rows(table: Any) -> list[dict[str, Any]]:
    """The numbers in the rows of a table, of at most `MOST_ROWS` of them: the last one, and others evenly."""
    rows = [row for row in table if isinstance(row, dict)] if isinstance(table, list) else []
    if len(rows) > MOST_ROWS:
        rows = [rows[(k + 1) * len(rows) // MOST_ROWS - 1] for k in range(MOST_ROWS)]
    return [{name: value for name, value in row.items() if _is_plain(value)} for row in rows]


def _is_plain(value: Any) -> bool:
    """Return whether a value is a finite number or a short list of finite numbers."""
    if isinstance(value, list):
        return len(value) <= 4 and all(_is_plain(one) and not isinstance(one, list) for one in value)
    return type(value) in (int, float) and math.isfinite(value) and len(json.dumps(value)) < 30
