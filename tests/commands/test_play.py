"""The window of a match and its sounds."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from agents.human.screen import MatchWindow
from agents.human.sounds import Sounds, synthesise
from airhockey_env.drawing.palette import COLORS, Color
from airhockey_env.drawing.render import Renderer
from airhockey_env.kernel.state import PUCK, RIGHT
from airhockey_env.live.match import KINDS, START_PAUSE, Event, LiveMatch
from airhockey_env.tables import CHALLENGE, FULL_SIZE, TableSpec
from scripts.play import PlayArgs, play
from tests.helpers import ROOT, Call, still_policy

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


# Sounds


@pytest.mark.parametrize("kind", KINDS)
def test_sounds_begin_and_end_in_silence_and_are_not_clipped(kind: str) -> None:
    wave = synthesise(kind).astype(np.int64)
    assert 0.05 < len(wave) / 44_100 < 2.5
    assert 8_000 < np.abs(wave).max() < 20_000
    assert abs(wave[-1]) < 400


def test_sounds_play(pygame, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_AUDIODRIVER", "dummy")
    pygame.mixer.quit()
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
        for share, color in ((0.62, COLORS.left), (1.7, COLORS.surface)):
            x = round(pixel[0] + share * radius * math.cos(angle))
            y = round(pixel[1] + share * radius * math.sin(angle))
            # Markings and air holes are on the table too: the difference from the paddle's colour is far larger.
            far = np.abs(frame[y, x].astype(int) - color).max()
            assert far < 90, (share, angle, frame[y, x])


def is_like(picture: np.ndarray, color: Color) -> np.ndarray:
    """Which pixels have a colour, but for what rounding does to letters."""
    return np.abs(picture.astype(int) - color).max(axis=2) <= 5


def test_a_turn_in_a_window(pygame) -> None:
    table = MatchWindow(LiveMatch("idle", points=1, seed=0), "idle", size=(640, 352), fps=1000.0, sound=False)
    match, window = table.match, table.window
    match.restart(START)
    match._state["position"][PUCK] = (0.4, 0.1)
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

    match._state["position"][PUCK] = (0.5 * FULL_SIZE.length - 0.05, 0.0)  # before the goal, on its way in
    match._state["velocity"][PUCK] = (5.0, 0.0)
    match._state["position"][RIGHT, 1] = 0.4
    table.turn(BEGUN + 1.05)
    assert match.over and match.score == (1, 0)
    over = picture()
    assert is_like(over[60:140, 250:390], COLORS.left_light).any()  # "You win"
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_r))
    table.turn(BEGUN + 1.1)
    assert not match.over and match.notice == "start" and match.score == (0, 0)
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE))
    table.run()
    assert window.closed


def test_closing_the_window_leaves(pygame) -> None:
    table = MatchWindow(LiveMatch("striker"), "striker", size=(64, 48), fps=1000.0, sound=False)
    table.turn(START)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    table.run()
    assert table.window.closed


def test_without_fonts_there_are_pictures(pygame, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise NotImplementedError("font module not available")

    monkeypatch.setattr(pygame.font, "init", missing)
    table = MatchWindow(LiveMatch("striker"), "striker", size=(640, 352), fps=1000.0, sound=False)
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
