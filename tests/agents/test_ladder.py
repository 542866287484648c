"""The ladder: ratings from results, and results from play."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from agents.measuring import ladder
from agents.measuring.evaluation import OPPONENTS, Result, play_points
from agents.measuring.ladder import (
    ANCHOR,
    ANCHOR_RATING,
    Match,
    cross_table,
    expected_scores,
    find_players,
    play_ladder,
    rate,
)
from airhockey_env.opponents.policy import MlpPolicy
from tests.helpers import Call


@pytest.fixture(autouse=True)
def few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ladder, "SAMPLES", 100)  # quickly


STRENGTHS = {"striker": 1000.0, "good": 1250.0, "weak": 800.0, "weaker": 650.0}


def chaser(slope: float) -> MlpPolicy:
    """Straight at the puck, from observation 8 and 9 less 0 and 1."""
    weights = np.zeros((2, 13), np.float32)
    weights[[0, 1], [8, 9]], weights[[0, 1], [0, 1]] = slope, -slope
    return MlpPolicy([weights], [np.zeros(2, np.float32)])


def expected_score(first: float, second: float) -> float:
    return 1.0 / (1.0 + 10.0 ** ((second - first) / 400.0))


def exact_matches(points: int, drawn: float) -> list[Match]:
    """Results that are what the strengths say, a share of the points that both could win drawn."""
    matches = []
    for first, second in combinations(STRENGTHS, 2):
        score = expected_score(STRENGTHS[first], STRENGTHS[second])
        draws = round(points * drawn * min(score, 1.0 - score))
        wins = round(points * score - 0.5 * draws)
        matches.append(Match(first, Result(second, wins, points - wins - draws, draws, 1.0)))
    return matches


@pytest.mark.parametrize("drawn", [0.0, 0.5])
def test_known_strengths_are_found(drawn: float) -> None:
    ratings = rate(list(STRENGTHS), exact_matches(100_000, drawn))
    assert [row.player for row in ratings] == ["good", "striker", "weak", "weaker"]
    for row in ratings:
        assert row.rating == pytest.approx(STRENGTHS[row.player], abs=0.5)
        assert row.low <= STRENGTHS[row.player] <= row.high
        assert row.points == 300_000
        assert row.high - row.low < 12.0
    scores = cross_table([row.player for row in ratings], exact_matches(100_000, drawn))
    off_diagonal = ~np.eye(4, dtype=bool)
    np.testing.assert_allclose(scores[off_diagonal], expected_scores(ratings)[off_diagonal], atol=1e-3)


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    random = np.random.default_rng(0)
    held = []
    for _ in range(20):
        matches = []
        for first, second in combinations(STRENGTHS, 2):
            wins = int(random.binomial(200, expected_score(STRENGTHS[first], STRENGTHS[second])))
            matches.append(Match(first, Result(second, wins, 200 - wins, 0, 1.0)))
        rows = rate(list(STRENGTHS), matches)
        held += [row.low <= STRENGTHS[row.player] <= row.high for row in rows if row.player != ANCHOR]
    assert 0.85 <= np.mean(held) < 1.0


def test_who_wins_everything_is_rated() -> None:
    matches = [Match("a", Result("b", 100, 0, 0, 1.0)), Match("a", Result("c", 100, 0, 0, 1.0))]
    matches.append(Match("b", Result("c", 50, 50, 0, 1.0)))
    first, *others = rate(["a", "b", "c"], matches)
    assert first.player == "a"
    assert all(first.low > other.high for other in others)
    assert 300.0 < first.high - first.low < 2000.0
    assert first.rating - others[0].rating > 600.0
    many = [Match("a", Result("b", 10_000, 0, 0, 1.0)), Match("a", Result("c", 10_000, 0, 0, 1.0)), matches[2]]
    more = rate(["a", "b", "c"], many)[0]
    assert more.low > first.rating, "10,000 points won say more than 100"


def test_draws_are_half_wins_and_bring_no_spread() -> None:
    drawn = rate(["a", "b"], [Match("a", Result("b", 0, 0, 400, 1.0))])
    shared = rate(["a", "b"], [Match("a", Result("b", 200, 200, 0, 1.0))])
    assert [row.rating for row in drawn] == pytest.approx([ANCHOR_RATING] * 2)
    assert [row.rating for row in shared] == pytest.approx([ANCHOR_RATING] * 2)
    assert drawn[0].high - drawn[0].low < 0.5 * (shared[0].high - shared[0].low)


def test_anchor() -> None:
    matches = [Match("striker", Result("b", 90, 10, 0, 1.0))]
    striker, other = rate(["striker", "b"], matches)
    assert striker.rating == striker.low == striker.high == ANCHOR_RATING
    assert other.rating < other.high < ANCHOR_RATING
    without = rate(["a", "b"], [Match("a", matches[0].result)])
    assert np.mean([row.rating for row in without]) == pytest.approx(ANCHOR_RATING)
    assert without[0].rating - without[1].rating == pytest.approx(striker.rating - other.rating)


def test_pairs_that_have_not_met_are_rated_over_others() -> None:
    matches = [Match("a", Result("b", 75, 25, 0, 1.0)), Match("b", Result("c", 75, 25, 0, 1.0))]
    ratings = rate(["a", "b", "c"], matches)
    assert [row.player for row in ratings] == ["a", "b", "c"]
    assert np.isnan(cross_table(["a", "b", "c"], matches)[0, 2])


def test_everybody_plays_everybody_and_policies_each_other() -> None:
    players = {"fast": chaser(9.0), "slow": chaser(0.05), "goalie": "goalie"}
    matches = [match for _, match in play_ladder(players, 6, seed=3)]
    assert [(match.player, match.result.opponent) for match in matches] == list(combinations(players, 2))
    for match in matches:
        assert match.result.points == 6
        names = match.player, match.result.opponent
        assert match.result == play_points(*(players[name] for name in names), 6, name=names[1], seed=3)
    assert matches[0].result.draws < 6


def test_policies_on_both_sides_are_treated_alike() -> None:
    policy = chaser(2.0)
    result = play_points(policy, policy, 400)
    assert result.wins + result.losses > 100
    assert abs(result.wins - result.losses) < 4.0 * (result.wins + result.losses) ** 0.5


def test_who_plays(tmp_path: Path) -> None:
    for name in ("one", "two", "other/one"):
        folder = tmp_path / name
        folder.mkdir(parents=True)
        chaser(1.0).save(folder / "policy.npz")
    two = str(tmp_path / "two")
    assert list(find_players([])) == list(OPPONENTS)
    assert list(find_players([two, "goalie"])) == [*OPPONENTS, "two"]
    assert list(find_players([two, "goalie"], only=True)) == ["two", "goalie"]
    twins = [str(tmp_path / "one" / "policy.npz"), str(tmp_path / "other" / "one")]
    assert list(find_players(twins, only=True)) == twins


def test_the_command(tmp_path: Path, call: Call) -> None:
    from PIL import Image

    chaser(2.0).save(tmp_path / "chaser.npz")
    arguments = ("--points", "4", "--json", "ladder.json", "--plot", "ladder.png")
    printed = call("ladder", "--only", "striker", "random", "chaser.npz", *arguments)
    written = json.loads((tmp_path / "ladder.json").read_text(), parse_constant=pytest.fail)
    assert {row["player"] for row in written["ratings"]} == {"striker", "random", "chaser.npz"}
    assert all(row["player"] in printed for row in written["ratings"])
    values = [row["rating"] for row in written["ratings"]]
    assert values == sorted(values, reverse=True)
    assert all(row["low"] <= row["rating"] <= row["high"] for row in written["ratings"])
    assert len(written["matches"]) == 3 and all(match["points"] == 4 for match in written["matches"])
    with Image.open(tmp_path / "ladder.png") as picture:
        assert min(picture.size) > 300
    assert not list(tmp_path.glob(".part*"))


def test_ctrl_c_rates_what_was_played(tmp_path: Path, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    matches = iter(range(2))

    def two_matches(*arguments: object, **options: object) -> Result:
        if next(matches, None) is None:
            raise KeyboardInterrupt
        return Result(str(options["name"]), 7, 2, 1, 1.0)

    monkeypatch.setattr(ladder, "play_points", two_matches)
    printed = call("ladder", "--json", "ladder.json", "--plot", "ladder.png", fails=True)
    pairs = len(OPPONENTS) * (len(OPPONENTS) - 1) // 2
    assert f"Stopped after 2 of {pairs} matches." in printed
    assert len(json.loads((tmp_path / "ladder.json").read_text())["matches"]) == 2
    assert (tmp_path / "ladder.png").exists()
    assert call("ladder", "--json", "none.json", fails=True).strip() == "Stopped."
    assert not (tmp_path / "none.json").exists()


@pytest.mark.parametrize("players", [(), ("goalie", "goalie")])
def test_one_player_is_no_ladder(players: tuple[str, ...], call: Call) -> None:
    assert str(list(dict.fromkeys(players))) in call("ladder", "--only", *players, fails=True)
