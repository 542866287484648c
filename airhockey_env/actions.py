"""The discrete actions and the target velocities that they stand for."""

from __future__ import annotations

import math

import numpy as np

_DIAGONAL = math.sqrt(0.5)

DIRECTIONS = np.array(
    [[0, 0], [1, 0], [_DIAGONAL, _DIAGONAL], [0, 1], [-_DIAGONAL, _DIAGONAL],
     [-1, 0], [-_DIAGONAL, -_DIAGONAL], [0, -1], [_DIAGONAL, -_DIAGONAL]],
    dtype=np.float32,
)  # fmt: skip
"""(9, 2): stay, then eight directions at full speed, counter-clockwise from straight ahead."""
