"""Pixel observations: 84 x 84 pictures of what a state observation shows, for a whole batch at once.

A picture is drawn from a row of state observations, so that it shows the same thing by construction: the player's own
side on the left (the right-hand player's table is turned by 180 degrees) and colours that belong to "own" and "other",
not to left and right. One policy plays both sides. Velocities are in no single picture: stack frames.

The table fills the picture, so that it looks shorter than it is: a pixel is about twice as long along the table as
across it, which doubles the detail across. Discs are stretched with the table (touching looks like touching), and
drawn with radii of at least `SMALLEST_RADIUS`, so that a small puck does not fall between pixels. The bar above the
table is the shot clock: it grows from the middle towards the side that the puck is on, in that player's colour, and is
full at the foul. The grey levels of surface, players and puck are far apart, so that grayscale loses nothing; the
ground is dark, so that what matters is bright.

Walls look the same whatever the table's size, as in a state observation: what else differs between tables (goals and
discs) is drawn from each table's own `PHYSICS`.
"""

from __future__ import annotations

import sys
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled
from airhockey_env.drawing.raster import blend, ellipse, span
from airhockey_env.kernel.state import LEFT, PUCK

CHANNELS = {"rgb": 3, "grayscale": 1}
"""The kinds of pixel observations and their colour channels."""

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
    """Colours, each with as many channels as the picture."""

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
    """The colours of a kind of pictures; grey is the luma of ITU-R BT.601."""
    if kind == "rgb":
        return RGB
    return Palette(*((round(0.299 * red + 0.587 * green + 0.114 * blue),) for red, green, blue in RGB))


@compiled
def rectangle(image, left, top, right, bottom, color):
    """Fill an upright rectangle, px: each pixel by the share of its area that is covered. See `raster`."""
    first_row, last_row = span(top, bottom, image.shape[0])
    first_column, last_column = span(left, right, image.shape[1])
    for row in range(first_row, last_row):
        height = min(bottom, row + 1.0) - max(top, row + 0.0)
        for column in range(first_column, last_column):
            width = min(right, column + 1.0) - max(left, column + 0.0)
            blend(image, row, column, color, height * width)


@compiled
def draw_goals(image, law, colors):
    """Open the end rails, by the table's goal width, and paint each goal in its player's colour."""
    half = law.half_goal * law.per_y * HALF_Y
    rectangle(image, 0.0, CENTRE_Y - half, CENTRE_X - HALF_X, CENTRE_Y + half, colors.own_goal)
    rectangle(image, CENTRE_X + HALF_X, CENTRE_Y - half, float(SIZE), CENTRE_Y + half, colors.other_goal)


@compiled
def draw_disc(image, x, y, radius, law, color):
    """Draw a paddle or the puck: x and y as in an observation, the radius in m."""
    radius_x = max(radius * law.per_x * HALF_X, SMALLEST_RADIUS)
    radius_y = max(radius * law.per_y * HALF_Y, SMALLEST_RADIUS)
    ellipse(image, CENTRE_X + x * HALF_X, CENTRE_Y - y * HALF_Y, radius_x, radius_y, 1.0, color, 1.0)


@compiled
def draw_clock(image, used, colors):
    """Draw the shot clock: `used` as in an observation."""
    reach = CENTRE_X - used * HALF_X
    # While the puck is on the own side, left of the middle, the observation is positive.
    if used > 0.0:
        rectangle(image, reach, CLOCK_TOP, CENTRE_X, CLOCK_BOTTOM, colors.own_clock)
    elif used < 0.0:
        rectangle(image, CENTRE_X, CLOCK_TOP, reach, CLOCK_BOTTOM, colors.other_clock)


@compiled
def draw_rows(first, last, observations, physics, background, colors, frames):
    """Draw the pictures `first` to `last` (excluded).

    Args:
        observations: (N, 13) float32, state observations.
        physics: (1,) or (N,) `PHYSICS`.
        background: what stays, uint8, flat; with the goals if there is one record of `physics`.
        colors: `Palette` of C channels.
        frames: (N, SIZE, SIZE, C) uint8, contiguous; written in place.
    """
    own_physics = physics.shape[0] > 1
    # A flat copy: assigning slices of images takes many times as long.
    flat = frames.reshape(frames.shape[0], background.shape[0])
    for i in range(first, last):
        law = physics[i if own_physics else 0]
        for k in range(background.shape[0]):
            flat[i, k] = background[k]
        image = frames[i]
        if own_physics:
            draw_goals(image, law, colors)
        # As float64: plain Python would go on in the single precision of the observation, compiled code would not.
        seen = observations[i]
        draw_clock(image, float(seen[12]), colors)
        draw_disc(image, float(seen[4]), float(seen[5]), law.radius[LEFT], law, colors.other)
        draw_disc(image, float(seen[0]), float(seen[1]), law.radius[LEFT], law, colors.own)
        draw_disc(image, float(seen[8]), float(seen[9]), law.radius[PUCK], law, colors.puck)


def draw_background(kind: str) -> NDArray[np.uint8]:
    """What all tables have in common: (SIZE, SIZE, C) uint8."""
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
    """Draws pictures of a batch from its state observations.

    Args:
        kind: a key of `CHANNELS`.
    """

    KEPT = 4
    """Most arrays that are kept to be used again: those of both players, while the caller holds the last ones."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._colors = palette(kind)
        self._plain = draw_background(kind)
        self._with_goals = self._plain
        self._goal = 0.0  # share of the width, in `_with_goals`
        self._kept: list[NDArray[np.uint8]] = []

    def blank(self, count: int, again: bool = False) -> NDArray[np.uint8]:
        """An array (count, SIZE, SIZE, C) to draw into and then to hand out, with undefined contents.

        With `again`, it may be an earlier one that nothing outside refers to any more: for a large batch, the system
        takes as long to provide fresh memory as drawing takes.
        """
        shape = (count, SIZE, SIZE, CHANNELS[self.kind])
        if not again:
            return np.empty(shape, np.uint8)
        kept = self._kept
        for k in range(len(kept)):
            # A view refers to its array, too. 2: the list, and the argument of the call itself.
            if len(kept[k]) == count and sys.getrefcount(kept[k]) == 2:
                kept.append(kept.pop(k))
                return kept[-1]
        kept.append(np.empty(shape, np.uint8))
        del kept[: -self.KEPT]
        return kept[-1]

    def background(self, physics: NDArray[np.void]) -> NDArray[np.uint8]:
        """What stays on all tables of `physics`, (1,) or (N,): with the goals, if there is one record for all."""
        if len(physics) > 1:
            return self._plain
        goal = float(physics["half_goal"][0] * physics["per_y"][0])
        if goal != self._goal:
            self._with_goals, self._goal = self._plain.copy(), goal
            draw_goals(self._with_goals, physics[0], self._colors)
        return self._with_goals

    def draw(
        self,
        first: int,
        last: int,
        observations: NDArray[np.float32],
        physics: NDArray[np.void],
        background: NDArray[np.uint8],
        frames: NDArray[np.uint8],
    ) -> None:
        """Draw the pictures `first` to `last` (excluded) of state observations (N, 13) over a background into `frames`.

        Several threads may draw parts of the same frames.
        """
        draw_rows(first, last, observations, physics, background.reshape(-1), self._colors, frames)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_kept": []}
