"""The pages' modules by themselves: how pictures are timed."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from benchmarks.web.browser import Browser

PLAYOUT = """
const [states, pictures, done] = arguments;
import("/static/js/playout.js").then(({ Playout }) => {
  const playout = new Playout();
  const shown = [];
  const left = [...states];
  for (const now of pictures) {
    while (left.length && left[0][1] <= now) {
      const [time, arrived, notice] = left.shift();
      playout.push({ time, positions: [[time, 2 * time]], notice, elapsed: time }, arrived);
    }
    const state = playout.at(now);
    shown.push(state === null ? null : [state.positions[0][0], state.positions[0][1], state.elapsed]);
  }
  done(shown);
});
"""
"""Shows states (time, arrival, notice) at the times of pictures. What moves is where the time is."""

TRAJECTORY = """
const [bytes, times, done] = arguments;
import("/static/js/trajectory.js").then(({ Trajectory }) => {
  const trajectory = new Trajectory(new Uint8Array(bytes).buffer);
  done([trajectory.seconds, times.map((time) => trajectory.at(time)), trajectory.contactsBetween(0.1, 0.35)]);
});
"""


@pytest.fixture
def page(browser: Browser, address: str) -> Browser:
    """A page from which modules can be loaded."""
    browser.open(f"{address}/air")
    return browser


def shown(page: Browser, states: list[list[Any]], pictures: list[float]) -> np.ndarray:
    """Where the time is in each picture, s of the server's clock."""
    result = page.driver.execute_async_script(PLAYOUT, states, pictures)
    first = next(k for k, state in enumerate(result) if state is not None)
    places = np.array(result[first:])
    np.testing.assert_allclose(places[:, 1], 2.0 * places[:, 0], atol=1e-9)
    np.testing.assert_allclose(places[:, 2], places[:, 0], atol=1e-9)
    return places[:, 0]


PICTURES = [k / 60 for k in range(240)]


@pytest.mark.parametrize("way", [0.001, 0.08])
@pytest.mark.parametrize("jitter", [0.0, 0.02])
def test_pictures_move_evenly_and_never_beyond_what_is_known(way: float, jitter: float, page: Browser) -> None:
    draw = np.random.default_rng(0)
    times = [1000.0 + k / 60 + 0.004 * draw.uniform() for k in range(240)]
    arrivals = np.maximum.accumulate([time - 1000.0 + way + jitter * draw.uniform() for time in times]).tolist()
    seen = shown(page, [[t, a, ""] for t, a in zip(times, arrivals, strict=True)], PICTURES)
    later = seen[60:]
    steps = np.diff(later)
    assert (steps >= -1e-9).all()
    assert np.abs(steps - 1 / 60).max() < (0.003 if jitter == 0.0 else 0.012)
    known = [
        max((t for t, a in zip(times, arrivals, strict=True) if a <= now), default=0.0)
        for now in PICTURES[-len(later) :]
    ]
    assert (later <= np.array(known) + 1e-9).all()
    late = 1000.0 + np.array(PICTURES[-len(later) :]) - later
    assert late.max() < way + jitter + 2 / 60


def test_a_hold_up_is_made_good_soon(page: Browser) -> None:
    times = [1000.0 + k / 60 for k in range(240)]
    arrivals = [max(t - 1000.0 + 0.002, 1.0 if 0.8 < t - 1000.0 < 1.0 else 0.0) for t in times]
    seen = shown(page, [[t, a, ""] for t, a in zip(times, arrivals, strict=True)], PICTURES)
    late = 1000.0 + np.array(PICTURES[-len(seen) :]) - seen
    assert late[50:61].max() > 0.15  # nothing was known
    assert late[140:].max() < 0.035
    assert (np.diff(seen) >= -1e-9).all()


def test_a_serve_is_no_movement(page: Browser) -> None:
    states = [[1000.0 + k / 60, k / 60 + 0.002, "goal" if k < 30 else ""] for k in range(60)]
    seen = shown(page, states, [k / 240 for k in range(230)])
    before, after = 1000.0 + 29 / 60, 1000.0 + 30 / 60
    assert not ((seen > before + 1e-9) & (seen < after - 1e-9)).any()


def test_a_trajectory_is_read_and_shown_at_any_time(page: Browser) -> None:
    positions = np.arange(5 * 6, dtype="<f4").reshape(5, 3, 2)
    arrays = {
        "positions": positions,
        "scores": np.array([[0, 0], [0, 0], [1, 0], [1, 0], [1, 1]], "<i4"),
        "clocks": np.linspace(-1.0, 1.0, 5).astype("<f4"),
        "contacts": np.array([[0.5, 0, 2, 0.1, 0.2, 1, 0, 0.3], [3.25, 2, -1, 0, 0, 0, 1, 0.1]], "<f4"),
        "starts": np.array([0, 3], "<i4"),
    }
    head = {"control_hz": 10.0, "arrays": [[name, a.dtype.str, a.shape] for name, a in arrays.items()]}
    content = json.dumps(head).encode() + b"\n" + b"".join(array.tobytes() for array in arrays.values())
    seconds, states, contacts = page.driver.execute_async_script(
        TRAJECTORY, list(content), [-1.0, 0.05, 0.25, 0.4, 9.0]
    )
    assert seconds == pytest.approx(0.4)
    np.testing.assert_allclose(states[0]["positions"], positions[0])
    np.testing.assert_allclose(states[1]["positions"], positions[0] + 3.0)
    np.testing.assert_allclose(states[2]["positions"], positions[2])  # the next state begins another segment
    assert states[2]["score"] == [1, 0]
    np.testing.assert_allclose(states[3]["positions"], positions[4])
    assert states[4] == states[3] and states[4]["score"] == [1, 1]
    assert [contact[0] for contact in contacts] == pytest.approx([0.325])
