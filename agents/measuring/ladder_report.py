"""Print and plot the ladder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from agents.measuring.ladder import ANCHOR, ANCHOR_RATING, Match, Rating, cross_table, expected_scores
from agents.plots import BLUE, PALE, heat_map, new_figure, save_figure
from agents.tables import print_table


def print_ladder(ratings: Sequence[Rating], matches: Sequence[Match]) -> None:
    """Print the ratings with their 95 % intervals, the cross table, and how well the ratings explain it."""
    from rich.console import Console

    names = [rating.player for rating in ratings]
    rows = []
    for place, row in enumerate(ratings, 1):
        shares = (f"{count / row.points:.1%}" if row.points else "" for count in (row.wins, row.losses, row.draws))
        interval = "fixed" if row.low == row.high else f"{row.low:.0f} to {row.high:.0f}"
        rows.append((str(place), row.player, f"{row.rating:.0f}", interval, str(row.points), *shares))
    heads: tuple[str, ...] = ("", "player", "rating", "95 %", "points", "won", "lost", "drawn")
    print_table("Ladder, best first", [heads, *rows], names=1)
    scores = cross_table(names, matches)
    table: list[tuple[str, ...]] = [
        (str(place), name, *("" if np.isnan(score) else f"{100 * score:.1f}" for score in row_scores))
        for place, (name, row_scores) in enumerate(zip(names, scores, strict=True), 1)
    ]
    heads_of_all = ("", "against", *(str(place) for place in range(1, len(names) + 1)))
    print_table("Score of the row's player, %", [heads_of_all, *table], names=1)
    errors = np.nan_to_num(np.abs(scores - expected_scores(ratings)))
    i, j = np.unravel_index(errors.argmax(), errors.shape)
    Console().print(
        f"Ratings: {_fixed(names)}; 400 points are odds of 10 to 1. They miss the cross table by "
        f"{100 * errors.max():.1f} points of 100 at most ({names[i]} against {names[j]}).",
        highlight=False,
    )


def _fixed(names: Sequence[str]) -> str:
    return f"{ANCHOR if ANCHOR in names else 'their mean'} is {ANCHOR_RATING:.0f}"


def draw_ladder(ratings: Sequence[Rating], matches: Sequence[Match], title: str, path: Path) -> None:
    """Draw the ratings with their intervals, and the cross table beside them."""
    names = [rating.player for rating in ratings]
    number = len(names)
    table = max(3.0, 0.5 + 0.75 * number)  # inches: its title needs 3
    figure = new_figure(6.0 + table, max(3.0, 1.8 + 0.55 * number))
    left, right = figure.subplots(1, 2, width_ratios=(5.5, table))
    figure.suptitle(title)

    values = np.array([rating.rating for rating in ratings])
    places = np.arange(number)
    reach = np.array([(row.rating - row.low, row.high - row.rating) for row in ratings]).clip(0.0).T
    left.hlines(places, values.min() - 60, values, color=PALE, linewidth=6, zorder=1)
    left.errorbar(values, places, xerr=reach, fmt="o", color=BLUE, markersize=8, elinewidth=2.5, capsize=5, zorder=3)
    for place, row in enumerate(ratings):
        left.annotate(f"{row.rating:.0f}", (row.high, place), (10, 0), textcoords="offset points", va="center")
    left.set_xlim(values.min() - 60, values.max() + 0.2 * (np.ptp(values) + 300))
    left.set_yticks(places, names)
    left.set_ylim(number - 0.5, -0.5)
    left.set(title="Rating, 95 % interval", xlabel=f"Elo points, {_fixed(names)}")
    left.spines[["top", "right", "left"]].set_visible(False)
    left.tick_params(axis="y", length=0)

    heat_map(right, 100 * cross_table(names, matches))
    right.set_xticks(places, names, rotation=30, ha="right", rotation_mode="anchor")
    right.set_yticks([])
    right.set(title="Score of the row's player, %")
    save_figure(figure, path)
