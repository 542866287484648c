"""Rendering: pictures of a table for people, drawn with `airhockey_env.drawing.raster`.

Light comes from the top of the picture, so that the left half of a scene is the mirror image of the right half.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from airhockey_env.checks import as_array, check_number, check_whole_pair, fault
from airhockey_env.drawing import raster
from airhockey_env.drawing.palette import COLORS, Color
from airhockey_env.tables import TableSpec

DEFAULT_WIDTH = 960
"""Width of a picture if no size is given, px."""
SMALLEST, LARGEST = 32, 8192
"""Smallest and largest width and height of a picture, px."""

# Sizes that a `TableSpec` does not define, m.
RAIL_WIDTH = 0.10
ROOM_WIDTH = 0.04
LIP_WIDTH = 0.012
RAIL_CORNER = 0.11
POCKET_DEPTH = 0.062
POST_RADIUS = 0.013
LINE_WIDTH = 0.008
HOLE_SPACING, HOLE_RADIUS = 0.05, 0.0036
CENTRE_CIRCLE, CENTRE_SPOT = 0.16, 0.018
CREASE_MARGIN = 0.09
"""How far a crease extends beyond the posts, m."""
DIGIT_HEIGHT, DIGIT_STROKE = 0.052, 0.0115
CLOCK_LENGTH, CLOCK_WIDTH = 0.28, 0.018
SCORE_GAP = 0.345
"""Distance from the middle of the upper rail to the nearer edge of either score, m."""

# Details that would be smaller than this are omitted, px.
SMALLEST_DIGIT = 5.0
SMALLEST_HOLE_SPACING = 8.0
SMALLEST_DETAILED = 4.0
"""Radius of a disc, px, below which only its first `PLAIN_LAYERS` layers are drawn."""
PLAIN_LAYERS = 3


class Layer(NamedTuple):
    """One layer of a drawn disc; lengths are in units of the disc's radius."""

    radius: float
    down: float
    """Shift towards the bottom of the picture, away from the light."""
    softness: float
    color: Color
    alpha: float


def _mallet(color: Color, dark: Color, light: Color) -> tuple[Layer, ...]:
    return (
        Layer(1.06, 0.26, 0.55, COLORS.black, 0.42),
        Layer(1.00, 0.00, 0.0, dark, 1.0),
        Layer(0.93, -0.03, 0.0, color, 1.0),
        Layer(0.74, 0.00, 0.0, dark, 0.55),
        Layer(0.70, 0.02, 0.0, color, 1.0),
        Layer(0.52, 0.14, 0.35, COLORS.black, 0.40),
        Layer(0.44, 0.00, 0.0, dark, 1.0),
        Layer(0.41, -0.03, 0.0, light, 1.0),
        Layer(0.24, -0.12, 0.40, COLORS.white, 0.65),
    )


LEFT_MALLET = _mallet(COLORS.left, COLORS.left_dark, COLORS.left_light)
RIGHT_MALLET = _mallet(COLORS.right, COLORS.right_dark, COLORS.right_light)
PUCK_LAYERS = (
    Layer(1.04, 0.16, 0.40, COLORS.black, 0.38),
    Layer(1.00, 0.00, 0.0, COLORS.puck_dark, 1.0),
    Layer(0.92, -0.03, 0.0, COLORS.puck, 1.0),
    Layer(0.74, 0.00, 0.0, COLORS.puck_light, 1.0),
    Layer(0.54, 0.00, 0.0, COLORS.puck_dark, 1.0),
    Layer(0.50, 0.02, 0.0, COLORS.puck, 1.0),
)


def _arc(x: float, y: float, radius_x: float, radius_y: float, start: float, stop: float) -> list[tuple[float, float]]:
    """Points of an arc; angles in degrees, clockwise from the right."""
    angles = np.radians(np.linspace(start, stop, 2 + int(abs(stop - start) / 12.0)))
    return [(x + radius_x * math.cos(a), y + radius_y * math.sin(a)) for a in angles]


# Each digit is one stroke in a cell 0.6 wide and 1 high, from the top left.
_SIX = [(0.43, 0.0), *_arc(0.30, 0.70, 0.30, 0.30, 205, 565)]
DIGITS: tuple[list[tuple[float, float]], ...] = (
    [*_arc(0.30, 0.30, 0.30, 0.30, 180, 360), *_arc(0.30, 0.70, 0.30, 0.30, 0, 180), (0.0, 0.30)],
    [(0.12, 0.2), (0.38, 0.0), (0.38, 1.0)],
    [*_arc(0.30, 0.29, 0.29, 0.29, 190, 395), (0.02, 1.0), (0.6, 1.0)],
    [*_arc(0.29, 0.25, 0.27, 0.25, 200, 450), *_arc(0.29, 0.75, 0.30, 0.25, 270, 520)],
    [(0.47, 1.0), (0.47, 0.0), (0.0, 0.72), (0.62, 0.72)],
    [(0.54, 0.0), (0.10, 0.0), (0.06, 0.46), *_arc(0.29, 0.69, 0.31, 0.31, 228, 510)],
    _SIX,
    [(0.02, 0.0), (0.6, 0.0), (0.22, 1.0)],
    [*_arc(0.30, 0.25, 0.26, 0.25, 90, 450), *_arc(0.30, 0.75, 0.30, 0.25, 270, 630)],
    [(0.6 - x, 1.0 - y) for x, y in _SIX],
)
DIGIT_WIDTH, DIGIT_ADVANCE = 0.60, 0.88


def _mix(start: Color, stop: Color, share: float) -> Color:
    share = min(max(share, 0.0), 1.0)
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(start, stop, strict=True))
    return red, green, blue


class Renderer:
    """Draws a table from above, with the left goal on the left and y pointing up.

    The table keeps its proportions, and the rest of the picture is plain. Small pictures omit the score, the clock and
    the finest details. The same arguments give the same picture to the bit.

    Args:
        table: the table to draw.
        size: (width, height) of the pictures in px, each from 32 to 8192. None: 960 px wide, with the height that fits
            the table.

    Raises:
        ValueError: `size` (called `render_size`, its name in the environments) is not two ints from 32 to 8192.
    """

    size: tuple[int, int]
    """(width, height) of the pictures, px."""
    scale: float
    """Pixels per metre."""

    def __init__(self, table: TableSpec, size: tuple[int, int] | None = None) -> None:
        self.table = table
        around = 2.0 * (RAIL_WIDTH + ROOM_WIDTH)
        length, width = table.length + around, table.width + around
        if size is None:
            # A multiple of 8, which video codecs prefer.
            size = (DEFAULT_WIDTH, max(SMALLEST, 8 * round(DEFAULT_WIDTH * width / length / 8.0)))
        self.size = check_whole_pair("render_size", size, SMALLEST, LARGEST)
        self.scale = min(self.size[0] / length, self.size[1] / width)
        self._board: tuple[int, int] | None = None
        self._scored: np.ndarray | None = None

    def draw(self, positions: Any, score: tuple[int, int] = (0, 0), clock: float = 0.0) -> np.ndarray:
        """Draw the table at one moment.

        Args:
            positions: (3, 2), m, finite: left paddle, right paddle and puck. The table is centred on the origin.
            score: points of the left and of the right player, ints, 0 or more.
            clock: share of the shot clock that is used up, 0 to 1; negative while the puck is on the left side.

        Returns:
            A new uint8 array (height, width, 3): red, green, blue.

        Raises:
            ValueError: an argument is not as described. The message names it and says what was given.
        """
        places = as_array(positions)
        if places is None or places.shape != (3, 2) or not np.isfinite(places).all():
            raise fault("positions", "finite numbers of shape (3, 2)", positions)
        clock = check_number("clock", clock, -1, 1)
        points = check_whole_pair("score", score, 0)
        # The score changes rarely: it is part of the cached picture.
        if self._scored is None or points != self._board:
            self._scored, self._board = self._draw_score(points), points
        image = self._scored.copy()
        self._draw_clock(image, clock)
        self._draw_piece(image, places[2], self.table.puck_radius, PUCK_LAYERS)
        self._draw_piece(image, places[0], self.table.paddle_radius, LEFT_MALLET)
        self._draw_piece(image, places[1], self.table.paddle_radius, RIGHT_MALLET)
        return image

    def to_picture(self, x: float, y: float) -> tuple[float, float]:
        """Convert a point on the table, m, to the picture, px from the top left corner."""
        return 0.5 * self.size[0] + x * self.scale, 0.5 * self.size[1] - y * self.scale

    def to_table(self, x: float, y: float) -> tuple[float, float]:
        """Convert a point of the picture, px from the top left corner, to the table, m."""
        return (x - 0.5 * self.size[0]) / self.scale, (0.5 * self.size[1] - y) / self.scale

    # Moving parts

    def _draw_piece(self, image: np.ndarray, place: np.ndarray, radius: float, layers: tuple[Layer, ...]) -> None:
        x, y = self.to_picture(float(place[0]), float(place[1]))
        radius *= self.scale
        if radius < SMALLEST_DETAILED:
            layers = layers[:PLAIN_LAYERS]
        for layer in layers:
            softness = max(1.0, layer.softness * radius)
            raster.disc(image, x, y + layer.down * radius, layer.radius * radius, softness, layer.color, layer.alpha)

    def _draw_clock(self, image: np.ndarray, clock: float) -> None:
        """Fill the track of the clock from its middle towards the side that the puck is on."""
        if self._digit_height() < SMALLEST_DIGIT or clock == 0.0:
            return
        used = abs(clock)
        color = _mix(COLORS.clock_calm, COLORS.clock_soon, (used - 0.4) / 0.25)
        color = _mix(color, COLORS.clock_late, (used - 0.75) / 0.2)
        self._draw_clock_line(image, math.copysign(used, clock), 0.55 * CLOCK_WIDTH, color)

    def _draw_clock_line(self, image: np.ndarray, share: float, width: float, color: Color) -> None:
        start = self.to_picture(0.0, self._rail_middle())
        stop = self.to_picture(share * CLOCK_LENGTH, self._rail_middle())
        raster.stroke(image, np.array([start, stop]), width * self.scale, 1.0, color, 1.0)

    # Static parts

    def _rail_middle(self) -> float:
        return 0.5 * self.table.width + LIP_WIDTH + 0.5 * (RAIL_WIDTH - LIP_WIDTH)

    def _digit_height(self) -> float:
        return DIGIT_HEIGHT * self.scale

    def _draw_score(self, score: tuple[int, int]) -> np.ndarray:
        """Return a copy of the background with the score on the upper rail, in the colours of the players."""
        image = self._background.copy()
        if self._digit_height() < SMALLEST_DIGIT:
            return image
        self._draw_clock_line(image, -1.0, CLOCK_WIDTH, COLORS.clock_track)
        self._draw_clock_line(image, 1.0, CLOCK_WIDTH, COLORS.clock_track)
        self._draw_number(image, -1.0, score[0], COLORS.left_light)
        self._draw_number(image, 1.0, score[1], COLORS.right_light)
        return image

    def _draw_number(self, image: np.ndarray, side: float, number: int, color: Color) -> None:
        """Draw a number on the upper rail; more digits extend it outwards, away from the clock."""
        text = str(number)
        height = self._digit_height()
        length = height * (DIGIT_ADVANCE * (len(text) - 1) + DIGIT_WIDTH)
        x, y = self.to_picture(side * SCORE_GAP, self._rail_middle())
        left = x if side > 0.0 else x - length
        for place, digit in enumerate(text):
            points = np.array(DIGITS[int(digit)]) * height + (left + place * DIGIT_ADVANCE * height, y - 0.5 * height)
            raster.stroke(image, points, DIGIT_STROKE * self.scale, 1.0, color, 1.0)

    @functools.cached_property
    def _background(self) -> np.ndarray:
        """Everything except score, clock, paddles and puck; drawn when first needed."""
        width, height = self.size
        image = np.empty((height, width, 3), dtype=np.uint8)
        image[:] = COLORS.room
        self._draw_rails(image)
        self._draw_surface(image)
        self._draw_lip(image)
        for side, color in ((-1.0, COLORS.left), (1.0, COLORS.right)):
            self._draw_goal(image, side, color)
        return image

    def _box(self, image: np.ndarray, grow: float, corner: float, softness: float, color: Color) -> None:
        """Fill the playing surface extended by `grow` on all sides. Lengths are in m; softness is at least 1 px."""
        x, y = 0.5 * self.table.length + grow, 0.5 * self.table.width + grow
        left, top = self.to_picture(-x, y)
        right, bottom = self.to_picture(x, -y)
        softness = max(1.0, softness * self.scale)
        raster.box(image, left, top, right, bottom, corner * self.scale, softness, color, 1.0)

    def _draw_rails(self, image: np.ndarray) -> None:
        edge = 0.007
        self._box(image, RAIL_WIDTH, RAIL_CORNER, 0.0, COLORS.rail_edge)
        self._box(image, RAIL_WIDTH - edge, RAIL_CORNER - edge, 0.0, COLORS.rail)
        self._box(image, RAIL_WIDTH - 0.03, RAIL_CORNER - 0.03, 0.03, COLORS.rail_top)

    def _draw_surface(self, image: np.ndarray) -> None:
        """Draw the playing surface with the soft shade of the rails, air holes and markings."""
        # Draw on a copy and paste it, so that shade and creases end at the walls.
        surface = image.copy()
        self._box(surface, 0.02, 0.0, 0.0, COLORS.surface_shade)
        self._box(surface, 0.01, 0.04, 0.09, COLORS.surface)
        self._draw_holes(surface)
        self._draw_markings(surface)
        left, top = (math.floor(edge) for edge in self.to_picture(-0.5 * self.table.length, 0.5 * self.table.width))
        inside = (slice(top, self.size[1] - top), slice(left, self.size[0] - left))
        image[inside] = surface[inside]

    def _draw_markings(self, image: np.ndarray) -> None:
        """Draw the centre line and circle, and a half disc in front of each goal in the colour of its player."""
        line = max(1.0, LINE_WIDTH * self.scale)
        ends = np.array([self.to_picture(0.0, side * 0.5 * self.table.width) for side in (1.0, -1.0)])
        raster.stroke(image, ends, line, 1.0, COLORS.marking, 1.0)
        x, y = self.to_picture(0.0, 0.0)
        raster.disc(image, x, y, CENTRE_CIRCLE * self.scale, 1.0, COLORS.surface, 1.0)
        raster.ring(image, x, y, CENTRE_CIRCLE * self.scale, line, 1.0, COLORS.marking, 1.0)
        raster.disc(image, x, y, max(1.0, CENTRE_SPOT * self.scale), 1.0, COLORS.marking, 1.0)
        crease = (0.5 * self.table.goal_width + CREASE_MARGIN) * self.scale
        for side, color in ((-1.0, COLORS.left), (1.0, COLORS.right)):
            x, y = self.to_picture(side * 0.5 * self.table.length, 0.0)
            raster.disc(image, x, y, crease, 1.0, color, 0.10)
            raster.ring(image, x, y, crease, line, 1.0, color, 0.8)

    def _draw_holes(self, image: np.ndarray) -> None:
        if HOLE_SPACING * self.scale < SMALLEST_HOLE_SPACING:
            return
        columns = math.floor(0.5 * self.table.length / HOLE_SPACING - 0.2)
        rows = math.floor(0.5 * self.table.width / HOLE_SPACING - 0.2)
        radius = HOLE_RADIUS * self.scale
        for column in range(-columns, columns + 1):
            for row in range(-rows, rows + 1):
                x, y = self.to_picture(column * HOLE_SPACING, row * HOLE_SPACING)
                raster.disc(image, x, y, radius, 1.0, COLORS.hole, min(1.0, radius))

    def _draw_lip(self, image: np.ndarray) -> None:
        """Draw the bright strip around the surface that the puck bounces off; its inner edge is the wall."""
        inside = 0.5 * LIP_WIDTH
        x, y = 0.5 * self.table.length + inside, 0.5 * self.table.width + inside
        corners = np.array([self.to_picture(*corner) for corner in ((-x, y), (x, y), (x, -y), (-x, -y), (-x, y))])
        # One side at a time, because the bounding box of a single stroke would be the whole table.
        for side in range(4):
            raster.stroke(image, corners[side : side + 2], max(1.0, LIP_WIDTH * self.scale), 1.0, COLORS.lip, 1.0)

    def _draw_goal(self, image: np.ndarray, side: float, color: Color) -> None:
        """Draw a dark pocket in the rail, the goal line in front of it, and a post on either side."""
        line = 0.5 * self.table.length
        half = 0.5 * self.table.goal_width
        for grow, shade in ((0.006, COLORS.pocket_edge), (0.0, COLORS.pocket)):
            near, top = self.to_picture(side * line, half)
            far, bottom = self.to_picture(side * (line + POCKET_DEPTH + grow), -half)
            corner = min(0.02, 0.5 * half) * self.scale
            raster.box(image, min(near, far), top, max(near, far), bottom, corner, 1.0, shade, 1.0)
        ends = np.array([self.to_picture(side * line, half), self.to_picture(side * line, -half)])
        raster.stroke(image, ends, max(1.5, 1.5 * LINE_WIDTH * self.scale), 1.0, color, 1.0)
        for end in ends:
            raster.disc(image, end[0], end[1], max(1.0, POST_RADIUS * self.scale), 1.0, COLORS.lip, 1.0)
