"""The picture of the source text, redrawn from the engine's results: the two normals, the triangles, the bounce."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.plots import BLUE, GREEN, GREY, INK, ORANGE, RED, new_figure, save_figure
from airhockey_env import AirTable
from benchmarks.kiss.scenes import RADIUS, REACH, angle

TICK = 0.02  # s
START, VELOCITY = np.array([-0.19, 0.055]), np.array([8.0, 0.0])  # of the blue puck; the red one rests at the origin


def measure(quick: bool) -> dict[str, Any]:
    """One tick of the blue puck with the exact and the overlap method. Lengths in m, angles in degrees."""
    after, contacts, rest = {}, {}, np.zeros(2)
    for method in ("overlap", "continuous"):
        table = AirTable(np.stack([START, rest]), np.stack([VELOCITY, rest]), RADIUS, size=None, method=method)
        contacts[method] = table.step(TICK)[0]
        after[method] = table.velocities.copy()
    time = float(contacts["continuous"]["time"])
    kiss, end = START + time * VELOCITY, START + TICK * VELOCITY
    path = (end - START) / np.linalg.norm(end - START)
    foot = START - (START @ path) * path  # where the shared leg, from the red puck's centre, meets the path
    normals = {method: np.array([contact["nx"], contact["ny"]]) for method, contact in contacts.items()}
    return {
        "start": START.tolist(),
        "end": end.tolist(),
        "kiss": kiss.tolist(),
        "foot": foot.tolist(),
        "projection": float(np.linalg.norm(foot - START)),
        "shared_leg": float(np.linalg.norm(foot)),
        "top_leg": float(np.linalg.norm(foot - kiss)),
        "hypotenuse": float(np.linalg.norm(kiss)),
        "penetration_time": TICK - time,
        "normal_angle": {method: angle(normal) for method, normal in normals.items()},
        "normal": {method: normal.tolist() for method, normal in normals.items()},
        "velocities": {method: velocities.tolist() for method, velocities in after.items()},
    }


def _puck(axis: Any, centre: Any, color: str, fill: float = 0.0, line: str = "-", alpha: float = 1.0) -> None:
    from matplotlib.colors import to_rgba
    from matplotlib.patches import Circle

    face = to_rgba(color, fill)
    edge = to_rgba(color, alpha)
    axis.add_patch(Circle(tuple(centre), RADIUS, facecolor=face, edgecolor=edge, linestyle=line, linewidth=1.5))


def _line(axis: Any, a: Any, b: Any, **style: Any) -> None:
    axis.plot([a[0], b[0]], [a[1], b[1]], **{"color": INK, "linewidth": 1.5, "solid_capstyle": "round", **style})


def _dot(axis: Any, place: Any, name: str, shift: tuple[float, float], color: str = INK) -> None:
    axis.plot(*place, marker="o", markersize=4, color=color, zorder=5)
    axis.annotate(name, place, shift, textcoords="offset points", ha="center", va="center", color=color, fontsize=11)


def _arrow(axis: Any, place: Any, vector: Any, color: str, line: str) -> None:
    axis.annotate(
        "",
        xy=np.asarray(place) + vector,
        xytext=place,
        arrowprops={"arrowstyle": "-|>", "color": color, "linestyle": line, "linewidth": 2, "shrinkA": 0, "shrinkB": 0},
    )


def draw(data: dict[str, Any], path: Path) -> None:
    """Plot three panels: the two normals, the triangles, and the velocities after the bounce."""
    start, end, kiss, foot = (np.array(data[name]) for name in ("start", "end", "kiss", "foot"))
    red = np.zeros(2)
    ideal, approximate = (np.array(data["normal"][method]) for method in ("continuous", "overlap"))
    figure = new_figure(12.5, 3.9)
    normals, triangles, bounce = figure.subplots(1, 3)

    _puck(normals, red, RED, 0.25)
    _puck(normals, start, BLUE, 0.06, alpha=0.45)
    _puck(normals, end, BLUE, 0.25)
    _puck(normals, kiss, BLUE, 0.0, "--")
    _arrow(normals, start, 0.075 * VELOCITY / np.linalg.norm(VELOCITY), BLUE, "-")
    for normal, line in ((ideal, "-"), (approximate, ":")):
        _line(normals, -0.062 * normal, 0.165 * normal, linestyle=line, linewidth=2)
    _dot(normals, start, "$A_1$", (-2, -12))
    _dot(normals, kiss, "$A_{2K}$", (-14, -8))
    _dot(normals, end, "$A_2$", (14, 5))
    _dot(normals, red, "$B$", (14, 3))
    normals.text(*(0.165 * ideal + [-0.004, 0.006]), "ideal", ha="right", va="bottom", fontsize=11)
    normals.text(*(0.165 * approximate + [0.004, 0.004]), "approximate", ha="center", va="bottom", fontsize=11)
    difference = data["normal_angle"]["continuous"] - data["normal_angle"]["overlap"]
    normals.set_title(f"Two contact normals, {difference:.1f}° apart")

    for centre, color, line in ((red, RED, "-"), (start, BLUE, "-"), (end, BLUE, "-"), (kiss, BLUE, "--")):
        _puck(triangles, centre, color, 0.0, line, alpha=0.35)
    from matplotlib.patches import Polygon

    triangles.add_patch(Polygon([start, foot, red], closed=True, facecolor=ORANGE, alpha=0.14, edgecolor="none"))
    triangles.add_patch(Polygon([kiss, foot, red], closed=True, facecolor=GREEN, alpha=0.28, edgecolor="none"))
    _line(triangles, start, foot, linewidth=1.2, linestyle="--", color=GREY)
    _line(triangles, start, end, linewidth=2.2, color=BLUE)
    _line(triangles, start, red, linewidth=1.2)
    _line(triangles, kiss, red, linewidth=1.8)
    _line(triangles, foot, red, linewidth=1.8)
    _dot(triangles, start, "$A_1$", (-2, -12))
    _dot(triangles, kiss, "$A'_{2K}$", (2, 12))
    _dot(triangles, end, "$A'_2$", (0, 12))
    _dot(triangles, red, "$B_1$", (6, -13))
    triangles.annotate("shared\nleg", (foot + red) / 2, (6, -2), textcoords="offset points", fontsize=10, va="center")
    triangles.annotate(
        "$r_A + r_B$",
        (kiss + red) / 2,
        (-62, -42),
        textcoords="offset points",
        fontsize=11,
        ha="right",
        va="center",
        arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.8},
    )
    mark = foot[1] + 0.058  # dimension lines above the path
    for left, right, height, name in (
        (start, foot, mark + 0.026, "projection of $B_1 - A_1$"),
        (kiss, foot, mark, "top leg"),
    ):
        for place in (left, right):
            _line(triangles, (place[0], place[1] + 0.024), (place[0], height + 0.004), color=GREY, linewidth=0.7)
        triangles.annotate(
            "",
            (left[0], height),
            (right[0], height),
            arrowprops={"arrowstyle": "<->", "color": INK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0},
        )
        triangles.text((left[0] + right[0]) / 2, height + 0.004, name, ha="center", va="bottom", fontsize=10)
    triangles.annotate("A' path", (start + kiss) / 2, (0, 8), textcoords="offset points",
                       fontsize=11, color=BLUE, va="center", ha="center")  # fmt: skip
    triangles.set_title("Seen from B: the two triangles")

    scale = 0.016  # m of arrow for 1 m/s
    _puck(bounce, kiss, BLUE, 0.12)
    _puck(bounce, red, RED, 0.12)
    for method, line in (("continuous", "-"), ("overlap", ":")):
        for place, velocity, color in zip((kiss, red), data["velocities"][method], (BLUE, RED), strict=True):
            _arrow(bounce, place, scale * np.array(velocity), color, line)
    _dot(bounce, kiss, "", (0, 0))
    _dot(bounce, red, "", (0, 0))
    for place, method, velocity, shift, side in (
        (kiss, "continuous", 0, (0, 7), "center"),
        (kiss, "overlap", 0, (6, 0), "left"),
        (red, "continuous", 1, (6, -4), "left"),
        (red, "overlap", 1, (4, -8), "right"),
    ):
        vector = np.array(data["velocities"][method][velocity])
        label = f"{angle(vector):.1f}° {'exact' if method == 'continuous' else 'approximate'}"
        bounce.annotate(label, place + scale * vector, shift, textcoords="offset points", ha=side, va="center",
                        fontsize=10, color=(BLUE, RED)[velocity])  # fmt: skip
    bounce.set_title("Velocities after the bounce")

    for axis, place in ((normals, start), (triangles, start), (bounce, kiss)):
        axis.set_aspect("equal")
        axis.set_axis_off()
        axis.set_ylim(-0.063, 0.165)
        edge = -0.15 if axis is bounce else place[0] - 0.06
        axis.set_xlim(edge, edge + 0.315)
    save_figure(figure, path)


def vector(place: NDArray[np.float64] | list[float]) -> str:
    """Format a position in mm."""
    return f"({1e3 * place[0]:.1f}, {1e3 * place[1]:.1f}) mm"


def table(data: dict[str, Any]) -> list[tuple[str, ...]]:
    """The numbers in the picture."""
    return [
        ("quantity", "value"),
        ("start A1 and end A2' of the A' path, seen from B", f"{vector(data['start'])}, {vector(data['end'])}"),
        ("projection of B1 - A1 onto the path", f"{1e3 * data['projection']:.3f} mm"),
        ("shared leg", f"{1e3 * data['shared_leg']:.3f} mm"),
        ("hypotenuse of the small triangle, from the engine's kiss", f"{1e3 * data['hypotenuse']:.12f} mm"),
        ("the sum of the radii", f"{1e3 * REACH:.0f} mm"),
        ("top leg", f"{1e3 * data['top_leg']:.3f} mm"),
        ("kiss A2K'", vector(data["kiss"])),
        ("penetration time", f"{1e3 * data['penetration_time']:.3f} ms of a tick of {1e3 * TICK:.0f} ms"),
        ("ideal-contact normal", f"{data['normal_angle']['continuous']:.2f}°"),
        ("approximate-contact normal", f"{data['normal_angle']['overlap']:.2f}°"),
    ]
