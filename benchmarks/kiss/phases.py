"""The same shot, started at different phases of the tick, should give the same result."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from agents.plots import BLUE, GREY, INK, RED, new_figure, plain, save_figure
from benchmarks.kiss.scenes import METHODS, RADIUS, REACH, angle, exact_angle, struck
from benchmarks.style import COLORS, MARKERS

OFFSET = 0.6 * REACH  # m
TRAVEL = 0.07  # m per tick: 3.5 m/s at 50 Hz, slow enough never to pass through
LENGTH = 1.0  # m, of the path over which the spread is measured


def measure(quick: bool) -> dict[str, Any]:
    """Angles of the target in degrees, over phases of the tick."""
    count = 6 if quick else 48
    phases = (np.arange(count) + 0.5) / count
    angles = {}
    for method in METHODS:
        velocities = [struck(method, OFFSET, (1.0 + phase) * TRAVEL, TRAVEL) for phase in phases]
        angles[method] = [None if velocity is None else angle(velocity) for velocity in velocities]
    return {"phases": phases.tolist(), "exact": exact_angle(OFFSET), "angles": angles}


def draw(data: dict[str, Any], path: Path) -> None:
    """Plot the paths of the target for each method, and its angle against the phase."""
    from matplotlib.patches import Circle

    figure = new_figure(12.5, 3.6)
    axes = figure.subplots(1, 4)
    for axis, method in zip(axes[:3], METHODS, strict=True):
        angles = np.radians([a for a in data["angles"][method] if a is not None])
        for direction in angles:
            axis.plot([0, LENGTH * np.cos(direction)], [0, LENGTH * np.sin(direction)], color=COLORS[method],
                      linewidth=1.2, alpha=0.6)  # fmt: skip
        kiss = (-np.sqrt(REACH**2 - OFFSET**2), OFFSET)
        axis.add_patch(Circle(kiss, RADIUS, facecolor="white", edgecolor=BLUE, linewidth=1.5, zorder=4))
        axis.add_patch(Circle((0, 0), RADIUS, facecolor="white", edgecolor=RED, linewidth=1.5, zorder=4))
        axis.plot([-0.3, kiss[0] - RADIUS], [OFFSET, OFFSET], color=BLUE, linewidth=1.5)
        spread = LENGTH * np.radians(np.ptp(np.degrees(angles)))
        text = f"{1e3 * spread:.0f} mm wide\nafter 1 m" if spread > 1e-6 else "one line"
        axis.text(0.98, 0.96, text, transform=axis.transAxes, ha="right", va="top", color=INK)
        axis.set(title=f'"{method}"', xlim=(-0.3, 1.05), ylim=(-1.0, 0.4))
        axis.set_aspect("equal")
        axis.set_xticks([0, 0.5, 1], ["0", "0.5", "1 m"])
        axis.set_yticks([-1, -0.5, 0], ["-1 m", "-0.5", "0"])
        plain(axis)
    axes[3].axhline(data["exact"], color=GREY, linewidth=1, zorder=0)
    for method in METHODS:
        values = [np.nan if a is None else a for a in data["angles"][method]]
        small = method == "continuous"  # drawn inside the other markers
        axes[3].plot(data["phases"], values, color=COLORS[method], marker=MARKERS[method], linestyle="none",
                     markersize=3 if small else 5.5, label=method, zorder=4 if small else 3)  # fmt: skip
    axes[3].set(title="Angle by phase", xlabel="where in a tick the shot starts", ylabel="degrees", xlim=(0, 1))
    axes[3].legend(frameon=False, loc="best")
    axes[3].set_box_aspect(1.4 / 1.35)  # as high as its neighbours
    plain(axes[3])
    save_figure(figure, path)


def table(data: dict[str, Any]) -> list[tuple[str, ...]]:
    """Least and greatest angle, spread, worst error, and shots that passed through."""
    rows: list[tuple[str, ...]] = [("method", "least angle", "greatest angle", "spread", "worst error", "missed")]
    for method in METHODS:
        seen = np.array([a for a in data["angles"][method] if a is not None])
        rows.append(
            (
                f'`"{method}"`',
                f"{seen.min():.4f}°",
                f"{seen.max():.4f}°",
                f"{np.ptp(seen):.2g}°",
                f"{np.abs(seen - data['exact']).max():.2g}°",
                f"{len(data['angles'][method]) - len(seen)} of {len(data['angles'][method])}",
            )
        )
    rows.append(("exact", f"{data['exact']:.4f}°", f"{data['exact']:.4f}°", "0", "0", "0"))
    return rows
