"""Aggregates over runs that differ in their seeds."""

from __future__ import annotations

from typing import Any

import pytest

from agents.measuring.evaluation import Result
from agents.training.across_seeds import bootstrap_interval, interquartile_mean, last_result, print_ends


def evaluation(wins: int, losses: int, seconds: float) -> dict[str, Any]:
    return {"steps": 1, "seconds": seconds, **Result("striker", wins, losses, 0, 5.0).as_dict()}


def test_interquartile_mean_leaves_out_a_quarter_at_each_end() -> None:
    assert interquartile_mean([0.0, 0.5, 0.6, 0.7, 99.0]) == pytest.approx(0.6)
    assert interquartile_mean([3.0, 1.0]) == pytest.approx(2.0)
    assert list(interquartile_mean([[0.0, 1.0, 2.0, 9.0], [5.0] * 4])) == [1.5, 5.0]


def test_bootstrap_interval_contains_the_mean_and_lies_within_the_values() -> None:
    values = [0.9, 0.92, 0.95, 0.97, 0.98]
    low, high = bootstrap_interval(values)
    assert 0.9 <= low < interquartile_mean(values) < high <= 0.98
    assert bootstrap_interval([0.9] * 5) == pytest.approx((0.9, 0.9))


def test_the_end_is_the_report_if_there_is_one() -> None:
    run = {"evaluations": [evaluation(1, 1, 60.0)], "report": [Result("idle", 9, 0, 0, 5.0).as_dict()]}
    assert last_result(run)["wins"] == 1
    run["report"].append(Result("striker", 8, 2, 0, 5.0).as_dict())
    assert last_result(run)["wins"] == 8


def test_ends_are_printed_with_the_times_at_which_levels_were_reached(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [evaluation(0, 0, 0.0), evaluation(91, 9, 90.0), evaluation(80, 20, 150.0), evaluation(98, 2, 180.0)]
    print_ends({"one": {"seed": 0, "evaluations": rows}, "two": {"seed": 1, "evaluations": rows[:3]}})
    printed = capsys.readouterr().out
    for word in ("1.5", "3.0", "never", "98.0%", "median 89.0%", "worst 80.0%"):
        assert word in printed
