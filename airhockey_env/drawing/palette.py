"""The colours of the pictures for people; the browser's pages draw with the same ones."""

from __future__ import annotations

from typing import NamedTuple

Color = tuple[int, int, int]
"""Red, green and blue, 0 to 255."""


class Palette(NamedTuple):
    """The colours of a table. Those that begin with `left` and `right` belong to the players."""

    left: Color
    left_dark: Color
    left_light: Color
    right: Color
    right_dark: Color
    right_light: Color
    room: Color
    rail: Color
    rail_edge: Color
    rail_top: Color
    lip: Color
    pocket: Color
    pocket_edge: Color
    surface: Color
    surface_shade: Color
    hole: Color
    marking: Color
    puck: Color
    puck_dark: Color
    puck_light: Color
    black: Color
    white: Color
    clock_track: Color
    clock_calm: Color
    clock_soon: Color
    clock_late: Color


COLORS = Palette(
    left=(240, 74, 104),
    left_dark=(186, 38, 72),
    left_light=(255, 138, 156),
    right=(42, 132, 246),
    right_dark=(20, 88, 190),
    right_light=(120, 184, 255),
    room=(14, 17, 25),
    rail=(36, 43, 60),
    rail_edge=(58, 68, 92),
    rail_top=(46, 54, 75),
    lip=(196, 207, 222),
    pocket=(12, 15, 23),
    pocket_edge=(62, 73, 98),
    surface=(240, 244, 249),
    surface_shade=(203, 213, 226),
    hole=(196, 207, 221),
    marking=(134, 149, 181),
    puck=(38, 45, 62),
    puck_dark=(18, 22, 32),
    puck_light=(246, 190, 72),
    black=(0, 0, 0),
    white=(255, 255, 255),
    clock_track=(22, 27, 39),
    clock_calm=(160, 174, 200),
    clock_soon=(255, 184, 48),
    clock_late=(255, 70, 48),
)
