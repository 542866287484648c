"""Tables in the terminal fit it, and break neither words nor numbers."""

from __future__ import annotations

import numpy as np
import pytest

from agents.measuring.evaluation import Result, TaskResult
from agents.measuring.ladder import Match, rate
from agents.measuring.ladder_report import print_ladder
from agents.tables import print_table
from agents.training.report import print_results, print_task_result

HEADS = {
    "batches": ["environments", "gym.make_vec", "its compiled step alone", "the same game in C", "CartPole-v1, EnvPool",
                "CartPole-v1, Gymnasium's own batch", "CartPole-v1, SyncVectorEnv", "compiled step relative to C"],
    "pucks": ["pucks", *(f"{name}, {many} moving, µs a tick" for many in ("all", "two")
                         for name in ("AirTable", "Box2D", "Chipmunk", "MuJoCo"))],
}  # fmt: skip


def printed(capsys: pytest.CaptureFixture[str], columns: int) -> list[str]:
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= columns
    assert not any("…" in line for line in lines)
    return [word for line in lines for word in line.split()]


@pytest.mark.parametrize("columns", [80, 100])
@pytest.mark.parametrize("name", HEADS)
def test_wide_tables_are_cut_between_columns(
    name: str, columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    random = np.random.default_rng(0)
    rows = [[str(2**row), *(f"{x:,.0f}" for x in random.uniform(1e6, 9e6, len(HEADS[name]) - 1))] for row in range(6)]
    print_table("Thousand steps/s", [HEADS[name], *rows])
    words = printed(capsys, columns)
    expected = [word for cell in (*HEADS[name], *(cell for row in rows for cell in row)) for word in cell.split()]
    assert set(expected) <= set(words)


def test_long_texts_are_wrapped_between_words(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    text = "within gym.make: calling the compiled step, which is a text that is longer than it has to be"
    print_table("One table", [["what", "steps/s", "µs a step"], [text, "1,000,000", "2.0 (37%)"]])
    assert set(text.split()) <= set(printed(capsys, 80))


def test_reports(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    print_results([Result(name, 99_999, 0, 0, 12.5) for name in ("striker", "my_players:chaser")], "full_size table")
    print_task_result(TaskResult("defend", 100_000, 0, 0, 2.5), "full_size table")
    words = printed(capsys, 80)
    assert {"opponent", "losses", "s/point", "99999", "(100.0-100.0)", "striker", "my_players:chaser"} <= set(words)
    names = ["striker", "a-run-with-a-rather-long-name", *(f"player-{k}" for k in range(14))]
    matches = [Match(a, Result(b, 1000, 0, 0, 1.0)) for k, a in enumerate(names) for b in names[k + 1 :]]
    monkeypatch.setattr("agents.measuring.ladder.SAMPLES", 50)
    print_ladder(rate(names, matches), matches)
    words = printed(capsys, 80)
    assert words.count("player-13") >= 3, "in the ratings, and in each part of the cross table"
    assert words.count("100.0") >= 100
