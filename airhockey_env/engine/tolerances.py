"""Every tolerance and bound of the engine, with its meaning and unit."""

TOUCH_SPEED = 1e-12
"""m/s. Two touching discs that approach more slowly than this count as resting on each other. Without it, a
perfectly inelastic pair whose speeds differ by one rounding would kiss for ever. At this speed an overlap of 1e-9 m
would take a quarter of an hour to build up."""

OVERLAP = 1e-9
"""m. A deeper overlap of discs, or of a disc and a wall, is a caller's mistake; a smaller one is rounding."""

GAME_CONTACTS = 8
"""Contacts of the puck in one tick of the game before it counts as squeezed: see `advance`."""

TABLE_CONTACTS = 1000
"""The same for a disc on an `AirTable`, per second of tick (at least a second's worth)."""
