"""Air hockey for reinforcement learning, on an exact physics engine. Importing registers the environments."""

import gymnasium

from airhockey_env.air_table import AirTable
from airhockey_env.env import AirHockeyEnv
from airhockey_env.tables import PRESETS, TableSpec
from airhockey_env.vector_env import AirHockeyVectorEnv
from airhockey_env.version import __version__

__all__ = ["PRESETS", "AirHockeyEnv", "AirHockeyVectorEnv", "AirTable", "TableSpec", "__version__"]

gymnasium.register(
    id="AirHockey-v0",
    entry_point="airhockey_env.env:AirHockeyEnv",
    vector_entry_point="airhockey_env.vector_env:AirHockeyVectorEnv",
    max_episode_steps=1500,
)
