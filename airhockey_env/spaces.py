"""The spaces of one table, for every face."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from airhockey_env.records import OBSERVATION_SIZE


def observation_space() -> spaces.Box:
    """State observations: see `AirHockeyEnv`."""
    return spaces.Box(-1.0, 1.0, (OBSERVATION_SIZE,), np.float32)


def action_space(continuous: bool) -> spaces.Box | spaces.Discrete:
    """Target velocities, or the nine discrete directions: see `AirHockeyEnv`."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32) if continuous else spaces.Discrete(9)
