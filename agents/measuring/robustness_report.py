"""Print and plot how robust players are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from agents.measuring.robustness import GRIDS, LISTS, Cell, Grid, together
from agents.plots import BLUE, GREEN, INK, ORANGE, PALE, PINK, RED, RULE, heat_map, new_figure, save_figure
from agents.tables import print_table

COLORS = (BLUE, RED, GREEN, ORANGE, PINK, INK)

TITLES = {"named": "Presets and training ranges", "held_out": "Held-out tables and cameras"}


def print_robustness(cells: Sequence[Cell]) -> None:
    """Print the shares of the decided points, with 95 % intervals."""
    print("Shares of the decided points, %, with 95 % intervals")
    players = list(dict.fromkeys(cell.player for cell in cells))
    for part in dict.fromkeys(cell.part for cell in cells):
        own = [cell for cell in cells if cell.part == part]
        if part in LISTS:
            rows = [("", *players)]
            rows += [(str(name), *(_share(cell) for cell in own if cell.name == name)) for name in _names(own)]
            rows.append(("mean", *(_mean([cell for cell in own if cell.player == player]) for player in players)))
            print_table(TITLES[part], rows)
            continue
        grid = GRIDS[part]()
        for player in players:
            shares = {cell.name: cell for cell in own if cell.player == player}
            rows = [(grid.down.label, *(f"{value:g}" for value in grid.across.values))]
            for down in grid.down.values:
                rows.append((f"{down:g}", *(_share(shares[down, across]) for across in grid.across.values)))
            print_table(f"{player}. {grid.title}. Across: {grid.across.label}", rows)


def _names(cells: Sequence[Cell]) -> list[Any]:
    return list(dict.fromkeys(cell.name for cell in cells))


def _share(cell: Cell) -> str:
    low, high = cell.result.decided_interval
    share = cell.result.decided
    return "none" if math.isnan(share) else f"{100 * share:.0f} ({100 * low:.0f}-{100 * high:.0f})"


def _mean(cells: Sequence[Cell]) -> str:
    summary = together(cells)
    low, high = summary.interval
    return f"{100 * summary.mean:.1f} ({100 * low:.1f}-{100 * high:.1f})"


def draw_robustness(cells: Sequence[Cell], title: str, path: Path) -> None:
    """Draw the grids as heat maps, one for each player, and the lists as points with their 95 % intervals."""
    players = list(dict.fromkeys(cell.player for cell in cells))
    parts = list(dict.fromkeys(cell.part for cell in cells))
    grids, lists = [part for part in parts if part in GRIDS], [part for part in parts if part in LISTS]
    rows = max((len(_names([cell for cell in cells if cell.part == part])) for part in lists), default=0)
    heights = [3.1] * len(grids) + [1.3 + 0.3 * rows] * bool(lists)
    figure = new_figure(max(8.5, 3.5 * len(players)), sum(heights) + 0.5)
    figure.suptitle(title)
    areas = figure.subfigures(len(heights), 1, squeeze=False, height_ratios=heights)[:, 0]
    for part, area in zip(grids, areas, strict=False):
        grid = GRIDS[part]()
        area.suptitle(f"{grid.title}: share of the decided points, %", size=11)
        axes = area.subplots(1, len(players), sharey=True, squeeze=False)[0]
        for axis, player in zip(axes, players, strict=True):
            own = {cell.name: cell for cell in cells if cell.part == part and cell.player == player}
            _draw_grid(axis, grid, own, player)
        axes[0].set_ylabel(grid.down.label)
    if lists:
        axes = areas[-1].subplots(1, len(lists), squeeze=False)[0]
        for axis, part in zip(axes, lists, strict=True):
            _draw_list(axis, [cell for cell in cells if cell.part == part], players, TITLES[part])
        if len(players) > 1:
            areas[-1].legend(handles=axes[0].containers, loc="outside upper center", ncols=len(players), frameon=False)
    save_figure(figure, path)


def _draw_grid(axis: Any, grid: Grid, cells: dict[Any, Cell], player: str) -> None:
    shares = np.array(
        [[cells[down, across].result.decided for across in grid.across.values] for down in grid.down.values]
    )
    heat_map(axis, 100 * shares)
    axis.set_xticks(range(len(grid.across.values)), [f"{value:g}" for value in grid.across.values])
    axis.set_yticks(range(len(grid.down.values)), [f"{value:g}" for value in grid.down.values])
    axis.set(title=player, xlabel=grid.across.label)


def _draw_list(axis: Any, cells: Sequence[Cell], players: Sequence[str], title: str) -> None:
    names = _names(cells)
    for k, player in enumerate(players):
        own = [cell for cell in cells if cell.player == player]
        places = np.arange(len(own)) + 0.22 * (k - 0.5 * (len(players) - 1))
        shares = np.array([cell.result.decided for cell in own])
        reach = np.abs(np.array([cell.result.decided_interval for cell in own]).T - shares)
        axis.errorbar(100 * shares, places, xerr=100 * reach, fmt="o", color=COLORS[k % len(COLORS)], markersize=4,
                      elinewidth=1.5, label=player)  # fmt: skip
    axis.hlines(np.arange(len(names)), 0, 100, color=PALE, linewidth=1, zorder=0)
    axis.axvline(50, color=RULE, linewidth=1, zorder=0)
    axis.set_yticks(range(len(names)), names)
    axis.set(xlim=(0, 100), ylim=(len(names) - 0.4, -0.6), xlabel="of decided points, %, with 95 % intervals")
    axis.set_title(title, size=11)
    axis.spines[["top", "right", "left"]].set_visible(False)
    axis.tick_params(axis="y", length=0)
