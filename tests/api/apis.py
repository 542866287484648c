"""Every API of the game, with two tables where it has more than one."""

from __future__ import annotations

from functools import partial

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.parallel_env import AirHockeyParallelEnv
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

APIS = {
    "single": AirHockeyEnv,
    "batch": partial(AirHockeyVectorEnv, 2),
    "sb3": partial(AirHockeySB3VecEnv, 2),
    "parallel": AirHockeyParallelEnv,
}
