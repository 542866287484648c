"""The ladder: every player plays every other, and the results become ratings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.conditions import EXACT, Conditions
from agents.measuring.evaluation import OPPONENTS, Result, play_points
from agents.models import Player, load_players
from agents.spread import spread

ELO = 400.0 / math.log(10.0)
"""Elo points for a factor of e in the odds: 400 points are odds of 10 to 1 (A. E. Elo, The Rating of Chessplayers)."""

ANCHOR, ANCHOR_RATING = "striker", 1000.0
"""The player whose rating is fixed, because results only determine differences."""

PRIOR = 0.5
"""Wins, losses and draws that are added to each pair (Jeffreys' prior of the three shares). It keeps ratings finite
when one player wins everything, and is negligible beside hundreds of points."""

SAMPLES = 1000
"""Number of samples of the ratings from which the intervals are computed."""


@dataclass(frozen=True)
class Match:
    """Points between two players, half of them on each side of the table."""

    player: str
    result: Result  # of `player`, against `result.opponent`

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return {"player": self.player, **self.result.as_dict()}


@dataclass(frozen=True)
class Rating:
    """One player's place on the ladder."""

    player: str
    rating: float  # Elo points
    low: float  # 95 % interval
    high: float
    wins: int
    losses: int
    draws: int

    @property
    def points(self) -> int:
        return self.wins + self.losses + self.draws

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return {**asdict(self), "points": self.points}


def find_players(models: Sequence[str], only: bool = False, trust: bool = False) -> dict[str, Player]:
    """Load the players of a ladder, keyed by the names that tables and plots show.

    Args:
        models: see `load_players`.
        only: leave out the named opponents that are not among `models`.
        trust: see `load_players`.

    Raises:
        FileNotFoundError, ValueError: see `load_players`; also if there are fewer than two players.
    """
    given = list(dict.fromkeys((*(() if only else OPPONENTS), *models)))
    if len(given) < 2:
        raise ValueError(f"a ladder needs two or more different players, got {given}")
    return load_players(given, trust)


def play_ladder(
    players: Mapping[str, Player],
    points: int,
    *,
    seed: int = 0,
    conditions: Conditions = EXACT,
    workers: int | None = None,
    address: str | None = None,
) -> Iterator[tuple[int, Match]]:
    """Let every player play every other; yield the matches as they end, each with its place in the order of the pairs.

    A match is a call of `play_points` with the same arguments, so it does not depend on the other players. Both players
    of a match play under the conditions.

    Args:
        players: by name, as `find_players` returns them.
        points, seed, conditions: as in `play_points`.
        workers, address: see `agents.spread.spread`. The results do not depend on them.
    """
    play = partial(_play_match, players, points, seed, conditions)
    yield from spread(play, combinations(players, 2), workers, address)


def _play_match(
    players: Mapping[str, Player], points: int, seed: int, conditions: Conditions, pair: tuple[str, str]
) -> Match:
    first, second = pair
    result = play_points(
        players[first], players[second], points, name=second, seed=seed, conditions=conditions, shared=True
    )
    return Match(first, result)


def rate(names: Sequence[str], matches: Sequence[Match]) -> list[Rating]:
    """Ratings of the Bradley-Terry model (Biometrika 39, 1952), best first.

    A player of rating r beats one of rating s with odds of 10 ** ((r - s) / 400), and a draw counts as half a win for
    each. The ratings maximize the likelihood, including `PRIOR`. The intervals are the central 95 % of the ratings for
    `SAMPLES` samples of every pair's shares of wins, losses and draws from their posterior distribution. Draws
    therefore do not widen them, and a player that wins everything has an interval too. The rating of `ANCHOR`, or
    without it the mean, is `ANCHOR_RATING`.
    """
    place = {name: k for k, name in enumerate(names)}
    pairs = np.array(list(combinations(range(len(names)), 2)))
    counts = np.full((len(names), len(names), 3), PRIOR)
    for match in matches:
        i, j, result = place[match.player], place[match.result.opponent], match.result
        outcome = np.array([result.wins, result.losses, result.draws], np.float64)
        counts[i, j] += outcome
        counts[j, i] += outcome[[1, 0, 2]]
    played = counts[pairs[:, 0], pairs[:, 1]]
    samples = np.random.default_rng(0).gamma(played, size=(SAMPLES, *played.shape))  # scaled, they are Dirichlet's
    samples *= (played.sum(-1) / samples.sum(-1))[..., np.newaxis]
    anchor = place.get(ANCHOR)
    ratings = _ratings(len(names), pairs, played, anchor)
    low, high = np.percentile([_ratings(len(names), pairs, sample, anchor) for sample in samples], [2.5, 97.5], axis=0)
    totals = (counts - PRIOR)[~np.eye(len(names), dtype=bool)].reshape(len(names), -1, 3).sum(1).astype(int).tolist()
    return [
        Rating(names[k], float(ratings[k]), float(low[k]), float(high[k]), *totals[k]) for k in np.argsort(-ratings)
    ]


def _ratings(
    number: int, pairs: NDArray[np.int64], outcomes: NDArray[np.float64], anchor: int | None
) -> NDArray[np.float64]:
    """Maximum-likelihood ratings (number,) in Elo points for wins, losses and draws (pairs, 3)."""
    import choix

    scores = np.zeros((number, number))
    scores[pairs[:, 0], pairs[:, 1]] = outcomes[:, 0] + 0.5 * outcomes[:, 2]
    scores[pairs[:, 1], pairs[:, 0]] = outcomes[:, 1] + 0.5 * outcomes[:, 2]
    strengths = choix.ilsr_pairwise_dense(scores, max_iter=10_000, tol=1e-6)
    fixed = strengths.mean() if anchor is None else strengths[anchor]
    return ANCHOR_RATING + ELO * (strengths - fixed)


def cross_table(names: Sequence[str], matches: Sequence[Match]) -> NDArray[np.float64]:
    """(n, n) share of the points that the row's player scored against the column's (draws half); NaN if not played."""
    place = {name: k for k, name in enumerate(names)}
    table = np.full((len(names), len(names)), np.nan)
    for match in matches:
        i, j, result = place[match.player], place[match.result.opponent], match.result
        table[i, j] = (result.wins + 0.5 * result.draws) / result.points
        table[j, i] = 1.0 - table[i, j]
    return table


def expected_scores(ratings: Sequence[Rating]) -> NDArray[np.float64]:
    """(n, n) the shares that the ratings predict."""
    values = np.array([rating.rating for rating in ratings])
    return 1.0 / (1.0 + 10.0 ** ((values - values[:, np.newaxis]) / 400.0))
