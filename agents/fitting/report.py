"""Print a fitted table, and draw what is left unexplained of the track."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from agents.fitting.bounces import NORMAL, PLACE, TANGENTIAL
from agents.fitting.fit import BOUNDED, FITTED, Field, TableFit
from agents.fitting.glides import slide
from agents.plots import BLUE, INK, ORANGE, RED, RULE, SKY, new_figure, plain, save_figure
from agents.tables import print_table

UNITS = {
    **dict.fromkeys(("length", "width", "goal_width", "puck_radius", "paddle_radius"), "m"),
    "puck_mass": "kg",
    "drag_constant": "m/s²",
    "drag_linear": "1/s",
    "drag_quadratic": "1/m",
    "paddle_speed": "m/s",
    "paddle_acceleration": "m/s²",
    "puck_speed": "m/s",
}
SPEEDS = (0.5, 1.0, 2.0, 4.0)
"""m/s at which the deceleration is printed, where the track has such speeds."""
NOTABLE = 2e-3
"""Scatter of a share from bounce to bounce that is worth a sentence."""


def print_fit(fit: TableFit) -> None:
    """Print every field with its interval and source, and what the track tells besides."""
    from rich.console import Console

    rows: list[tuple[str, ...]] = [("field", "value", "95 %", "unit", "")]
    notes: dict[tuple[str, str], list[str]] = {}
    for name, field in fit.fields.items():
        rows.append((name, *rounded(field), UNITS.get(name, ""), field.source))
        if field.note:
            notes.setdefault((field.source, field.note), []).append(name)
    print_table("Table", rows)
    for (source, note), names in notes.items():
        Console().print(f"{', '.join(names)}: {source}; {note}.", highlight=False)
    for line in remarks(fit):
        Console().print(line, highlight=False)


def rounded(field: Field) -> tuple[str, str]:
    """The value and its interval, to the decimals in which the half of the interval has two digits."""
    if field.low is None or field.high is None:
        return f"{field.value:.5g}", ""
    half = 0.5 * (field.high - field.low)
    decimals = min(max(1 - math.floor(math.log10(half)), 0), 7) if half > 0.0 else 7
    value, low, high = (f"{number:.{decimals}f}" for number in (field.value, field.low, field.high))
    return value, f"{low} to {high}"


def remarks(fit: TableFit) -> list[str]:
    """Sentences about the fit as a whole."""
    glides, told = fit.glides, fit.estimates
    lines = [
        f"{len(fit.track.time)} frames with a noise of {1e3 * glides.noise:.2g} mm, {len(glides.flights)} glides "
        f"and {len(fit.bounces)} bounces on walls. {glides.dropped} stretches were not free glides."
    ]
    if fit.fields["drag_constant"].source == FITTED:
        fastest = max(np.hypot(*start[2:]) for start in glides.starts)
        drag = np.array([one.value for one in told.drag])
        parts = []
        for speed in SPEEDS:
            if speed <= fastest:
                powers = np.array([1.0, speed, speed**2])
                side = 1.96 * np.sqrt(powers @ told.drag_covariance @ powers)
                parts.append(f"{drag @ powers:.4g} ± {side:.1g} m/s² at {speed:g} m/s")
        lines.append(f"The deceleration is {', '.join(parts)}.")
    for kind, name in ((NORMAL, "wall_restitution"), (TANGENTIAL, "wall_tangential")):
        if told.scatter.get(kind, 0.0) > NOTABLE:
            lines.append(
                f"From bounce to bounce {name} scatters by {told.scatter[kind]:.2g} beyond the camera's noise; the "
                "interval is that of its mean."
            )
    if told.fall is not None and not told.fall.low <= 0.0 <= told.fall.high:
        lines.append(
            f"wall_restitution changes by {told.fall.value:.2g} ({told.fall.low:.2g} to {told.fall.high:.2g}) per m/s "
            "of normal speed. A table has one value for all speeds: the one above is the mean over this track."
        )
    if any(field.source == BOUNDED for field in fit.fields.values()):
        lines.append("A bounded field lies anywhere in its range, which is no confidence interval.")
    if fit.angle != 0.0:
        lines.append(f"The track was turned by {math.degrees(-fit.angle):.3f}°, so that its axes are the table's.")
    if fit.centre[0] is not None and fit.centre[1] is not None:
        lines.append(f"The table's centre is at ({fit.centre[0]:.4f}, {fit.centre[1]:.4f}) m in these axes.")
    return lines


def draw_fit(fit: TableFit, title: str, path: Path) -> None:
    """Draw the track, the residuals of the glides, the deceleration and what the walls keep into a .png file."""
    figure = new_figure(11.0, 7.5)
    figure.suptitle(title)
    (track, residuals), (glide, walls) = figure.subplots(2, 2)
    _draw_track(fit, track)
    _draw_residuals(fit, residuals)
    _draw_glide(fit, glide)
    _draw_walls(fit, walls)
    save_figure(figure, path)


def _draw_track(fit: TableFit, axis: Any) -> None:
    """The frames, the bounces, and the lines that the puck's centre does not cross."""
    axis.plot(fit.track.x, fit.track.y, ".", color=SKY, markersize=1.5, zorder=1)
    for (across, _), wall in fit.estimates.walls.items():
        (axis.axvline if across == 0 else axis.axhline)(wall.value, color=RULE, zorder=0)
    for bounce in fit.bounces:
        place = (bounce.values[PLACE], bounce.along)
        axis.plot(*(place if bounce.wall[0] == 0 else place[::-1]), "o", color=RED, markersize=3, zorder=2)
    axis.set_aspect("equal", adjustable="datalim")
    axis.set(title="Where the puck was seen, and its bounces", xlabel="x, m", ylabel="y, m")
    plain(axis)


def _draw_residuals(fit: TableFit, axis: Any) -> None:
    """The residuals of all glides over the time in them, and their noise."""
    times = np.concatenate([flight.time for flight in fit.glides.flights])
    along, across = 1e3 * np.concatenate(fit.glides.residuals, axis=1)
    axis.plot(times, along, ".", color=BLUE, markersize=1.5, label="along the path")
    axis.plot(times, across, ".", color=ORANGE, markersize=1.5, label="across it")
    for side in (-2.0, 2.0):
        axis.axhline(2e3 * fit.glides.noise * np.sign(side), color=INK, linewidth=1, linestyle="--")
    axis.set(
        title="Residuals of the glides (lines: two standard deviations)",
        xlabel="s since the flight began",
        ylabel="seen minus fitted, mm",
    )
    axis.legend(loc="upper right", markerscale=6)
    plain(axis)


def _draw_glide(fit: TableFit, axis: Any) -> None:
    """The fitted deceleration over the speed, and what each flight gives on its own."""
    glides = fit.glides
    speeds, decelerations, sides = np.array([_own_deceleration(fit, k) for k in range(len(glides.flights))]).T
    clear = sides <= 3.0 * np.median(sides)
    axis.errorbar(
        speeds[clear], decelerations[clear], sides[clear], fmt=".", color=SKY, ecolor=RULE, label="one flight, 95 %"
    )
    grid = np.linspace(0.0, float(speeds.max()), 200)
    drag = np.array([fit.spec.drag_constant, fit.spec.drag_linear, fit.spec.drag_quadratic])
    label = "all together" if fit.fields["drag_constant"].source == FITTED else "kept"
    axis.plot(grid, np.stack([np.ones_like(grid), grid, grid**2], axis=1) @ drag, color=BLUE, label=label)
    axis.set(title="Deceleration of the glide", xlabel="speed, m/s", ylabel="m/s²")
    axis.legend(loc="upper left")
    plain(axis)


def _own_deceleration(fit: TableFit, k: int) -> tuple[float, float, float]:
    """The mean speed of flight k, its deceleration there from this flight alone, and the 95 % half width of that."""
    flight, start, drag = fit.glides.flights[k], fit.glides.starts[k], fit.glides.drag
    way, speeds = slide(flight.time, float(np.hypot(start[2], start[3])), drag)
    speed = float(speeds.mean())
    # What is left of the fit along the path is another constant deceleration, beside another place and speed.
    design = np.stack([np.ones_like(way), flight.time, -0.5 * flight.time**2], axis=1)
    inverse = np.linalg.inv(design.T @ design)
    more = float((inverse @ design.T @ fit.glides.residuals[k][0])[2])
    side = 1.96 * fit.glides.noise * float(np.sqrt(inverse[2, 2]))
    return speed, float(drag @ np.array([1.0, speed, speed**2])) + more, side


def _draw_walls(fit: TableFit, axis: Any) -> None:
    """What each bounce keeps of its speed, over the normal speed, and the values of the table."""
    for kind, name, color in (
        (NORMAL, "wall_restitution", BLUE),
        (TANGENTIAL, "wall_tangential", ORANGE),
    ):
        told = [bounce for bounce in fit.bounces if np.isfinite(bounce.deviations[kind])]
        if told:
            speeds, values = [bounce.approach for bounce in told], [bounce.values[kind] for bounce in told]
            sides = [1.96 * bounce.deviations[kind] for bounce in told]
            axis.errorbar(speeds, values, sides, fmt=".", color=color, ecolor=RULE)
        axis.axhline(getattr(fit.spec, name), color=color, linewidth=1, label=f"{name}, {fit.fields[name].source}")
    axis.set(title="Share kept at a wall (bars: 95 %)", xlabel="normal speed before it, m/s", ylabel="share")
    axis.legend(loc="best")
    plain(axis)
