"""Air hockey for reinforcement learning, on an exact physics engine. Importing registers the environments."""

import gymnasium

from airhockey_env.air_table import AirTable
from airhockey_env.cameras import ROBOT, Camera
from airhockey_env.env import AirHockeyEnv
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, RIGHT
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.pool import Pool
from airhockey_env.tables import PRESETS, TableSpec
from airhockey_env.vector_env import AirHockeyVectorEnv
from airhockey_env.version import __version__

__all__ = [
    "LEFT",
    "PRESETS",
    "RIGHT",
    "ROBOT",
    "AirHockeyEnv",
    "AirHockeyVectorEnv",
    "AirTable",
    "Camera",
    "Game",
    "MlpPolicy",
    "Pool",
    "TableSpec",
    "__version__",
]

for _id, _task in (
    ("AirHockey-v0", "point"),
    ("AirHockeyMatch-v0", "match"),
    ("AirHockeyHit-v0", "hit"),
    ("AirHockeyDefend-v0", "defend"),
):
    gymnasium.register(
        id=_id,
        entry_point="airhockey_env.env:AirHockeyEnv",
        vector_entry_point="airhockey_env.vector_env:AirHockeyVectorEnv",
        max_episode_steps=TASKS[_task].max_episode_steps,
        kwargs={"task": _task, "opponent": TASKS[_task].opponent} if _task != "point" else {},
    )
