"""The environment of a data set: as a `Game` for the batch that plays it, and as the spec that recovers it."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import gymnasium
from gymnasium.envs.registration import EnvSpec

from agents.conditions import EXACT, Conditions
from agents.measuring.evaluation import CONTROL_HZ
from airhockey_env.env import AirHockeyEnv
from airhockey_env.kernel.state import LEFT
from airhockey_env.kernel.tasks import TASKS


def env_id(task: str) -> str:
    """The id under which a task is registered."""
    entry = f"{AirHockeyEnv.__module__}:{AirHockeyEnv.__qualname__}"
    ours = [spec for spec in gymnasium.registry.values() if spec.entry_point == entry]
    return next(spec.id for spec in ours if spec.kwargs.get("task", "point") == task)


@dataclass(frozen=True)
class Setting:
    """The environment of a data set. All of it is data, so that the environment can be recovered from its spec."""

    task: str
    """One of `TASKS`."""
    opponent: str
    """The name of a player, or the path of a policy.npz or of a run's folder."""
    conditions: Conditions = EXACT
    stack: int = 1
    """How many observations an observation consists of: see `AirHockeyEnv`."""
    control_hz: float = CONTROL_HZ
    opponent_skill: float = 1.0

    @property
    def max_episode_steps(self) -> int:
        """The registered environment's time limit, in control steps."""
        return round(TASKS[self.task].max_episode_steps * self.control_hz / CONTROL_HZ)

    @functools.cached_property
    def spec(self) -> EnvSpec:
        """What `gymnasium.make` makes the environment from, without the arguments that are defaults."""
        kept = self.conditions.as_dict()
        arguments: dict[str, Any] = {name: kept[name] for name in self.conditions.env_arguments()}
        for name in ("stack", "control_hz", "opponent_skill"):
            if getattr(self, name) != type(self).__dict__[name]:
                arguments[name] = getattr(self, name)
        env = gymnasium.make(
            env_id(self.task), max_episode_steps=self.max_episode_steps, opponent=self.opponent, **arguments
        )
        assert env.spec is not None
        return env.spec

    def game_arguments(self) -> dict[str, Any]:
        """Arguments of a `Game` whose left player has this environment before it."""
        return {
            "task": self.task,
            "right": self.opponent,
            "right_skill": self.opponent_skill,
            "left_stack": self.stack,
            "control_hz": self.control_hz,
            "max_episode_steps": self.max_episode_steps,
            **self.conditions.game_arguments(LEFT),
        }
