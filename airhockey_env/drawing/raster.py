"""Anti-aliased drawing on plain arrays: discs, rings, strokes and rounded rectangles.

A shape is a signed distance in pixels (negative inside), which is converted to coverage and blended onto the image in
place. Only the shape's bounding box is visited, so a static background can be prepared once and moving parts drawn onto
a copy.

All functions share these arguments:
    image: uint8 (H, W, C), changed in place; shapes may lie partly or completely outside. Draw into a view to clip.
    coordinates: x to the right and y down, in pixels. Pixel (row, column) is the square from (column, row) to
        (column + 1, row + 1). Coordinates are finite; radii and widths are greater than 0.
    softness: width of the edge in pixels: 1 for a crisp anti-aliased edge, more for shadows and glows.
    color: tuple of C integers, 0 to 255.
    alpha: opacity, 0 to 1.

Arguments are not checked, because these functions are only called by this package and also from compiled code.
"""

from __future__ import annotations

import math

import numpy as np

from airhockey_env.compiled import compiled, inlined

TINY = 1e-12


@compiled
def coverage(distance, softness):
    """Share of a pixel that is inside a shape, 0 to 1, from the signed distance of its centre to the edge."""
    return min(max(0.5 - distance / softness, 0.0), 1.0)


@inlined
def weight_of(alpha):
    """The share `alpha` in 256ths: whole numbers keep 0 and 1 exact."""
    return np.int32(256.0 * alpha + 0.5)


@inlined
def mix(image, row, column, color, weight):
    """Mix `color` into one pixel, by its weight in 256ths."""
    for channel in range(len(color)):
        before = np.int64(image[row, column, channel])
        image[row, column, channel] = np.uint8(before + (((color[channel] - before) * weight + 128) >> 8))


@compiled
def blend(image, row, column, color, alpha):
    """Mix `color` into one pixel."""
    mix(image, row, column, color, weight_of(alpha))


@compiled
def span(low, high, limit):
    """First and one-past-last pixel that the interval [low, high] touches, clipped to 0 to `limit`."""
    # Clip before converting: a distant coordinate may not fit into an integer.
    first = math.floor(min(max(low, 0.0), limit))
    last = math.ceil(min(max(high, 0.0), limit))
    return int(first), int(last)


@compiled
def disc(image, x, y, radius, softness, color, alpha):
    """Fill a disc; see the module for the arguments."""
    reach = radius + 0.5 * softness
    core = max(radius - 0.5 * softness, 0.0)
    top, bottom = span(y - reach, y + reach, image.shape[0])
    left, right = span(x - reach, x + reach, image.shape[1])
    for row in range(top, bottom):
        dy = row + 0.5 - y
        for column in range(left, right):
            dx = column + 0.5 - x
            squared = dx * dx + dy * dy
            # Only the rim needs a square root.
            if squared <= core * core:
                blend(image, row, column, color, alpha)
            elif squared < reach * reach:
                blend(image, row, column, color, alpha * coverage(math.sqrt(squared) - radius, softness))


LANES = 8
"""Pixels of a row that the processor works out at once."""


@compiled
def ellipse(image, x, y, radius_x, radius_y, softness, color, alpha):
    """Fill an axis-aligned ellipse; see the module for the arguments."""
    draw_ellipse(image, x, y, radius_x, radius_y, softness, color, alpha, room_for(image.shape[1]))


@inlined
def room_for(width):
    """Room for the weights of a row of so many pixels, in whole groups of LANES."""
    return np.empty(width + LANES, np.int32)


@inlined
def draw_ellipse(image, x, y, radius_x, radius_y, softness, color, alpha, weights):
    """Like `ellipse`, with `room_for` a row of the image."""
    reach_x, reach_y = radius_x + 0.5 * softness, radius_y + 0.5 * softness
    top, bottom = span(y - reach_y, y + reach_y, image.shape[0])
    left, right = span(x - reach_x, x + reach_x, image.shape[1])
    per_x, per_y = 1.0 / (radius_x * radius_x), 1.0 / (radius_y * radius_y)
    groups = (right - left + LANES - 1) // LANES
    for row in range(top, bottom):
        dy = row + 0.5 - y
        level_y, slope_y = dy * dy * per_y, (dy * per_y) * (dy * per_y)
        for k in range(groups * LANES):  # whole groups: what is beyond the right edge is not used
            dx = left + k + 0.5 - x
            # `level` is the square of a function that is 1 on the rim. Its difference to 1 divided by its slope is
            # the distance: exact on the axes and accurate near the rim. (At the centre the slope is 0.)
            level = dx * dx * per_x + level_y
            slope = math.sqrt((dx * per_x) * (dx * per_x) + slope_y + TINY)
            weights[k] = weight_of(alpha * coverage((level - math.sqrt(level)) / slope, softness))
        for column in range(left, right):
            mix(image, row, column, color, weights[column - left])


@compiled
def ring(image, x, y, radius, width, softness, color, alpha):
    """Draw the outline of a circle, `width` pixels wide and centred on `radius`."""
    reach = radius + 0.5 * (width + softness)
    top, bottom = span(y - reach, y + reach, image.shape[0])
    left, right = span(x - reach, x + reach, image.shape[1])
    for row in range(top, bottom):
        dy = row + 0.5 - y
        for column in range(left, right):
            dx = column + 0.5 - x
            distance = abs(math.sqrt(dx * dx + dy * dy) - radius) - 0.5 * width
            if distance < 0.5 * softness:
                blend(image, row, column, color, alpha * coverage(distance, softness))


@compiled
def segment_distance_squared(x, y, x0, y0, x1, y1):
    """Squared distance from a point to the line segment from (x0, y0) to (x1, y1), which may be a single point."""
    along_x, along_y = x1 - x0, y1 - y0
    squared = along_x * along_x + along_y * along_y
    share = 0.0
    if squared > 0.0:
        share = min(max(((x - x0) * along_x + (y - y0) * along_y) / squared, 0.0), 1.0)
    dx, dy = x - x0 - share * along_x, y - y0 - share * along_y
    return dx * dx + dy * dy


@compiled
def stroke(image, points, width, softness, color, alpha):
    """Draw a line through `points`, float64 (K, 2) with K >= 2, `width` pixels wide with round ends and joints.

    It is blended as one shape, so a transparent stroke is not darker where its segments meet or cross.
    """
    reach = 0.5 * (width + softness)
    top, bottom = span(points[:, 1].min() - reach, points[:, 1].max() + reach, image.shape[0])
    left, right = span(points[:, 0].min() - reach, points[:, 0].max() + reach, image.shape[1])
    for row in range(top, bottom):
        for column in range(left, right):
            nearest = math.inf
            for k in range(len(points) - 1):
                squared = segment_distance_squared(
                    column + 0.5, row + 0.5, points[k, 0], points[k, 1], points[k + 1, 0], points[k + 1, 1]
                )
                nearest = min(nearest, squared)
            if nearest < reach * reach:
                distance = math.sqrt(nearest) - 0.5 * width
                blend(image, row, column, color, alpha * coverage(distance, softness))


@compiled
def box_distance(x, y, left, top, right, bottom, corner):
    """Signed distance to an axis-aligned rectangle whose corners are rounded with the radius `corner`."""
    dx = abs(x - 0.5 * (left + right)) - 0.5 * (right - left) + corner
    dy = abs(y - 0.5 * (top + bottom)) - 0.5 * (bottom - top) + corner
    if dx > 0.0 and dy > 0.0:
        return math.sqrt(dx * dx + dy * dy) - corner
    return max(dx, dy) - corner


@compiled
def box(image, left, top, right, bottom, corner, softness, color, alpha):
    """Fill an axis-aligned rectangle with corners of radius `corner`, from 0 to half its smaller side."""
    reach = 0.5 * softness
    first_row, last_row = span(top - reach, bottom + reach, image.shape[0])
    first_column, last_column = span(left - reach, right + reach, image.shape[1])
    # The inner part, most of a large box, is far from every edge and needs no distances.
    inset = corner + reach + 1.0
    core_top, core_bottom = span(top + inset, bottom - inset, image.shape[0])
    core_left, core_right = span(left + inset, right - inset, image.shape[1])
    if alpha < 1.0 or core_top >= core_bottom or core_left >= core_right:
        core_top, core_bottom, core_left, core_right = 0, 0, 0, 0
    for channel in range(len(color)):
        image[core_top:core_bottom, core_left:core_right, channel] = color[channel]
    for row in range(first_row, last_row):
        for column in range(first_column, last_column):
            if core_top <= row < core_bottom and core_left <= column < core_right:
                continue
            distance = box_distance(column + 0.5, row + 0.5, left, top, right, bottom, corner)
            if distance < reach:
                blend(image, row, column, color, alpha * coverage(distance, softness))
