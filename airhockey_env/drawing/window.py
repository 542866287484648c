"""A window that shows frames at a steady rate and reports keys and mouse."""

from __future__ import annotations

import contextlib
import importlib
import os
from collections import deque
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from gymnasium import logger
from gymnasium.error import DependencyNotInstalled, Error

from airhockey_env.checks import check_positive

UNSEEN = ("offscreen", "dummy", "evdev")
"""SDL video drivers whose windows are not visible."""


def import_pygame() -> Any:
    """Import pygame without its greeting and without SDL's signal handlers.

    SDL's handlers turn SIGTERM into a window event, so that SIGTERM would no longer end a process that had a window.

    Raises:
        DependencyNotInstalled: pygame-ce is missing.
    """
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    os.environ.setdefault("SDL_NO_SIGNAL_HANDLERS", "1")
    try:
        return importlib.import_module("pygame")
    except ImportError as error:
        raise DependencyNotInstalled('showing a window needs pygame-ce: pip install "airhockey-env[human]"') from error


class Window:
    """Shows frames on the screen. A process has one window at a time: a second one replaces the first.

    When the window is closed, nothing is raised: `closed` becomes True and `show` does nothing.

    Args:
        size: (width, height) of the frames, px.
        title: the title of the window.
        fps: greatest number of frames per second; `show` waits accordingly. Greater than 0.

    Raises:
        DependencyNotInstalled: pygame-ce is missing.
        ValueError: `fps` is not a finite number greater than 0.
    """

    # The display belongs to the process, so the window that owns it is stored in the class.
    _shown: ClassVar[Window | None] = None

    def __init__(self, size: tuple[int, int], title: str = "Air hockey", fps: float = 50.0) -> None:
        self._fps = check_positive("fps", fps)
        self._pygame = import_pygame()
        self._size = (int(size[0]), int(size[1]))
        # Only the display: pygame.init() would take hold of the sound card and joysticks as well.
        self._pygame.display.init()
        self._screen = self._pygame.display.set_mode(self._size)
        self._driver = self._pygame.display.get_driver()
        self._pygame.display.set_caption(title)
        self._clock = self._pygame.time.Clock()
        self._pressed: deque[str] = deque(maxlen=16)  # bounded, because the caller may never ask for them
        self._pointer: tuple[int, int] | None = None
        Window._shown = self

    @property
    def closed(self) -> bool:
        """Whether the window was closed by its user, by `close`, or by opening another window."""
        return Window._shown is not self

    @property
    def fallen_back(self) -> str | None:
        """The name of the invisible video driver that SDL fell back on; None if it did not, or if the user chose it."""
        chosen = {"SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER"} & os.environ.keys()
        return self._driver if self._driver in UNSEEN and not chosen else None

    @property
    def pointer(self) -> tuple[int, int] | None:
        """Pixel under the mouse pointer, from the top left; None before the mouse has moved over the window."""
        return self._pointer

    def pressed(self) -> list[str]:
        """Names of the keys pressed since the last call, in order, such as "r" or "escape".

        Also updates `pointer` and `closed`.
        """
        self._listen()
        keys = list(self._pressed)
        self._pressed.clear()
        return keys

    def hold_pointer(self, held: bool) -> None:
        """Hide the mouse pointer and keep it within the window, or release it."""
        if self._gone():
            return
        mouse = self._pygame.mouse
        # Do not use set_visible: pygame reports no positions of a mouse that is both invisible and grabbed.
        with contextlib.suppress(self._pygame.error):  # not every screen has cursors
            if held:
                mouse.set_cursor((8, 8), (0, 0), (0,) * 8, (0,) * 8)
            else:
                mouse.set_cursor(self._pygame.SYSTEM_CURSOR_ARROW)
        self._pygame.event.set_grab(held)

    def show(self, frame: np.ndarray, overlay: Callable[[Any], None] | None = None) -> None:
        """Show a frame, uint8 (H, W, 3), and wait until the next one is due.

        Args:
            frame: the picture to show.
            overlay: called with the screen, a `pygame.Surface`, to draw on top of the picture.

        Raises:
            ValueError: the type or shape of the frame does not match the window.
        """
        if self.closed:
            return
        width, height = self._size
        if frame.dtype != np.uint8 or frame.shape != (height, width, 3):
            raise ValueError(f"frame must be uint8 {(height, width, 3)}, got {frame.dtype} {frame.shape}")
        self._listen()
        if self.closed:
            return
        picture = self._pygame.image.frombuffer(np.ascontiguousarray(frame), self._size, "RGB")
        self._screen.blit(picture, (0, 0))
        if overlay is not None:
            overlay(self._screen)
        self._pygame.display.flip()
        self._clock.tick(self._fps)

    def _gone(self) -> bool:
        # Other code in the process may have closed pygame's display, which closes the window too.
        if not self.closed and not self._pygame.display.get_init():
            self.close()
        return self.closed

    def _listen(self) -> None:
        """Process pending events. This is also what keeps the window responsive to the desktop."""
        if self._gone():
            return
        pygame = self._pygame
        for event in pygame.event.get():
            if event.type == pygame.QUIT:
                self.close()
                return
            if event.type == pygame.KEYDOWN:
                self._pressed.append(pygame.key.name(event.key))
            elif event.type == pygame.MOUSEMOTION:
                self._pointer = event.pos

    def close(self) -> None:
        """Close the window; may be called more than once."""
        if not self.closed:
            self._pygame.display.quit()
            Window._shown = None


def human_window(size: tuple[int, int], fps: float) -> Window:
    """Open the window of `render_mode="human"`. Warns if it is not visible.

    Raises:
        gymnasium.error.Error: no window can be opened.
    """
    instead = "render_mode='rgb_array' draws without a screen"
    try:
        window = Window(size, "Air hockey", fps)
    except import_pygame().error as error:
        raise Error(f"render_mode='human' needs a screen to open a window on ({error}); {instead}") from error
    if window.fallen_back is not None:
        logger.warn(
            f"render_mode='human' shows nothing: there is no screen, and SDL has fallen back on its driver "
            f"{window.fallen_back!r}; {instead}. Set SDL_VIDEODRIVER={window.fallen_back} if that is what you want"
        )
    return window
