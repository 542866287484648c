"""Every tolerance and bound of the engine, with its meaning and unit."""

TOUCH_SPEED = 1e-12
"""m/s. Two touching discs that approach more slowly than this count as resting on each other. Without it, a
perfectly inelastic pair whose speeds differ by one rounding would kiss for ever. At this speed an overlap of 1e-9 m
would take a quarter of an hour to build up."""

TOUCH_GAP = 1e-14
"""Share of the squared sum of the radii by which the squared distance of two discs may exceed it, by rounding, while
they touch: discs that rest on each other are as often an ulp apart as an ulp too close."""

OVERLAP = 1e-9
"""m. A deeper overlap of discs, or of a disc and a wall, is a caller's mistake; a smaller one is rounding."""

GAME_CONTACTS = 8
"""Contacts of the puck in one tick of the game before it counts as squeezed: see `relieve`."""

TABLE_CONTACTS = 10_000
"""The same for a disc on an `AirTable`, per second of tick (at least a second's worth). So many, because a light puck
between a wall and one that is a million times as heavy has 3141 honest contacts in a row."""

COLLAPSE_TIME = 1e-3
"""s. A disc's contacts that follow each other faster than this may be those of a collapsing cluster: see `cluster`."""

COLLAPSE_CONTACTS = 8
"""Contacts in a row that count as a collapse at restitution 0. A higher restitution needs more:"""

COLLAPSE_SHARE = 1e-3
"""as many more as would take a speed to this share of itself."""

SKIN = 1e-2
"""Share of the sum of two radii. Discs of a collapsing cluster that are no further apart touch."""

GREATEST = 1e50
"""Greatest coordinate, speed, radius and (finite) mass on an `AirTable`, and one over the smallest radius and mass:
products of four of them still are floats."""

FARTHEST = 1e300
"""m. Greatest way that a disc may travel in a step."""

MOST_CONTACTS = 2**22
"""Contacts of one step of an `AirTable`, all discs together: a quarter of a gigabyte."""
