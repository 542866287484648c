"""Error of the outgoing angle against the travel per tick and against the offset of the hit."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from agents.plots import new_figure, plain, save_figure
from benchmarks.kiss.scenes import METHODS, RADIUS, REACH, angle, exact_angle, struck
from benchmarks.style import COLORS, MARKERS

TRAVELS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)  # per tick, in radii
OFFSETS = tuple(np.linspace(0.05, 0.95, 19))  # as shares of the sum of the radii
FIXED_TRAVEL = 1.0
ROUNDING = 1e-14  # degrees: smaller values are drawn as this


def _errors(method: str, travel: float, offsets: Iterable[float], phases: int) -> dict[str, float | None]:
    """Median and worst error of the shots that hit, degrees, and the share of shots that passed through."""
    errors, shots = [], 0
    for share in offsets:
        for phase in (np.arange(phases) + 0.5) / phases:
            velocity = struck(method, share * REACH, (1.0 + phase) * travel * RADIUS, travel * RADIUS)
            shots += 1
            if velocity is not None:
                errors.append(abs(angle(velocity) - exact_angle(share * REACH)))
    seen = len(errors) > 0
    return {
        "median": float(np.median(errors)) if seen else None,
        "worst": float(np.max(errors)) if seen else None,
        "missed": 1.0 - len(errors) / shots,
    }


def measure(quick: bool) -> dict[str, Any]:
    """Errors of the three methods in degrees, over phases of the tick (and over offsets, for the travel)."""
    phases = 3 if quick else 25
    travels = TRAVELS[2::4] if quick else TRAVELS
    offsets = OFFSETS[::6] if quick else OFFSETS
    return {
        "travels": travels,
        "offsets": offsets,
        "by_travel": {m: [_errors(m, travel, (0.2, 0.5, 0.8), phases) for travel in travels] for m in METHODS},
        "by_offset": {m: [_errors(m, FIXED_TRAVEL, (share,), phases) for share in offsets] for m in METHODS},
    }


def draw(data: dict[str, Any], path: Path) -> None:
    """Plot the error against travel and offset, and the share of missed shots."""
    figure = new_figure(12.5, 4.3)
    axes = figure.subplots(1, 3)
    axes[1].sharey(axes[0])

    def curve(axis: Any, x: Any, rows: list[dict[str, Any]], method: str) -> None:
        median, worst = (
            np.array([np.nan if row[key] is None else max(row[key], ROUNDING) for row in rows])
            for key in ("median", "worst")
        )
        axis.fill_between(x, median, worst, color=COLORS[method], alpha=0.15, linewidth=0)
        line = {"overlap": "-", "kiss": "-", "continuous": "--"}[method]
        axis.plot(x, median, color=COLORS[method], marker=MARKERS[method], markersize=5, linestyle=line, label=method)

    for method in METHODS:
        curve(axes[0], data["travels"], data["by_travel"][method], method)
        curve(axes[1], data["offsets"], data["by_offset"][method], method)
        missed = [100.0 * row["missed"] for row in data["by_travel"][method]]
        axes[2].plot(data["travels"], missed, color=COLORS[method], marker=MARKERS[method], markersize=5,
                     linestyle={"kiss": "--"}.get(method, "-"), label=method)  # fmt: skip
    for axis in axes[:2]:
        axis.set(yscale="log", ylim=(ROUNDING / 3, 500))
        axis.set_yticks([1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2, 1, 100])
    axes[0].set_ylabel("error of the outgoing angle, degrees")
    for axis in (axes[0], axes[2]):
        ticks = (0.02, 0.1, 0.5, 2, 8)
        axis.set(xscale="log", xlabel="travel in a tick, speed · dt / radius")
        axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.minorticks_off()
    axes[0].set_title("By the travel in a tick")
    axes[1].set(
        title=f"By how thin the hit is, travel {FIXED_TRAVEL:g}", xlabel="offset / (r$_A$ + r$_B$)", xlim=(0, 1)
    )
    axes[2].set(title="Shots that passed through unseen", ylabel="%", ylim=(-3, 103))
    axes[0].legend(frameon=False, loc="center left", bbox_to_anchor=(0.0, 0.5), title="median (shade: to the worst)",
                   alignment="left")  # fmt: skip
    axes[2].legend(frameon=False, loc="upper left")
    for axis in axes:
        plain(axis)
    save_figure(figure, path)


def _degrees(error: float) -> str:
    return f"{error:.1g}°" if error < 1e-3 else f"{error:.2g}°"


def table(data: dict[str, Any]) -> list[tuple[str, ...]]:
    """Median and worst error and the share of misses for each travel."""

    def cell(row: dict[str, Any]) -> str:
        error = "none seen" if row["median"] is None else f"{_degrees(row['median'])} ({_degrees(row['worst'])})"
        return f"{error}, {row['missed']:.0%} missed"

    rows: list[tuple[str, ...]] = [("speed · dt / radius", *(f'`"{method}"`' for method in METHODS))]
    for k, travel in enumerate(data["travels"]):
        rows.append((f"{travel:g}", *(cell(data["by_travel"][method][k]) for method in METHODS)))
    return rows
