"""Time reversal: simulate a crowd of pucks, reverse all velocities, and simulate as long again. Do they return?"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from agents.plots import GREY, INK, new_figure, plain, save_figure
from benchmarks.kiss.scenes import METHODS, Scene, crowd
from benchmarks.style import COLORS

TICK = 1.0 / 60.0  # s
BACK = 1e-3  # m: a puck has returned if it is closer than this to its start
FLOOR = 1e-17


def there_and_back(scene: Scene, method: str, ticks: int) -> tuple[int, float]:
    """Number of contacts between discs on the way forward, and the greatest final distance to the start, m."""
    table = scene.table(method)
    contacts = sum(int((table.step(TICK)["b"] >= 0).sum()) for _ in range(ticks))
    table.velocities[:] *= -1.0
    for _ in range(ticks):
        table.step(TICK)
    return contacts, float(np.linalg.norm(table.positions - scene.positions, axis=1).max())


def measure(quick: bool) -> dict[str, Any]:
    """For each method and seed, (contacts on the way forward, final distance in m) for increasing numbers of ticks."""
    seeds = range(2 if quick else 12)
    ways = range(5, 60, 25) if quick else range(5, 255, 5)
    runs = {m: [[there_and_back(crowd(seed), m, ticks) for ticks in ways] for seed in seeds] for m in METHODS}
    return {"seeds": len(seeds), "ticks": list(ways), "runs": runs}


def contacts_until_lost(run: list[tuple[int, float]]) -> int:
    """The most contacts after which all pucks returned, up to the first number of ticks for which they did not."""
    most = 0
    for contacts, distance in run:
        if distance > BACK:
            break
        most = contacts
    return most


def draw(data: dict[str, Any], path: Path) -> None:
    """Plot the final distance against contacts, with one thin line per seed."""
    figure = new_figure(8.5, 4.3)
    axis = figure.subplots()
    for method in METHODS:
        for k, run in enumerate(data["runs"][method]):
            contacts, distances = zip(*run, strict=True)
            axis.plot(contacts, np.maximum(distances, FLOOR), color=COLORS[method], linewidth=1.1, alpha=0.75,
                      label=method if k == 0 else None)  # fmt: skip
    axis.axhline(BACK, color=GREY, linewidth=1, linestyle="--")
    axis.annotate("back to within 1 mm", (1.0, BACK), (-4, -4), xycoords=("axes fraction", "data"), color=INK,
                  textcoords="offset points", ha="right", va="top", fontsize=9)  # fmt: skip
    axis.set(yscale="log", ylim=(FLOOR, 10), xlim=(0, 90), xlabel="contacts between pucks before time is turned",
             ylabel="farthest from its start, m", title="Twelve pucks, there and back")  # fmt: skip
    legend = axis.legend(frameon=False, loc="lower right")
    for line in legend.get_lines():
        line.set(linewidth=2.5, alpha=1.0)
    plain(axis)
    save_figure(figure, path)


def table(data: dict[str, Any]) -> list[tuple[str, ...]]:
    """How many contacts each method can reverse."""
    rows: list[tuple[str, ...]] = [("method", "contacts taken back, median", "least", "most")]
    for method in METHODS:
        counts = [contacts_until_lost(run) for run in data["runs"][method]]
        rows.append((f'`"{method}"`', f"{np.median(counts):.0f}", str(min(counts)), str(max(counts))))
    return rows
