"""The same scenes in other engines: angle error, missed collisions, energy drift and time."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

import airhockey_env
from agents.plots import BLUE, GREEN, ORANGE, PINK, new_figure, plain, save_figure
from benchmarks.kiss.scenes import REACH, Scene, angle, crowd, exact_angle, shot

RATES = (50, 60, 240, 1000)  # Hz
SPEED, FAST = 10.0, 40.0  # m/s, of the shots: about the hardest human shot, and four times that
STILL = 1e-6  # m/s: if the target is slower than this, it was missed
OURS = "AirTable"
PEERS = {"Box2D": "box2d", "Chipmunk": "chipmunk", "MuJoCo": "mujoco"}
COLORS = {OURS: GREEN, "Box2D": ORANGE, "Chipmunk": BLUE, "MuJoCo": PINK}
MARKERS = {OURS: "^", "Box2D": "s", "Chipmunk": "o", "MuJoCo": "D"}
FLOOR = {"median_error": 1e-15, "drift": 1e-16}  # smaller values are drawn as this


class Table(Protocol):
    """A scene in any engine, simulated tick by tick."""

    def step(self) -> None:
        """Simulate one tick."""

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) m."""

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s."""


Open = Callable[[Scene, float], Table]


class Ours:
    """The scene on an `AirTable`, with the exact method."""

    def __init__(self, scene: Scene, hz: float) -> None:
        self.table, self.dt = scene.table(), 1.0 / hz

    def step(self) -> None:
        """Simulate one tick."""
        self.table.step(self.dt)

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) m."""
        return self.table.positions

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s."""
        return self.table.velocities


def available() -> tuple[dict[str, Open], dict[str, str], list[str]]:
    """The installed engines, their versions, and messages about those that are missing."""
    engines: dict[str, Open] = {OURS: Ours}
    versions, missing = {OURS: airhockey_env.__version__}, []
    for name, module in PEERS.items():
        try:
            peer = import_module(f"benchmarks.kiss.{module}")
        except DependencyNotInstalled as error:
            missing.append(f"{name} is left out: {error}")
            continue
        engines[name], versions[name] = peer.Table, version(peer.PACKAGE)
    return engines, versions, missing


def play_shots(open_table: Open, hz: float, speed: float, offsets: int, phases: int) -> dict[str, float | None]:
    """Median and worst error of the target's angle in degrees, over a grid of offsets and random phases."""
    travel = speed / hz
    rng = np.random.default_rng(0)  # a grid of phases could coincide with the boundaries of sub-steps
    errors, missed = [], 0
    for share in (np.arange(offsets) + 0.5) / offsets:
        for phase in rng.random(phases):
            table = open_table(shot(speed, share * REACH, (1.0 + phase) * travel), hz)
            for _ in range(math.ceil(4.0 * REACH / travel) + 4):  # through, apart, and a few ticks for soft contacts
                table.step()
            velocity = table.velocities[1]
            if np.hypot(*velocity) < STILL:
                missed += 1
            else:
                errors.append(abs(angle(velocity) - exact_angle(share * REACH)))
    return {
        "median_error": float(np.median(errors)) if errors else None,
        "worst_error": float(max(errors)) if errors else None,
        "missed": missed / (offsets * phases),
    }


def drift(open_table: Open, hz: float, seeds: int, seconds: float) -> float:
    """Relative change of the kinetic energy, median over crowds."""
    changes = []
    for seed in range(seeds):
        scene = crowd(seed)
        table = open_table(scene, hz)
        for _ in range(round(seconds * hz)):
            table.step()
        changes.append(abs(float((table.velocities**2).sum() / (scene.velocities**2).sum()) - 1.0))
    return float(np.median(changes))


def times(engines: dict[str, Open], hz: float, rounds: int, seconds: float) -> dict[str, float]:
    """CPU time per simulated second of a crowd, s: medians over rounds in which the engines are interleaved."""
    spent: dict[str, list[float]] = {name: [] for name in engines}
    for seed in range(rounds + 1):
        for name, open_table in engines.items():
            table = open_table(crowd(seed), hz)
            start = time.process_time()
            for _ in range(round(seconds * hz)):
                table.step()
            if seed > 0:  # the first round warms up
                spent[name].append((time.process_time() - start) / seconds)
    return {name: statistics.median(values) for name, values in spent.items()}


def measure(quick: bool) -> dict[str, Any]:
    """Measure every engine on both scenes at every rate. Returns only "missing" if no other engine is installed."""
    engines, versions, missing = available()
    if len(engines) == 1:
        return {"missing": missing}
    offsets, phases, seeds, seconds = (4, 2, 1, 0.2) if quick else (20, 10, 5, 10.0)
    rates = (50, 240) if quick else RATES
    rows = []
    for hz in rates:
        spent = times(engines, hz, 1 if quick else 5, 0.1 if quick else 2.0)
        for name, open_table in engines.items():
            rows.append(
                {
                    "hz": hz,
                    "engine": name,
                    **play_shots(open_table, hz, SPEED, offsets, phases),
                    "missed_fast": play_shots(open_table, hz, FAST, offsets, phases)["missed"],
                    "drift": drift(open_table, hz, seeds, seconds),
                    "time": spent[name],
                    "ratio": spent[name] / spent[OURS],
                }
            )
    return {"missing": missing, "versions": versions, "shots": offsets * phases, "seconds": seconds, "rows": rows}


def draw(data: dict[str, Any], path: Path) -> None:
    """Plot angle error, energy drift, missed collisions and time against the rate."""
    figure = new_figure(12.5, 7.0)
    axes = figure.subplots(2, 2)
    rates = sorted({row["hz"] for row in data["rows"]})
    for name in data["versions"]:
        rows = [row for row in data["rows"] if row["engine"] == name]
        style: dict[str, Any] = {"color": COLORS[name], "marker": MARKERS[name], "label": name}
        style |= {"markersize": 10, "zorder": 1.5} if name == OURS else {"markersize": 6}  # visible behind the others
        for axis, key, factor in zip(
            axes.flat, ("median_error", "drift", "missed_fast", "time"), (1.0, 100.0, 100.0, 1e3), strict=True
        ):
            values = [math.nan if row[key] is None else max(row[key], FLOOR.get(key, 0.0)) for row in rows]
            axis.plot(range(len(rates)), factor * np.array(values), **style)
    for axis, title, label in zip(
        axes.flat,
        (f"Error of the struck puck's angle at {SPEED:g} m/s, median",
         f"Energy drift of 12 pucks in {data['seconds']:g} s, median",
         f"Shots at {FAST:g} m/s that passed through unseen", "Processor time a simulated second takes, 12 pucks"),
        ("degrees", "%", "%", "ms"),
        strict=True,
    ):  # fmt: skip
        axis.set(title=title, ylabel=label, xlabel="ticks a second")
        axis.set_xticks(range(len(rates)), [str(rate) for rate in rates])
        plain(axis)
    for axis in (axes[0, 0], axes[0, 1], axes[1, 1]):
        axis.set_yscale("log")
    axes[1, 0].set_ylim(-1, max(10.0, axes[1, 0].get_ylim()[1]))
    axes[1, 0].legend(frameon=False, loc="upper right")
    save_figure(figure, path)


def table(data: dict[str, Any]) -> list[tuple[str, ...]]:
    """One row per engine and rate; the best value at each rate is bold."""
    columns: tuple[tuple[str, Callable[[dict[str, Any]], str]], ...] = (
        ("median_error", lambda row: "none seen" if row["median_error"] is None else f"{row['median_error']:.2g}°"),
        ("worst_error", lambda row: "none seen" if row["worst_error"] is None else f"{row['worst_error']:.2g}°"),
        ("missed", lambda row: f"{row['missed']:.1%}"),
        ("missed_fast", lambda row: f"{row['missed_fast']:.1%}"),
        ("drift", lambda row: f"{100.0 * row['drift']:.1g} %"),
        ("time", lambda row: f"{1e3 * row['time']:.2f} ms"),
        ("ratio", lambda row: f"{row['ratio']:.2f}"),
    )
    head = (
        "ticks/s",
        "engine",
        "angle error, median",
        "worst",
        "missed",
        f"missed at {FAST:g} m/s",
        "energy drift",
        "time per simulated second",
        f"relative to {OURS}",
    )
    rows: list[tuple[str, ...]] = [head]
    for hz in sorted({row["hz"] for row in data["rows"]}):
        group = [row for row in data["rows"] if row["hz"] == hz]
        best = {key: min((row[key] for row in group if row[key] is not None), default=None) for key, _ in columns}
        for row in group:
            cells = [f"**{show(row)}**" if row[key] == best[key] else show(row) for key, show in columns]
            rows.append((str(hz), row["engine"], *cells))
    return rows
