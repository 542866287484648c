"""Fitting a table: simulated tables come out as they are, and what a track does not tell is said."""

from __future__ import annotations

import dataclasses
import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from agents.conditions import read_table
from agents.fitting.estimates import _within
from agents.fitting.fit import BOUNDED, DRAG, FITTED, GIVEN, KEPT, Field, TableFit, fit_table
from agents.fitting.flights import drop_glitches, find_flights, measure_noise
from agents.fitting.glides import place_at, slide
from agents.fitting.report import remarks, rounded
from agents.fitting.simulated import simulate_play, simulate_throws
from agents.fitting.tracks import FEWEST_ROWS, MOST_ROWS, Track, read_track, write_track
from agents.fitting.turns import turn
from airhockey_env.tables import FIELDS, FULL_SIZE, PRESETS, TableSpec
from tests.helpers import Call

WALLS = ("wall_restitution", "wall_tangential")
ODD = dataclasses.replace(
    FULL_SIZE, length=1.8, width=0.95, puck_radius=0.03, goal_width=0.3, wall_restitution=0.9, drag_linear=0.2
)


def holds(fit: TableFit, spec: TableSpec, *names: str) -> None:
    """Check that these fields are fitted, and that what the table is lies within their intervals, made twice as wide.

    One 95 % interval in twenty misses it, which is how the study counts them; hardly one in ten thousand misses it by
    as much again.
    """
    for name in names:
        field = fit.fields[name]
        assert field.source == FITTED, (name, field)
        assert field.low is not None and field.high is not None
        assert field.low <= field.value <= field.high
        truth, more = getattr(spec, name), 0.5 * (field.high - field.low)
        assert field.low - more <= truth <= field.high + more, (name, field)


def straight(seconds: float, noise: float = 1e-3, hz: float = 120.0) -> Track:
    """A puck that glides at 0.5 m/s without drag, and meets nothing."""
    time = np.arange(0.0, seconds, 1.0 / hz)
    rng = np.random.default_rng(0)
    x, y = 0.4 * time + noise * rng.normal(size=len(time)), 0.3 * time + noise * rng.normal(size=len(time))
    return Track(time, x, y)


def bouncing(shares: np.ndarray, fall: float = 0.0, seed: int = 0) -> Track:
    """Flights between two side walls at ±0.5 m: one from wall to wall, then a pause, for each share that is kept.

    `fall` is how much of the share is lost per m/s of normal speed.
    """
    rng = np.random.default_rng(seed)
    drag, rows, clock = np.array([0.02, 0.0, 0.03]), [], 0.0
    for share in shares:
        speed = float(rng.uniform(1.0, 5.0))
        before = np.array([0.0, -0.4, 0.3 * speed, speed])
        way = np.linspace(0.0, 2.0, 20001)
        places, velocities = place_at(before, drag, way)
        hit = int(np.searchsorted(places[1], 0.5))
        kept = share - fall * velocities[1, hit]
        after = np.array([places[0, hit], 0.5, 0.7 * velocities[0, hit], -kept * velocities[1, hit]])
        for k in range(200):
            time = k / 120.0
            start, since = (before, time) if time < way[hit] else (after, time - way[hit])
            place = place_at(start, drag, np.array([since]))[0][:, 0]
            if place[1] < -0.45:
                break
            rows.append((clock + time, *(place + 1e-3 * rng.normal(size=2))))
        clock = rows[-1][0] + 1.0
    return Track(*np.array(rows).T.copy())


class TestSimulatedTables:
    @pytest.mark.parametrize("name", PRESETS)
    def test_a_thrown_puck(self, name: str) -> None:
        spec = PRESETS[name]
        fit = fit_table(simulate_throws(spec, 60.0, 1), ODD, {"puck_radius": spec.puck_radius})
        holds(fit, spec, *WALLS, *DRAG, "width", "length")
        assert fit.glides.noise == pytest.approx(1e-3, rel=0.05)
        assert fit.spec.wall_restitution == pytest.approx(spec.wall_restitution, abs=2e-3)
        assert fit.spec.width == pytest.approx(spec.width, abs=1e-3)
        assert fit.angle == 0.0

    def test_points_that_are_played(self) -> None:
        """The places where the strikers hit the puck are no walls."""
        fit = fit_table(simulate_play(ODD, 90.0, 3), FULL_SIZE, {"puck_radius": ODD.puck_radius})
        holds(fit, ODD, *WALLS, *DRAG, "width", "length")

    def test_axes_that_are_turned_and_moved(self) -> None:
        track = simulate_throws(ODD, 60.0, 2)
        turned = turn(track, -math.radians(1.2))
        moved = Track(turned.time + 1e9, turned.x + 1.0, turned.y - 0.5)
        fit = fit_table(moved, FULL_SIZE, {"puck_radius": ODD.puck_radius})
        holds(fit, ODD, *WALLS, *DRAG, "width", "length")
        assert math.degrees(fit.angle) == pytest.approx(1.2, abs=0.05)
        assert fit.centre[0] is not None and fit.centre[1] is not None
        back = turn(Track(np.zeros(1), np.array([fit.centre[0]]), np.array([fit.centre[1]])), -fit.angle)
        assert (back.x[0], back.y[0]) == pytest.approx((1.0, -0.5), abs=2e-3)

    def test_shots_into_the_goal_bound_its_width(self) -> None:
        fit = fit_table(simulate_throws(ODD, 240.0, 5), FULL_SIZE, {"puck_radius": ODD.puck_radius})
        field = fit.fields["goal_width"]
        assert field.source == BOUNDED
        assert field.low is not None and field.high is not None
        assert field.low <= ODD.goal_width <= field.high < field.low + 0.08


class TestWhatATrackTells:
    def test_without_a_bounce_the_walls_are_kept(self) -> None:
        fit = fit_table(straight(4.0), ODD)
        for name in (*WALLS, "length", "width", "puck_radius", "goal_width"):
            assert fit.fields[name].source == KEPT
            assert fit.fields[name].note
            assert getattr(fit.spec, name) == getattr(ODD, name)
        holds(fit, dataclasses.replace(ODD, drag_constant=0.0, drag_linear=0.0, drag_quadratic=0.0), *DRAG)

    def test_a_short_glide_does_not_tell_the_drag(self) -> None:
        fit = fit_table(straight(0.2), ODD)
        for name in DRAG:
            assert fit.fields[name].source == KEPT
            assert "m/s²" in fit.fields[name].note

    def test_a_size_that_is_known_tells_the_radius_of_the_puck(self) -> None:
        track = simulate_throws(ODD, 60.0, 1)
        fit = fit_table(track, FULL_SIZE, {"width": ODD.width})
        holds(fit, ODD, "puck_radius", "length")
        assert fit.fields["width"].source == GIVEN
        kept = fit_table(track, FULL_SIZE)
        assert kept.fields["puck_radius"].source == KEPT
        difference = 2.0 * (FULL_SIZE.puck_radius - ODD.puck_radius)
        assert kept.spec.width == pytest.approx(ODD.width + difference, abs=1e-3)

    def test_what_makes_no_table_is_refused(self) -> None:
        with pytest.raises(ValueError, match="goal_width"):
            fit_table(straight(4.0), ODD, {"goal_width": 5.0})

    @pytest.mark.parametrize("kind", ["still", "noise", "sparse"])
    def test_a_track_without_a_glide_is_refused(self, kind: str) -> None:
        time = np.arange(600) / 120.0
        rng = np.random.default_rng(0)
        place = {"still": 1e-3, "noise": 0.3, "sparse": 1e-3}[kind] * rng.normal(size=(2, 600))
        if kind == "sparse":
            time, place = 120.0 * time, place + 0.3 * time
        with pytest.raises(ValueError, match="glide"):
            fit_table(Track(time, *place), FULL_SIZE)

    def test_the_scatter_of_real_bounces_widens_the_interval(self) -> None:
        rng = np.random.default_rng(1)
        exact = fit_table(bouncing(np.full(40, 0.8)), FULL_SIZE)
        rough = fit_table(bouncing(rng.normal(0.8, 0.03, 40)), FULL_SIZE)
        spec = dataclasses.replace(FULL_SIZE, wall_restitution=0.8, wall_tangential=0.7)
        for fit in (exact, rough):
            assert len(fit.bounces) >= 38
            holds(fit, spec, *WALLS)
        assert rough.estimates.scatter[0] == pytest.approx(0.03, rel=0.3)
        assert exact.estimates.scatter[0] < 1e-3
        widths = [fit.estimates.shares[0].high - fit.estimates.shares[0].low for fit in (exact, rough)]
        assert widths[1] == pytest.approx(2.0 * 2.02 * 0.03 / math.sqrt(40), rel=0.3)
        assert widths[0] < 0.1 * widths[1]
        assert any("scatters" in line for line in remarks(rough))

    def test_a_restitution_that_falls_with_speed_is_reported(self) -> None:
        falls = fit_table(bouncing(np.full(30, 0.9), fall=0.04), FULL_SIZE)
        fall = falls.estimates.fall
        assert fall is not None
        assert fall.value == pytest.approx(-0.04, abs=fall.high - fall.low)
        assert fall.high < -0.035
        assert any("per m/s" in line for line in remarks(falls))


class TestParts:
    def test_noise_glitches_and_flights(self) -> None:
        track = straight(2.0)
        bounce = 120
        y = np.where(np.arange(len(track.y)) < bounce, track.y, 2.0 * 0.3 - track.y)
        x = track.x.copy()
        x[[50, 200]] += 0.2
        noise = measure_noise(Track(track.time, x, y))
        assert noise == pytest.approx(1e-3, rel=0.2)
        clean = drop_glitches(Track(track.time, x, y), noise)
        assert sorted(set(track.time) - set(clean.time)) == [track.time[50], track.time[200]]
        (first, cut), (again, end) = find_flights(clean, noise)
        assert (first, again, end) == (0, cut, len(clean.time))
        assert abs(cut - (bounce - 1)) <= 1

    def test_a_slide_is_the_integral_of_its_speeds(self) -> None:
        times = np.linspace(0.0, 1.5, 3001)
        drag = np.array([0.05, 0.3, 0.1])
        way, speeds = slide(times, 2.0, drag)
        assert speeds[0] == 2.0
        np.testing.assert_allclose(np.gradient(way, times)[1:-1], speeds[1:-1], rtol=1e-6)
        np.testing.assert_allclose(
            -np.gradient(speeds, times)[1:-1], drag[0] + drag[1] * speeds[1:-1] + drag[2] * speeds[1:-1] ** 2, rtol=1e-5
        )

    def test_intervals_within_limits(self) -> None:
        """The best of what is allowed, and the profile of the likelihood, which is a parabola for a single number."""
        limits = np.array([[0.0, np.inf]])
        (above,) = _within(np.array([3.0]), np.array([[1.0]]), limits, np.array([2.0]))
        assert above == pytest.approx((3.0, 1.0, 5.0))
        (below,) = _within(np.array([-1.0]), np.array([[1.0]]), limits, np.array([2.0]))
        assert below == pytest.approx((0.0, 0.0, math.sqrt(5.0) - 1.0))
        pair = _within(
            np.array([-1.0, 2.0]), np.array([[1.0, -0.5], [-0.5, 1.0]]), np.repeat(limits, 2, axis=0), np.full(2, 2.0)
        )
        assert pair[0].value == 0.0
        assert pair[1].value == pytest.approx(1.5), "what is best if the first one is 0"


GOOD = ["time,x,y", *(f"{k / 100},{0.01 * k},0" for k in range(FEWEST_ROWS))]
BAD = {
    "no column y": (["time,x", *GOOD[1:]], "'y'"),
    "a column twice": (["time,x,y,x", *(f"{line},0" for line in GOOD[1:])], "'x'"),
    "no head": (GOOD[1:], "'time'"),
    "semicolons": ([line.replace(",", ";") for line in GOOD], "separated by commas"),
    "empty": ([], "'time'"),
    "NaN": ([*GOOD, "9,nan,0"], f"line {FEWEST_ROWS + 2}: x"),
    "infinity": ([*GOOD, "9,0,inf"], f"line {FEWEST_ROWS + 2}: y"),
    "text": ([*GOOD, "nine,0,0"], f"line {FEWEST_ROWS + 2}: time"),
    "an empty cell": ([*GOOD, "9,,0"], f"line {FEWEST_ROWS + 2}: x"),
    "a short row": ([*GOOD, "9,0"], f"line {FEWEST_ROWS + 2}: y"),
    "millimetres": ([*GOOD, "9,500,0"], f"line {FEWEST_ROWS + 2}: x"),
    "not sorted": ([*GOOD, "0.1,0,0"], f"line {FEWEST_ROWS + 2}: time"),
    "a time twice": ([*GOOD, GOOD[-1]], f"line {FEWEST_ROWS + 2}: time"),
    "too short": (GOOD[:-1], f"from {FEWEST_ROWS}"),
    "too long": (["time,x,y", *(f"{k},0,0" for k in range(MOST_ROWS + 1))], f"{MOST_ROWS} rows"),
}


class TestDigits:
    @pytest.mark.parametrize(
        ("field", "shown"),
        [
            (Field(0.3, FITTED, 0.2981, 0.3021), ("0.3000", "0.2981 to 0.3021")),
            (Field(2.40512, FITTED, 2.39, 2.42), ("2.405", "2.390 to 2.420")),
            (Field(23.7, BOUNDED, 3.0, 45.0), ("24", "3 to 45")),
            (Field(0.5, FITTED, 0.5, 0.5), ("0.5000000", "0.5000000 to 0.5000000")),
            (Field(0.3345, KEPT), ("0.3345", "")),
        ],
    )
    def test_a_value_has_the_decimals_of_its_interval(self, field: Field, shown: tuple[str, str]) -> None:
        assert rounded(field) == shown


class TestFiles:
    def test_a_track_is_read_as_it_was_written(self, tmp_path: Path) -> None:
        track = straight(1.0)
        write_track(tmp_path / "track.csv", track)
        for read, written in zip(read_track(tmp_path / "track.csv"), track, strict=True):
            np.testing.assert_allclose(read, written, atol=6e-7)

    def test_other_columns_and_spaces_do_not_matter(self, tmp_path: Path) -> None:
        lines = ["frame, Y ,time,x", *(f"{k},0.5,{k / 100},{0.01 * k}" for k in range(FEWEST_ROWS)), ""]
        (tmp_path / "track.csv").write_text("\n".join(lines))
        track = read_track(tmp_path / "track.csv")
        assert (track.y == 0.5).all()
        assert track.time[-1] == pytest.approx(0.01 * (FEWEST_ROWS - 1))

    @pytest.mark.parametrize("kind", BAD)
    def test_a_bad_file_is_named(self, kind: str, call: Call, tmp_path: Path) -> None:
        lines, told = BAD[kind]
        (tmp_path / "track.csv").write_text("\n".join(lines))
        printed = call("fit_table", "track.csv", "--out", "table.json", fails=True)
        assert "track.csv" in printed
        assert told in printed
        assert [path.name for path in tmp_path.iterdir()] == ["track.csv"]

    def test_bytes_that_are_no_text(self, call: Call, tmp_path: Path) -> None:
        (tmp_path / "track.csv").write_bytes(bytes(range(256)) * 10)
        assert "track.csv" in call("fit_table", "track.csv", fails=True)


class TestCommand:
    def test_a_demo_gives_a_table(self, call: Call, tmp_path: Path) -> None:
        written = ("--out", "table.json", "--json", "fit.json", "--plot", "fit.png")
        printed = call("fit_table", "track.csv", "--demo", "40", "--table", "challenge", *written)
        assert set(FIELDS) <= set(printed.split())
        spec = read_table(str(tmp_path / "table.json"))  # as --table of any command reads it
        assert spec.wall_restitution == pytest.approx(PRESETS["challenge"].wall_restitution, abs=5e-3)
        assert spec.drag_linear == pytest.approx(PRESETS["challenge"].drag_linear, abs=0.02)
        told = json.loads((tmp_path / "fit.json").read_text())
        assert told["table"] == dataclasses.asdict(spec)
        assert {one["source"] for one in told["fields"].values()} == {FITTED, KEPT}
        assert (tmp_path / "fit.png").read_bytes().startswith(b"\x89PNG")

        again = call("fit_table", "track.csv", "--table", "challenge")
        assert again == printed
        assert "exists" in call("fit_table", "track.csv", "--demo", "40", fails=True)

    def test_a_track_that_tells_nothing_is_named(self, call: Call, tmp_path: Path) -> None:
        lines = ["time,x,y", *(f"{k / 100},0,0" for k in range(FEWEST_ROWS))]
        (tmp_path / "track.csv").write_text("\n".join(lines))
        assert "track.csv: " in call("fit_table", "track.csv", fails=True)

    def test_a_missing_extra_is_named(self, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "scipy", None)
        assert '".[fit]"' in call("fit_table", "track.csv", fails=True)

    def test_the_study(self, call: Call, tmp_path: Path) -> None:
        (tmp_path / "page.md").write_text("<!-- table thrown -->\n<!-- end of table thrown -->\n")
        options = ("--tables", "3", "--seconds", "30", "--only", "thrown")
        printed = call("fit_study", *options, "--json", "study.json", "--page", "page.md")
        rows = json.loads((tmp_path / "study.json").read_text())["thrown"]
        assert {row["field"] for row in rows} >= {*WALLS, *DRAG, "length", "width"}
        for row in rows:
            assert 0 <= row["held"] <= row["told"] <= row["tables"] == 3
            assert row["field"] in printed
        told = {row["field"]: row for row in rows}
        assert told["wall_restitution"]["told"] == 3
        assert told["wall_restitution"]["largest_error"] < 0.01
        assert "| wall_restitution | 3 of 3 |" in (tmp_path / "page.md").read_text()
