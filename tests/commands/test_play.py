"""The window of a match and its sounds.

The window is a real one too, under a virtual screen with a real mouse."""

from __future__ import annotations

import math
import os
import shutil
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import gymnasium
import numpy as np
import pytest

from agents.human.sounds import Sounds, synthesise
from airhockey_env.drawing.palette import COLORS, Color
from airhockey_env.drawing.render import Renderer
from airhockey_env.kernel.state import PUCK, RIGHT
from airhockey_env.live.match import KINDS, START_PAUSE, Event, LiveMatch
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.tables import CHALLENGE, FULL_SIZE, TableSpec

ROOT = Path(__file__).parents[2]
START = 10.0


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


@pytest.fixture
def pygame(monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    module = pytest.importorskip("pygame", reason="needs pygame-ce")
    module.display.quit()
    yield module
    module.mixer.quit()
    module.display.quit()


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
    from agents.human.screen import MatchWindow

    table = MatchWindow(LiveMatch("idle", points=1, seed=0), "idle", size=(640, 352), fps=1000.0, sound=False)
    match, window = table.match, table.window
    begun = START + START_PAUSE
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
        table.turn(begun + k / 60)
    assert window.pointer == pixel
    radius = table.renderer.scale * FULL_SIZE.paddle_radius
    assert_paddle(picture(), pixel, radius)
    assert (picture()[60:140, 250:390] != rest[60:140, 250:390]).any(axis=2).mean() > 0.5  # the banner is gone

    match._table["position"][PUCK] = (0.5 * FULL_SIZE.length - 0.05, 0.0)  # before the goal, on its way in
    match._table["velocity"][PUCK] = (5.0, 0.0)
    match._table["position"][RIGHT, 1] = 0.4
    table.turn(begun + 1.05)
    assert match.over and match.score == (1, 0)
    over = picture()
    assert is_like(over[60:140, 250:390], COLORS.left_light).any()  # "You win"
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_r))
    table.turn(begun + 1.1)
    assert not match.over and match.notice == "start" and match.score == (0, 0)
    pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.K_ESCAPE))
    table.run()
    assert window.closed


def test_closing_the_window_leaves(pygame) -> None:
    from agents.human.screen import MatchWindow

    table = MatchWindow(LiveMatch("striker"), "striker", size=(64, 48), fps=1000.0, sound=False)
    table.turn(START)
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    table.run()
    assert table.window.closed


def test_without_fonts_there_are_pictures(pygame, monkeypatch: pytest.MonkeyPatch) -> None:
    from agents.human.screen import MatchWindow

    def missing() -> None:
        raise NotImplementedError("font module not available")

    monkeypatch.setattr(pygame.font, "init", missing)
    table = MatchWindow(LiveMatch("striker"), "striker", size=(640, 352), fps=1000.0, sound=False)
    table.turn(START)
    assert not table.window.closed
    table.window.close()


def run_main(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> None:
    """Call the command; a person presses Esc as soon as the window is there."""
    from airhockey_env.drawing.window import Window
    from scripts.play import main

    monkeypatch.setattr(sys, "argv", ["play", *arguments])
    monkeypatch.setattr(Window, "pressed", lambda self: ["escape"])
    main()


@pytest.mark.parametrize("sound", ["--sound", "--no-sound"])
def test_the_command(
    sound: str, pygame, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    run = tmp_path / "my_run"
    run.mkdir()
    policy = MlpPolicy([np.zeros((2, 13), np.float32)], [np.zeros(2, np.float32)])
    policy.save(run / "policy.npz")
    for opponent, name in (("goalie", "goalie"), (str(run), "my_run"), (str(run / "policy.npz"), "my_run")):
        run_main(monkeypatch, "--opponent", opponent, "--skill", "0.5", "--size", "320", "200", "--fps", "480", sound)
        assert f"You 0 : 0 {name}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--opponent", "nobody"), "'nobody'"),
        (("--skill", "1.5"), "--skill must be from 0 to 1, got 1.5"),
        (("--points", "0"), "--points must be from 1 to 99, got 0"),
        (("--fps", "1"), "--fps must be from 20 to 480, got 1"),
        (("--size", "10", "500"), "--size must be two whole numbers from 32"),
        (("--table", "pool"), "--table must be one of"),
    ],
)
def test_bad_input(arguments: tuple[str, ...], message: str, pygame, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SystemExit) as stop:
        run_main(monkeypatch, *arguments)
    assert isinstance(stop.value.code, str) and message in stop.value.code


def test_no_screen(pygame, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "no such driver")
    with pytest.raises(SystemExit) as stop:
        run_main(monkeypatch, "--size", "64", "48", "--no-sound")
    assert isinstance(stop.value.code, str) and "there is no screen to open a window on" in stop.value.code


def test_a_driver_without_a_screen(pygame, monkeypatch: pytest.MonkeyPatch) -> None:
    """SDL falls back on one by itself; a match that nobody can see would go on for ever."""
    monkeypatch.delenv("SDL_VIDEODRIVER")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pygame.display, "get_driver", lambda: "offscreen")
    monkeypatch.setattr(pygame.display, "set_mode", lambda size: pygame.Surface(size))
    with pytest.raises(SystemExit) as stop:
        run_main(monkeypatch, "--size", "64", "48", "--no-sound")
    assert isinstance(stop.value.code, str) and "there is no screen to open a window on" in stop.value.code


def test_no_pygame(monkeypatch: pytest.MonkeyPatch) -> None:
    from scripts.play import PlayArgs, play

    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(gymnasium.error.DependencyNotInstalled, match=r'pip install "airhockey-env\[human\]"'):
        play(PlayArgs())


# A real window under a virtual screen


class Screen:
    """A virtual screen with a mouse and a keyboard.

    Args:
        folder: for the screen's memory.
        size: px.
    """

    def __init__(self, folder: Path, size: tuple[int, int]) -> None:
        self._size = size
        receive, send = os.pipe()
        geometry = f"{size[0]}x{size[1]}x24"
        self._server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(send), "-screen", "0", geometry, "-fbdir", str(folder), "-nolisten", "tcp"],
            pass_fds=(send,),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(send)
        with os.fdopen(receive) as stream:
            self._name = f":{stream.readline().strip()}"
        self.environment = os.environ | {
            "DISPLAY": self._name,
            "SDL_VIDEODRIVER": "x11",
            "SDL_AUDIODRIVER": "no such driver",
            "SDL_VIDEO_WINDOW_POS": "0,0",
            "PYTHONPATH": str(ROOT),
        }
        self._memory = np.memmap(folder / "Xvfb_screen0", np.uint8, "r")

    def picture(self) -> np.ndarray:
        """What is on the screen, uint8 (H, W, 3)."""
        header = struct.unpack(">25I", self._memory[:100].tobytes())  # of an X window dump
        width, height, a_line = header[4], header[5], header[12]
        start = header[0] + 12 * header[19]
        pixels = self._memory[start : start + a_line * height].reshape(height, a_line // 4, 4)
        return np.array(pixels[:, :width, 2::-1])

    def do(self, *arguments: object) -> None:
        """Use the mouse or the keyboard: arguments of xdotool."""
        subprocess.run(["xdotool", *map(str, arguments)], env=self.environment, check=True, timeout=30)

    def close(self) -> None:
        """Switch it off."""
        self._server.terminate()
        self._server.wait(timeout=30)


@pytest.fixture
def screen(tmp_path: Path) -> Iterator[Screen]:
    for program in ("Xvfb", "xdotool"):
        if shutil.which(program) is None:
            pytest.skip(f"needs {program}: apt-get install xvfb xdotool")
    pytest.importorskip("pygame", reason="needs pygame-ce")
    screen = Screen(tmp_path, (960, 528))
    yield screen
    screen.close()


def soon(holds: Callable[[], bool], seconds: float, what: str) -> None:
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, what
        time.sleep(0.01)


def test_a_real_window_and_a_real_mouse(screen: Screen) -> None:
    renderer = Renderer(FULL_SIZE, (960, 528))
    radius = renderer.scale * FULL_SIZE.paddle_radius
    process = subprocess.Popen(
        [sys.executable, "-m", "scripts.play", "--opponent", "idle", "--size", "960", "528", "--fps", "60"],
        env=screen.environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )

    def paddle_at(place: tuple[float, float]) -> bool:
        x, y = renderer.to_picture(*place)
        try:
            assert_paddle(screen.picture(), (round(x), round(y)), radius)
        except AssertionError:
            return False
        return True

    def has_banner() -> bool:
        return bool(is_like(screen.picture()[120:260, 300:660], COLORS.white).any())

    def lives() -> bool:
        return process.poll() is None

    try:
        soon(lambda: not lives() or has_banner(), 240.0, "no window")
        assert lives(), process.communicate()[0]
        # Away from where the puck is served, so that nothing is in the way.
        for place in ((-0.85, 0.35), (-0.75, -0.40), (-0.90, 0.30)):
            x, y = renderer.to_picture(*place)
            screen.do("mousemove", round(x), round(y))
            soon(lambda place=place: paddle_at(place), 20.0, f"the paddle is not at {place}")
        soon(lambda: not has_banner(), 20.0, "no play")
        screen.do("key", "r")
        soon(has_banner, 20.0, "no restart")
        assert lives() and not paddle_at((-0.90, 0.30))
        soon(lambda: paddle_at((-0.90, 0.30)), 20.0, "no play after the restart")
        screen.do("key", "Escape")
        printed, _ = process.communicate(timeout=60)
        assert process.returncode == 0, printed
        assert printed.splitlines()[-1] == "You 0 : 0 idle"
    finally:
        process.kill()
        process.wait()


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
    environment["PYTHONPATH"] = str(Path(__file__).parents[2])
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
