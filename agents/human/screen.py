"""A match in a window: the picture, what is written over it, and the turns between the mouse and the match."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from agents.human.sounds import Sounds
from airhockey_env.drawing import raster
from airhockey_env.drawing.palette import COLORS, Color
from airhockey_env.drawing.render import Renderer
from airhockey_env.drawing.window import Window, import_pygame
from airhockey_env.live.match import START_PAUSE, LiveMatch

QUIET_TEXT: Color = (134, 149, 181)
FINER = 3
"""Texts are drawn this many times as large as they are shown."""

NOTICES = {
    "start": ("First to {points}", "Move the mouse: your paddle is the left one", COLORS.white),
    "goal": ("Goal!", "", COLORS.left_light),
    "conceded": ("Goal for {opponent}", "", COLORS.right_light),
    "foul": ("Shot clock", "seven seconds are over: the other side serves", COLORS.white),
    "won": ("You win {left} : {right}", "R to play again", COLORS.left_light),
    "lost": ("{opponent} wins {right} : {left}", "R to play again", COLORS.right_light),
}
"""What stands over the table while the game rests: a line, a smaller one, and the first one's colour."""


class Texts:
    """Writes over the picture, where pygame comes with fonts.

    Args:
        size: (width, height) of the picture, px.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._size = size
        self._pygame = import_pygame()
        self._fonts: dict[int, Any] = {}
        self._written: dict[tuple[str, int, Color], Any] = {}
        self._last_plate: Any = None
        try:
            self._pygame.font.init()
            self._working = True
        except (ImportError, NotImplementedError, AttributeError, self._pygame.error):
            self._working = False

    def _write(self, text: str, height: int, color: Color) -> Any:
        """A picture of the text, kept for the next time."""
        if (text, height, color) not in self._written:
            if height not in self._fonts:
                self._fonts[height] = self._pygame.font.Font(None, FINER * height)
            self._written[text, height, color] = self._finely(self._fonts[height].render(text, True, color))
        return self._written[text, height, color]

    def _finely(self, large: Any) -> Any:
        """A picture that was drawn `FINER` times as large, so that letters stand where they should, with soft edges."""
        width, height = large.get_size()
        size = (max(1, round(width / FINER)), max(1, round(height / FINER)))
        return self._pygame.transform.smoothscale(large.convert_alpha(), size)

    def banner(self, screen: Any, title: str, line: str, color: Color) -> None:
        """One or two lines on a dark plate in the middle of the upper half."""
        if not self._working:
            return
        width, height = self._size
        rows = [self._write(title, max(16, height // 9), color)]
        if line:
            rows.append(self._write(line, max(12, height // 22), COLORS.white))
        gap = height // 40
        inner = max(row.get_width() for row in rows), sum(row.get_height() for row in rows) + gap * (len(rows) - 1)
        plate = self._plate((inner[0] + 6 * gap, inner[1] + 4 * gap), gap).copy()
        top = 2 * gap
        for row in rows:
            plate.blit(row, ((plate.get_width() - row.get_width()) // 2, top))
            top += row.get_height() + gap
        screen.blit(plate, ((width - plate.get_width()) // 2, round(0.36 * height) - plate.get_height() // 2))

    def _plate(self, size: tuple[int, int], corner: int) -> Any:
        """A dark plate that lets the game shine through, kept for the next time."""
        if self._last_plate is None or self._last_plate.get_size() != size:
            large = self._pygame.Surface((FINER * size[0], FINER * size[1]), self._pygame.SRCALPHA)
            large.fill((*COLORS.room, 0))
            self._pygame.draw.rect(large, (*COLORS.room, 205), large.get_rect(), border_radius=FINER * corner)
            self._last_plate = self._finely(large)
        return self._last_plate

    def footer(self, screen: Any, middle: float, left: str, centre: str, right: str) -> None:
        """Small texts on the lower rail, whose middle is `middle` px from the top."""
        if not self._working:
            return
        width = self._size[0]
        size = max(10, self._size[1] // 30)
        for text, x, color in (
            (left, 0.25, COLORS.left_light),
            (centre, 0.5, QUIET_TEXT),
            (right, 0.75, COLORS.right_light),
        ):
            written = self._write(text, size, color)
            screen.blit(written, (round(x * width - 0.5 * written.get_width()), round(middle - 0.5 * size * 0.7)))


def draw_target(frame: np.ndarray, renderer: Renderer, match: LiveMatch) -> None:
    """A ring where the mouse points, while the paddle is not there: the pointer itself is hidden."""
    if match.target is None or match.over:
        return
    paddle = match.positions[0]
    if np.hypot(*(paddle - match.target)) < 0.6 * match.spec.paddle_radius:
        return
    x, y = renderer.to_picture(*match.target)
    radius = 0.35 * match.spec.paddle_radius * renderer.scale
    raster.ring(frame, x, y, radius, max(1.5, 0.2 * radius), 1.0, COLORS.left, 0.75)


class MatchWindow:
    """A match in a window.

    Args:
        match: to be played.
        opponent: what to call the opponent.
        size: of the window, px.
        fps: pictures for a second.
        sound: whether to make any.
    """

    def __init__(self, match: LiveMatch, opponent: str, *, size: tuple[int, int], fps: float, sound: bool) -> None:
        self.match = match
        self._opponent = opponent
        self.renderer = Renderer(match.spec, size)
        # Played and drawn for a moment before the window opens: what has to be compiled is compiled then.
        match.restart(0.0)
        match.advance(START_PAUSE + 0.05, (0.0, 0.0))
        self._frame()
        self.window = Window(self.renderer.size, f"Air hockey: you against {opponent}", fps)
        self._texts = Texts(self.renderer.size)
        self._sounds = Sounds(match.spec.length) if sound else None
        half = 0.5 * match.spec.width
        self._lower_rail = 0.5 * (
            self.renderer.to_picture(0.0, -half)[1] + self.renderer.to_picture(0.0, -half - 0.1)[1]
        )
        self._held: bool | None = None
        match.restart(time.perf_counter())

    def run(self) -> None:
        """Play until the window closes."""
        try:
            while not self.window.closed:
                self.turn(time.perf_counter())
        finally:
            self.close()

    def close(self) -> None:
        """Close the window and let the audio device go."""
        self.window.close()
        if self._sounds is not None:
            self._sounds.close()

    def turn(self, now: float) -> None:
        """One picture: listen, play on, draw."""
        for key in self.window.pressed():
            if key == "escape":
                self.window.close()
            elif key == "r":
                self.match.restart(now)
        if self.window.closed:
            return
        self._hold_pointer(not self.match.over)
        pointer = self.window.pointer
        place = None if pointer is None else self.renderer.to_table(pointer[0] + 0.5, pointer[1] + 0.5)
        events = self.match.advance(now, place)
        if self._sounds is not None:
            self._sounds.play(events)
        self.window.show(self._frame(), self._overlay)

    def _hold_pointer(self, held: bool) -> None:
        if held != self._held:
            self.window.hold_pointer(held)
            self._held = held

    def _frame(self) -> np.ndarray:
        match = self.match
        frame = self.renderer.draw(match.positions, match.score, match.clock)
        draw_target(frame, self.renderer, match)
        return frame

    def _overlay(self, screen: Any) -> None:
        match = self.match
        self._texts.footer(screen, self._lower_rail, "You", "R restarts     Esc leaves", self._opponent)
        if match.notice:
            title, line, color = NOTICES[match.notice]
            left, right = match.score
            names = {"points": match.points, "opponent": self._opponent, "left": left, "right": right}
            title = title.format(**names)
            self._texts.banner(screen, title[:1].upper() + title[1:], line, color)
