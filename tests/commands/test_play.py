"""A person at the table: the match against the clock, the hand that follows the pointer, and the window."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from agents.human.live_match import (
    CONTROL_HZ,
    KINDS,
    MOST_BEHIND,
    POINT_PAUSE,
    POLICY_HZ,
    START_PAUSE,
    Event,
    Hand,
    LiveMatch,
    Pointer,
    approach_speed,
)
from agents.human.sounds import Sounds, synthesise
from airhockey_env.drawing import render
from airhockey_env.drawing.render import Renderer
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.tables import CHALLENGE, FULL_SIZE, TableSpec
from scripts.play import PlayArgs, Table, play
from tests.helpers import ROOT, Call, still_policy

TICK = 1.0 / CONTROL_HZ
STEP = FULL_SIZE.paddle_acceleration * TICK
HAND = Hand(FULL_SIZE.paddle_speed, STEP, TICK, (-1.13, -0.52), (-0.05, 0.52))
START = 10.0
BEGUN = START + START_PAUSE


# From pixels to metres


@pytest.mark.parametrize("table", [FULL_SIZE, CHALLENGE])
@pytest.mark.parametrize("size", [(1280, 704), (400, 900), (33, 32)])
def test_pixels_and_metres_are_each_others_inverse(table: TableSpec, size: tuple[int, int]) -> None:
    renderer = Renderer(table, size)
    for place in ((0.0, 0.0), (-0.7, 0.31), (1.5, -2.0)):
        assert renderer.to_table(*renderer.to_picture(*place)) == pytest.approx(place, abs=1e-12)
    assert renderer.to_table(0.5 * size[0], 0.5 * size[1]) == (0.0, 0.0)


def test_a_paddle_is_drawn_where_its_pixel_says() -> None:
    renderer = Renderer(FULL_SIZE, (640, 352))
    place = renderer.to_table(100.5, 200.5)
    frame = renderer.draw([place, (0.9, 0.0), (0.5, 0.0)])
    assert_paddle(frame, (100, 200), renderer.scale * FULL_SIZE.paddle_radius)


# The hand


def drive(place: np.ndarray, velocity: np.ndarray, action: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """What the game makes of an action, away from the edges."""
    assert math.hypot(*action) <= 1.0 + 1e-12
    change = np.array(action) * HAND.speed - velocity
    length = np.hypot(*change)
    velocity = velocity + change * min(1.0, HAND.step / length if length > 0.0 else 1.0)
    return place + velocity * HAND.tick, velocity


@pytest.mark.parametrize("distance", [0.0, 1e-9, 1e-4, 0.003, 0.05, 0.4])
def test_the_approach_ends_at_the_target(distance: float) -> None:
    left, speed = distance, approach_speed(distance, STEP, TICK)
    while left > 1e-12:
        following = approach_speed(left, STEP, TICK)
        assert following >= speed - STEP - 1e-9  # it can brake as hard as that
        speed = following
        left -= speed * TICK
        assert left >= -1e-12
    assert speed <= STEP + 1e-9  # and stand still a tick later


def test_a_resting_paddle_reaches_a_still_target_without_overshoot_and_in_the_least_time() -> None:
    generator = np.random.default_rng(0)
    for _ in range(200):
        start, target = generator.uniform(HAND.near, HAND.far), generator.uniform(HAND.near, HAND.far)
        place, velocity, elapsed = start, np.zeros(2), 0.0
        distance = float(np.hypot(*(target - start)))
        way = (target - start) / distance
        while np.hypot(*(place - target)) > 1e-9 or np.hypot(*velocity) > 1e-9:
            action = HAND.follow(place, velocity, (float(target[0]), float(target[1])))
            place, velocity = drive(place, velocity, action)
            elapsed += TICK
            assert (place - target) @ way < 1e-9
            assert elapsed < 1.0
        top = min(HAND.speed, math.sqrt(distance * FULL_SIZE.paddle_acceleration))
        least = distance / top + top / FULL_SIZE.paddle_acceleration
        assert elapsed <= least + 3.0 * TICK


def test_a_moving_paddle_comes_to_rest_at_any_target() -> None:
    generator = np.random.default_rng(1)
    for _ in range(200):
        place, velocity = generator.uniform(HAND.near, HAND.far), generator.uniform(-3.0, 3.0, 2)
        target = generator.uniform(HAND.near, HAND.far)
        for _ in range(round(1.2 / TICK)):
            action = HAND.follow(place, velocity, (float(target[0]), float(target[1])))
            place, velocity = drive(place, velocity, action)
        assert np.hypot(*(place - target)) < 1e-6


def test_a_steady_target_is_caught_up_with() -> None:
    place, velocity = np.array([-0.8, -0.4]), np.zeros(2)
    for k in range(round(0.4 / TICK)):
        target = (-0.8, -0.4 + 1.5 * (k + 1) * TICK)
        place, velocity = drive(place, velocity, HAND.follow(place, velocity, target, (0.0, 1.5)))
    assert place == pytest.approx(target, abs=1e-9)


def test_reachable() -> None:
    assert HAND.reachable((0.5, -3.0)) == (-0.05, -0.52)
    assert HAND.reachable((-0.5, 0.1)) == (-0.5, 0.1)


# The pointer


def test_a_pointer_between_reports() -> None:
    pointer = Pointer()
    assert not pointer
    pointer.move(1.0, (0.0, 1.0))
    assert pointer.place(0.5) == pointer.place(1.5) == (0.0, 1.0)
    pointer.move(1.1, (0.2, 0.0))
    assert pointer.place(1.05) == pytest.approx((0.1, 0.5))
    assert pointer.place(2.0) == (0.2, 0.0)
    assert pointer


def test_the_velocity_of_a_pointer() -> None:
    def velocity(path: Callable[[float], float]) -> float:
        pointer = Pointer()
        for k in range(31):
            pointer.move(k / 60, (path(k / 60), 0.0))
        assert pointer.velocity(0.5)[1] == 0.0
        return pointer.velocity(0.5)[0]

    assert velocity(lambda t: 0.3) == 0.0
    assert velocity(lambda t: 2.0 * t) == pytest.approx(2.0)
    assert velocity(lambda t: 0.0 if t < 0.49 else 0.4) < 0.05 * 0.4 * 60  # a jump
    assert velocity(lambda t: min(t, 0.45)) == 0.0  # it has stopped
    assert velocity(lambda t: abs(t - 0.485)) == 0.0  # it has turned back
    assert 0.0 < velocity(lambda t: -((0.55 - t) ** 2)) < 2.0 * (0.55 - 0.5) + 0.02  # it is stopping


def test_a_pointer_remembers_moments_only() -> None:
    pointer = Pointer()
    for k in range(10_000):
        pointer.move(k / 1000, (k / 1000, 0.0))
    assert len(pointer._path) < 300


# The match


def begun(opponent: MlpPolicy | str = "idle", **arguments: object) -> LiveMatch:
    """A match that is being played from `BEGUN` on, with the puck out of the left paddle's way."""
    match = LiveMatch(opponent, seed=0, **arguments)  # type: ignore[arg-type]
    match.restart(START)
    match._table["position"][PUCK] = (0.4, 0.1)
    match._table["side"] = 1
    match.advance(BEGUN, None)
    assert not match.paused
    return match


def steps(match: LiveMatch) -> int:
    """Control steps that were played since the match began."""
    return int(match._table["steps"])


def shoot(match: LiveMatch, side: int) -> None:
    """Put the puck before a goal, on its way in."""
    match._table["position"][PUCK] = (side * (0.5 * FULL_SIZE.length - 0.05), 0.0)
    match._table["velocity"][PUCK] = (side * 5.0, 0.0)
    match._table["position"][LEFT if side < 0 else RIGHT, 1] = 0.4


@pytest.mark.parametrize("fps", [23.7, 60.0, 144.0, 480.0])
def test_the_game_keeps_the_time_of_the_wall(fps: float) -> None:
    match = begun()
    for k in range(1, round(3.0 * fps) + 1):
        match.advance(BEGUN + k / fps, None)
        assert abs(steps(match) - k / fps * CONTROL_HZ) <= 1.0 + 1e-6


def test_a_hold_up_is_not_caught_up_with() -> None:
    match = begun()
    match.advance(BEGUN + 60.0, None)
    assert steps(match) <= MOST_BEHIND * CONTROL_HZ + 1
    before = steps(match)
    match.advance(BEGUN + 60.0 + 10 * TICK, None)
    assert abs(steps(match) - before - 10) <= 1


def test_the_frame_rate_does_not_change_the_game() -> None:
    ends = []
    for fps in (25, 50, 100, 200):
        match = begun("striker")
        for k in range(1, 2 * fps + 1):
            match.advance(BEGUN + k / fps + 1e-7, (-0.8, 0.2))
        ends.append(match._table["position"].copy())
    for end in ends[1:]:
        np.testing.assert_array_equal(end, ends[0])


def test_a_picture_lies_between_the_last_two_steps() -> None:
    match = begun()
    match._table["velocity"][PUCK] = (1.0, 0.0)
    match.advance(BEGUN + 10.01 * TICK, None)
    at = match.positions[PUCK, 0]
    for share in (0.25, 0.5, 0.99):
        match.advance(BEGUN + (10.0 + share) * TICK, None)
        assert match.positions[PUCK, 0] - at == pytest.approx((share - 0.01) * TICK, rel=0.01)
    match.advance(BEGUN + 11.01 * TICK, None)  # and goes on without a jump
    assert match.positions[PUCK, 0] - at == pytest.approx(TICK, rel=0.01)


def test_the_paddle_goes_where_the_pointer_jumps_to_and_no_further() -> None:
    match = begun()
    home = match.positions[LEFT].copy()
    target = np.array([-0.5, -0.3])
    way = (target - home) / np.hypot(*(target - home))
    furthest = 0.0
    for k in range(1, 61):
        match.advance(BEGUN + k / 60, (float(target[0]), float(target[1])) if k > 3 else (float(home[0]), 0.0))
        furthest = max(furthest, float((match.positions[LEFT] - home) @ way))
    assert match.positions[LEFT] == pytest.approx(target, abs=1e-6)
    assert furthest <= np.hypot(*(target - home)) + 1e-4


@pytest.mark.parametrize("fps", [60, 144])
def test_the_paddle_keeps_up_with_a_hand(fps: int) -> None:
    """Over 0.4 m in 0.35 s, as smoothly as people do it (minimum jerk): 2.1 m/s at most."""
    match = begun()
    home = float(match.positions[LEFT, 0])

    def hand(elapsed: float) -> float:
        share = min(max((elapsed - 0.2) / 0.35, 0.0), 1.0)
        return 0.4 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)

    behind = []
    for k in range(1, fps + 1):
        elapsed = k / fps
        match.advance(BEGUN + elapsed, (home, hand(elapsed)))
        behind.append(hand(elapsed - TICK) - float(match.positions[LEFT, 1]))  # a picture shows the step before
    assert max(behind) < 0.015
    assert min(behind) > -0.001


def test_a_pointer_out_of_reach_leads_along_the_edge() -> None:
    match = begun()
    for k in range(1, 91):
        match.advance(BEGUN + k / 60, (1.0, -0.1))
    assert match.positions[LEFT] == pytest.approx((-FULL_SIZE.paddle_radius, -0.1), abs=1e-6)
    assert match.target == (1.0, -0.1)


def test_without_a_pointer_the_paddle_stays() -> None:
    match = begun()
    home = match.positions[LEFT].copy()
    match.advance(BEGUN + 0.09, None)
    np.testing.assert_array_equal(match.positions[LEFT], home)
    assert match.target is None


@pytest.mark.parametrize(("side", "kind", "score"), [(1, "goal", (1, 0)), (-1, "conceded", (0, 1))])
def test_after_a_goal_the_picture_rests_and_does_not_slide_to_the_serve(
    side: int, kind: str, score: tuple[int, int]
) -> None:
    match = begun()
    shoot(match, side)
    paddles = match._table["position"][:PUCK].copy()
    events = match.advance(BEGUN + 0.05, None)
    assert events[-1].kind == match.notice == kind and match.paused and not match.over
    assert match.score == score
    assert abs(match.positions[PUCK, 0]) == pytest.approx(0.5 * FULL_SIZE.length, abs=0.03)
    np.testing.assert_array_equal(match.positions[:PUCK], paddles)
    rested = match.positions.copy()
    scored = BEGUN + 0.05
    match.advance(scored + POINT_PAUSE - 0.06, None)
    np.testing.assert_array_equal(match.positions, rested)
    match.advance(scored + POINT_PAUSE + 0.25 * TICK, None)
    assert not match.paused and match.notice == ""
    served = match._table["position"].copy()  # the serve is at rest, and so is everything in the picture
    np.testing.assert_allclose(match.positions, served, atol=1e-12)
    assert served[PUCK, 0] * side > 0.0


def test_a_foul_is_noticed() -> None:
    match = begun()
    events: list[Event] = []
    for k in range(1, round(7.2 * 60)):
        events += match.advance(BEGUN + k / 60, None)
    assert [event.kind for event in events] == ["foul"]
    assert match.notice == "foul" and match.score == (0, 0)


def test_hits_are_reported_with_their_strength() -> None:
    match = begun()
    match._table["position"][PUCK] = (0.5, 0.5 * FULL_SIZE.width - FULL_SIZE.puck_radius - 0.02)
    match._table["velocity"][PUCK] = (0.0, 4.0)
    (event,) = match.advance(BEGUN + 0.02, None)
    assert event.kind == "wall" and event.x == pytest.approx(0.5, abs=0.01)
    expected = 4.0 * (1.0 + FULL_SIZE.wall_restitution) / FULL_SIZE.puck_speed
    assert event.strength == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(("side", "kind"), [(1, "won"), (-1, "lost")])
def test_the_end_of_a_match_and_another(side: int, kind: str) -> None:
    match = begun(points=2)
    now = BEGUN
    for _ in range(2):
        while match.paused:
            now += 0.05
            match.advance(now, None)
        shoot(match, side)
        now += 0.05
        match.advance(now, None)
    assert match.over and match.notice == kind and match.score == ((2, 0) if side > 0 else (0, 2))
    played, shown = steps(match), match.positions.copy()
    for k in range(100):
        assert match.advance(now + k, (-0.5, 0.0)) == []
    assert steps(match) == played
    np.testing.assert_array_equal(match.positions, shown)
    match.restart(now + 100.0)
    assert not match.over and match.notice == "start" and match.score == (0, 0) and match.clock == 0.0
    assert match.positions[LEFT] == pytest.approx((-0.4 * FULL_SIZE.length, 0.0))
    match.advance(now + 100.0 + START_PAUSE + 0.05, None)
    assert steps(match) > 0


def test_a_restart_in_mid_play() -> None:
    match = begun("striker")
    match.advance(BEGUN + 0.09, (-0.5, 0.3))
    match.restart(BEGUN + 0.1)
    assert match.paused and match.target is None and steps(match) == 0


def test_a_trained_policy_plays_at_the_rate_that_it_learned_at() -> None:
    asked = []

    class Policy(MlpPolicy):
        def __call__(self, observations: np.ndarray) -> np.ndarray:
            asked.append(observations.copy())
            return np.ones((1, 2), np.float32)

    policy = Policy([np.zeros((2, 13), np.float32)], [np.zeros(2, np.float32)])
    match = begun(policy, skill=0.5)
    for k in range(1, 21):
        match.advance(BEGUN + k / 20, None)
    assert abs(len(asked) - POLICY_HZ) <= 1
    assert asked[0].shape == (1, 13) and asked[0][0, 0] == pytest.approx(-0.8)  # it sees its own home
    # Forward and to its left is towards -x and -y; at half skill its paddle has half its speed.
    assert match.positions[RIGHT, 0] < 0.1 and match.positions[RIGHT, 1] < -0.4


@pytest.mark.parametrize(("name", "value"), [("opponent", "nobody"), ("skill", 2.0), ("points", 0), ("table", "pool")])
def test_bad_arguments_are_named(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=f"{name} must be"):
        LiveMatch(**{"opponent": "idle", name: value})  # type: ignore[arg-type]


# Sounds


@pytest.mark.parametrize("kind", KINDS)
def test_sounds_begin_and_end_in_silence_and_are_not_clipped(kind: str) -> None:
    wave = synthesise(kind).astype(np.int64)
    assert 0.05 < len(wave) / 44_100 < 2.5
    assert 8_000 < np.abs(wave).max() < 20_000
    assert abs(wave[-1]) < 400


def test_sounds_play(pygame) -> None:
    sounds = Sounds(2.0)
    assert sounds.working
    sounds.play([Event(kind, 0.5, x) for kind in KINDS for x in (-1.0, 1.0)])
    assert pygame.mixer.get_busy()
    sounds.close()
    sounds.play([Event("goal")])
    assert not sounds.working and pygame.mixer.get_init() is None


def test_without_an_audio_device_there_is_silence(
    pygame, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("SDL_AUDIODRIVER", "no such driver")
    sounds = Sounds(2.0)
    sounds.play([Event("goal")])
    sounds.close()
    assert not sounds.working
    printed = capfd.readouterr()
    assert printed.out == printed.err == ""


# A window without a screen


def assert_paddle(frame: np.ndarray, pixel: tuple[int, int], radius: float) -> None:
    """The left paddle's middle is at a pixel: its colour all around, and the table's beyond."""
    for angle in np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False):
        for share, color in ((0.62, render.LEFT), (1.7, render.SURFACE)):
            x = round(pixel[0] + share * radius * math.cos(angle))
            y = round(pixel[1] + share * radius * math.sin(angle))
            # Markings and air holes are on the table too: the difference from the paddle's colour is far larger.
            far = np.abs(frame[y, x].astype(int) - color).max()
            assert far < 90, (share, angle, frame[y, x])


def is_like(picture: np.ndarray, color: render.Color) -> np.ndarray:
    """Which pixels have a colour, but for what rounding does to letters."""
    return np.abs(picture.astype(int) - color).max(axis=2) <= 5


def test_a_turn_in_a_window(pygame) -> None:
    table = Table(LiveMatch("idle", points=1, seed=0), "idle", size=(640, 352), fps=1000.0, sound=False)
    match, window = table.match, table.window
    match.restart(START)
    match._table["position"][PUCK] = (0.4, 0.1)
    target = table.renderer.to_picture(-0.7, -0.3)
    pixel = round(target[0]), round(target[1])

    def picture() -> np.ndarray:
        return pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)

    table.turn(START + 0.5)
    rest = picture()
    assert match.notice == "start"
    pygame.event.post(pygame.event.Event(pygame.MOUSEMOTION, pos=pixel, rel=(0, 0), buttons=(0, 0, 0)))
    for k in range(1, 61):
        table.turn(BEGUN + k / 60)
    assert window.pointer == pixel
    radius = table.renderer.scale * FULL_SIZE.paddle_radius
    assert_paddle(picture(), pixel, radius)
    assert (picture()[60:140, 250:390] != rest[60:140, 250:390]).any(axis=2).mean() > 0.5  # the banner is gone

    shoot(match, 1)
    table.turn(BEGUN + 1.05)
    assert match.over and match.score == (1, 0)
    over = picture()
    assert is_like(over[60:140, 250:390], render.LEFT_LIGHT).any()  # "You win"
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_r))
    table.turn(BEGUN + 1.1)
    assert not match.over and match.notice == "start" and match.score == (0, 0)
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE))
    table.run()
    assert window.closed


def test_closing_the_window_leaves(pygame) -> None:
    table = Table(LiveMatch("striker"), "striker", size=(64, 48), fps=1000.0, sound=False)
    table.turn(START)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    table.run()
    assert table.window.closed


def test_without_fonts_there_are_pictures(pygame, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise NotImplementedError("font module not available")

    monkeypatch.setattr(pygame.font, "init", missing)
    table = Table(LiveMatch("striker"), "striker", size=(640, 352), fps=1000.0, sound=False)
    table.turn(START)
    assert not table.window.closed
    table.window.close()


@pytest.fixture
def escape(pygame, call: Call, monkeypatch: pytest.MonkeyPatch) -> Call:
    """`call`; a person presses Esc as soon as the window is there."""
    monkeypatch.setattr("airhockey_env.drawing.window.Window.pressed", lambda self: ["escape"])
    return call


@pytest.mark.parametrize("sound", ["--sound", "--no-sound"])
def test_the_command(sound: str, escape: Call, tmp_path: Path) -> None:
    run = tmp_path / "my_run"
    run.mkdir()
    still_policy().save(run / "policy.npz")
    for opponent, name in (("goalie", "goalie"), (str(run), "my_run"), (str(run / "policy.npz"), "my_run")):
        arguments = ("--opponent", opponent, "--skill", "0.5", "--size", "320", "200", "--fps", "480", sound)
        assert f"You 0 : 0 {name}" in escape("play", *arguments)


def test_no_screen(escape: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "no such driver")
    assert "screen" in escape("play", "--size", "64", "48", "--no-sound", fails=True)


def test_a_driver_without_a_screen(pygame, escape: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    """SDL falls back on one by itself; a match that nobody can see would go on for ever."""
    for name in ("SDL_VIDEODRIVER", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
    monkeypatch.setattr(pygame.display, "set_mode", lambda size: pygame.Surface(size))
    assert "screen" in escape("play", "--size", "64", "48", "--no-sound", fails=True)


def test_no_pygame(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(gymnasium.error.DependencyNotInstalled, match=r"\[human\]"):
        play(PlayArgs())


SHOW = """
import sys, warnings
import gymnasium, airhockey_env
warnings.simplefilter("always")
env = gymnasium.make("AirHockey-v0", render_mode="human")
with warnings.catch_warnings(record=True) as caught:
    env.reset(seed=0)
print([str(warning.message) for warning in caught])
import pygame
print(pygame.display.get_driver())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="screens are asked for otherwise")
@pytest.mark.parametrize("chosen", [None, "dummy"])
def test_human_rendering_without_a_screen_says_so(chosen: str | None) -> None:
    hidden = ("SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER", "DISPLAY", "WAYLAND_DISPLAY")
    environment = {name: value for name, value in os.environ.items() if name not in hidden}
    environment["PYTHONPATH"] = str(ROOT)
    if chosen is not None:
        environment["SDL_VIDEODRIVER"] = chosen
    done = subprocess.run([sys.executable, "-c", SHOW], env=environment, capture_output=True, text=True)
    if "needs a screen" in done.stderr:
        assert chosen is None and "render_mode" in done.stderr  # SDL has nothing to fall back on
        return
    assert done.returncode == 0, done.stderr
    said, driver = done.stdout.splitlines()
    if chosen is not None:
        assert said == "[]" and driver == chosen
    elif driver in ("offscreen", "dummy"):  # and not a console's frame buffer, say
        assert "render_mode" in said and driver in said and "screen" in said
