"""Every tolerance and bound of the engine, with its meaning and unit."""

TOUCH_SPEED = 1e-12
"""m/s. Touching discs that approach each other more slowly than this count as being at rest relative to each other.
Otherwise a perfectly inelastic pair whose speeds differ by rounding would kiss forever. At this speed it takes a
quarter of an hour to build up an overlap of 1e-9 m."""

TOUCH_GAP = 1e-14
"""Relative excess of the squared distance of two discs over the squared sum of their radii at which they still count as
touching. Because of rounding, discs that rest on each other are as often an ulp apart as an ulp too close."""

OVERLAP = 1e-9
"""m. A deeper overlap of discs, or of a disc and a wall, is an error of the caller; a smaller one is due to
rounding."""

GAME_CONTACTS = 8
"""Contacts of the puck in one tick of the game before it counts as squeezed: see `relieve`."""

TABLE_CONTACTS = 10_000
"""The same for a disc on an `AirTable`, per second of the step, and at least for one second. It is this large because a
light puck between a wall and a puck a million times as heavy really has 3141 contacts in a row."""

COLLAPSE_TIME = 1e-3
"""s. Contacts of a disc that follow each other faster than this may belong to a collapsing cluster; see `cluster`."""

COLLAPSE_CONTACTS = 8
"""Contacts in a row that count as a collapse at restitution 0."""

COLLAPSE_SHARE = 1e-3
"""A higher restitution needs as many more contacts as would reduce a speed to this share of itself."""

SKIN = 1e-2
"""Share of the sum of two radii. Discs of a collapsing cluster with a smaller gap count as touching."""

GREATEST = 1e50
"""Greatest coordinate, speed, radius and (finite) mass on an `AirTable`, and the reciprocal of the smallest radius and
mass. The product of four such numbers is still a finite float."""

FARTHEST = 1e300
"""m. Greatest distance that a disc may travel in a step."""

MOST_CONTACTS = 2**22
"""Most contacts in one step of an `AirTable`, for all discs together: a quarter of a gigabyte."""
