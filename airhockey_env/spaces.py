"""The observation and action spaces of one table."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces

from airhockey_env.actions import DIRECTIONS
from airhockey_env.drawing.pixels import CHANNELS, SIZE
from airhockey_env.kernel.state import observation_shape


def observation_space(obs_type: str = "state", stack: int = 1) -> spaces.Box:
    """State observations or pictures, or stacks of them: see `AirHockeyEnv`."""
    if obs_type in CHANNELS:
        picture = (SIZE, SIZE) if CHANNELS[obs_type] == 1 else (SIZE, SIZE, CHANNELS[obs_type])
        return spaces.Box(0, 255, picture if stack == 1 else (stack, *picture), np.uint8)
    return spaces.Box(-1.0, 1.0, observation_shape(stack), np.float32)


def action_space(continuous: bool) -> spaces.Box | spaces.Discrete:
    """Target velocities, or the nine discrete directions: see `AirHockeyEnv`."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32) if continuous else spaces.Discrete(len(DIRECTIONS))
