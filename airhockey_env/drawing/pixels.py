"""Pixel observations: 84 x 84 pictures of the state, drawn for a whole batch at once.

A picture is drawn from a row of state observations, so it shows the same things: the player's own side is on the left
(for the right-hand player the table is turned by 180 degrees), and colours mean "own" and "other", not left and right.
One policy can therefore play both sides. A single picture does not show velocities, so stack several frames.

The table fills the picture and looks shorter than it is: a pixel is about twice as long along the table as across it,
which doubles the resolution across. Discs are stretched with the table, so that discs that touch appear to touch. Their
radii are at least `SMALLEST_RADIUS`, so that a small puck does not fall between pixels. The bar above the table is the
shot clock: it grows from the middle towards the side that the puck is on, in that player's colour, and is full when the
foul is called. The grey levels of surface, players and puck differ clearly, so grayscale pictures lose no information.

Like a state observation, a picture is scaled to the table, so walls look the same whatever its size. Goals and discs
are drawn from each table's own `PARAMETERS`.
"""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled
from airhockey_env.drawing.raster import blend, draw_ellipse, ellipse, room_for, span
from airhockey_env.kernel.state import LEFT, PUCK
from airhockey_env.threads import Threads

CHANNELS = {"rgb": 3, "grayscale": 1}
"""Number of colour channels of each kind of pixel observation."""

PICTURES_PER_THREAD = 64
"""Fewer pictures than this are not worth waking a thread for."""

SIZE = 84
"""Width and height of a picture, px."""

# The layout, px: the surface is centred on (CENTRE_X, CENTRE_Y), and its walls are HALF_X and HALF_Y from there.
CENTRE_X, HALF_X = 42.0, 39.0
CENTRE_Y, HALF_Y = 45.0, 37.0
RAIL = 2
"""Width of the side rails; the end rails reach to the edge of the picture."""
CLOCK_TOP, CLOCK_BOTTOM = 1.0, 4.0
SMALLEST_RADIUS = 1.0

Color = tuple[int, ...]


class Palette(NamedTuple):
    """Colours, each with as many channels as the picture has."""

    room: Color
    rail: Color
    surface: Color
    marking: Color
    own: Color
    other: Color
    puck: Color
    own_goal: Color
    other_goal: Color
    own_clock: Color
    other_clock: Color


RGB = Palette(
    room=(8, 10, 15),
    rail=(56, 64, 84),
    surface=(22, 27, 40),
    marking=(42, 50, 70),
    own=(255, 138, 156),
    other=(42, 132, 246),
    puck=(255, 244, 204),
    own_goal=(224, 62, 98),
    other_goal=(38, 118, 226),
    own_clock=(255, 138, 156),
    other_clock=(42, 132, 246),
)


def palette(kind: str) -> Palette:
    """The palette of a kind of pixel observation; grey is the luma of ITU-R BT.601."""
    if kind == "rgb":
        return RGB
    return Palette(*((round(0.299 * red + 0.587 * green + 0.114 * blue),) for red, green, blue in RGB))


@compiled
def rectangle(image, left, top, right, bottom, color):
    """Fill an axis-aligned rectangle, px; a pixel is blended by the share of its area that is covered."""
    first_row, last_row = span(top, bottom, image.shape[0])
    first_column, last_column = span(left, right, image.shape[1])
    for row in range(first_row, last_row):
        height = min(bottom, row + 1.0) - max(top, row + 0.0)
        for column in range(first_column, last_column):
            width = min(right, column + 1.0) - max(left, column + 0.0)
            blend(image, row, column, color, height * width)


@compiled
def draw_goals(image, params, colors):
    """Draw both goals into the end rails, as wide as the table's goals, in the colours of their players."""
    half = params.half_goal * params.per_y * HALF_Y
    rectangle(image, 0.0, CENTRE_Y - half, CENTRE_X - HALF_X, CENTRE_Y + half, colors.own_goal)
    rectangle(image, CENTRE_X + HALF_X, CENTRE_Y - half, float(SIZE), CENTRE_Y + half, colors.other_goal)


@compiled
def draw_disc(image, x, y, radius, params, color, room):
    """Draw a paddle or the puck. x and y are as in an observation, the radius is in m."""
    radius_x = max(radius * params.per_x * HALF_X, SMALLEST_RADIUS)
    radius_y = max(radius * params.per_y * HALF_Y, SMALLEST_RADIUS)
    draw_ellipse(image, CENTRE_X + x * HALF_X, CENTRE_Y - y * HALF_Y, radius_x, radius_y, 1.0, color, 1.0, room)


@compiled
def draw_clock(image, used, colors):
    """Draw the shot clock. `used` is as in an observation."""
    reach = CENTRE_X - used * HALF_X
    # The observation is positive while the puck is on the player's own side, to the left of the middle.
    if used > 0.0:
        rectangle(image, reach, CLOCK_TOP, CENTRE_X, CLOCK_BOTTOM, colors.own_clock)
    elif used < 0.0:
        rectangle(image, CENTRE_X, CLOCK_TOP, reach, CLOCK_BOTTOM, colors.other_clock)


@compiled
def draw_rows(first, last, observations, parameters, background, colors, frames):
    """Draw the pictures `first` to `last` (excluded).

    Args:
        observations: (N, 13) float32, state observations.
        parameters: (1,) or (N,) `PARAMETERS`.
        background: flat uint8 array of the static part; includes the goals if there is one record of `parameters`.
        colors: `Palette` of C channels.
        frames: (N, SIZE, SIZE, C) uint8, contiguous; written in place.
    """
    own_parameters = parameters.shape[0] > 1
    # Copy element by element through a flat view: assigning slices of images takes many times as long.
    flat = frames.reshape(frames.shape[0], background.shape[0])
    room = room_for(SIZE)
    for i in range(first, last):
        params = parameters[i if own_parameters else 0]
        for k in range(background.shape[0]):
            flat[i, k] = background[k]
        image = frames[i]
        if own_parameters:
            draw_goals(image, params, colors)
        # Convert to float64: plain Python would stay in the observation's single precision, compiled code would not.
        seen = observations[i]
        draw_clock(image, float(seen[12]), colors)
        draw_disc(image, float(seen[4]), float(seen[5]), params.radius[LEFT], params, colors.other, room)
        draw_disc(image, float(seen[0]), float(seen[1]), params.radius[LEFT], params, colors.own, room)
        draw_disc(image, float(seen[8]), float(seen[9]), params.radius[PUCK], params, colors.puck, room)


def draw_background(kind: str) -> NDArray[np.uint8]:
    """Draw what all tables have in common, (SIZE, SIZE, C) uint8."""
    colors = palette(kind)
    image = np.empty((SIZE, SIZE, CHANNELS[kind]), np.uint8)
    image[:] = colors.room
    left, right = int(CENTRE_X - HALF_X), int(CENTRE_X + HALF_X)
    top, bottom = int(CENTRE_Y - HALF_Y), int(CENTRE_Y + HALF_Y)
    middle = slice(int(CENTRE_X) - 1, int(CENTRE_X) + 1)
    image[top - RAIL : bottom + RAIL] = colors.rail
    for rows in (slice(top, bottom), slice(int(CLOCK_TOP), int(CLOCK_BOTTOM))):
        image[rows, left:right] = colors.surface
        image[rows, middle] = colors.marking
    for grow, color in ((0.5, colors.marking), (-0.5, colors.surface)):
        ellipse(image, CENTRE_X, CENTRE_Y, 6.0 + grow, 11.0 + grow, 1.0, color, 1.0)
    return image


class Pixels:
    """Draws pictures for a batch from its state observations.

    Args:
        kind: a key of `CHANNELS`.
    """

    KEPT = 4
    """Most arrays kept for reuse: enough for both players while the caller still holds the previous ones."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._colors = palette(kind)
        self._plain = draw_background(kind)
        self._with_goals = self._plain
        self._goal = 0.0  # share of the width, in `_with_goals`
        self._kept: list[NDArray[np.uint8]] = []

    def blank(self, count: int, again: bool = False) -> NDArray[np.uint8]:
        """Return an array (count, SIZE, SIZE, C) with undefined contents, to draw into and to return to the caller.

        With `again`, it may be an earlier array that nothing else refers to any more. For a large batch, allocating new
        memory takes as long as drawing.
        """
        shape = (count, SIZE, SIZE, CHANNELS[self.kind])
        if not again:
            return np.empty(shape, np.uint8)
        kept = self._kept
        for k in range(len(kept)):
            # Views also hold a reference. The count of 2 is the list and the argument of the call itself.
            if len(kept[k]) == count and sys.getrefcount(kept[k]) == 2:
                kept.append(kept.pop(k))
                return kept[-1]
        kept.append(np.empty(shape, np.uint8))
        del kept[: -self.KEPT]
        return kept[-1]

    def background(self, parameters: NDArray[np.void]) -> NDArray[np.uint8]:
        """The static part of the pictures for `parameters`, (1,) or (N,); with the goals if there is one record."""
        if len(parameters) > 1:
            return self._plain
        goal = float(parameters["half_goal"][0] * parameters["per_y"][0])
        if goal != self._goal:
            self._with_goals, self._goal = self._plain.copy(), goal
            draw_goals(self._with_goals, parameters[0], self._colors)
        return self._with_goals

    def draw(
        self,
        first: int,
        last: int,
        observations: NDArray[np.float32],
        parameters: NDArray[np.void],
        background: NDArray[np.uint8],
        frames: NDArray[np.uint8],
    ) -> None:
        """Draw pictures `first` to `last` (excluded) of state observations (N, 13) on a background into `frames`.

        Several threads may draw different parts of the same frames.
        """
        draw_rows(first, last, observations, parameters, background.reshape(-1), self._colors, frames)

    def pictures(
        self, observations: NDArray[np.float32], parameters: NDArray[np.void], threads: Threads, again: bool = False
    ) -> NDArray[np.uint8]:
        """Pictures of state observations (n, 13), or of the rows of stacks of them (n, stack, 15).

        Args:
            parameters: (1,) or (n,) `PARAMETERS` of the tables.
            threads: these share many pictures.
            again: whether the array may be an earlier one; see `blank`.

        Returns:
            (n, ..., SIZE, SIZE, 3) uint8 in colours, or (n, ..., SIZE, SIZE) in grey.
        """
        shape = observations.shape[:-1]
        if len(shape) > 1:
            observations = observations.reshape(-1, observations.shape[-1])
            parameters = parameters if len(parameters) == 1 else np.repeat(parameters, shape[1])
        background, frames = self.background(parameters), self.blank(len(observations), again)
        threads.share(len(frames), PICTURES_PER_THREAD, self.draw, observations, parameters, background, frames)
        return frames.reshape(*shape, *(frames.shape[1:] if frames.shape[-1] > 1 else frames.shape[1:-1]))

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_kept": []}
