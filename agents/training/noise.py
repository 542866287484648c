"""The disturbances of the actions with which PPO explores, when their size is given instead of learned."""

from __future__ import annotations

import math
from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from agents.training import workers


def set_noise(model: PPO, deviation: float) -> None:
    """Let the disturbances of the actions have this standard deviation, on the tables as they are now.

    With gSDE, that is the mean over these tables: gSDE multiplies random numbers with the outputs of the last hidden
    layer, whose size depends on training.

    Args:
        model: a model whose tables have begun to play.
        deviation: standard deviation of each component of an action, more than 0.
    """
    policy: Any = model.policy
    size = 1.0
    with torch.no_grad():
        if model.use_sde:
            observations, _ = policy.obs_to_tensor(model._last_obs)
            latent, _ = policy.mlp_extractor(policy.extract_features(observations))
            (total,) = workers.total(float((latent**2).sum(dim=1).mean()))
            size = (total / workers.number()) ** 0.5
        policy.log_std.fill_(math.log(deviation / size))


class Noise(BaseCallback):
    """Gives the disturbances a standard deviation at the beginning of a phase, or during all of it.

    Args:
        start: the standard deviation at the beginning.
        end: that at the end, to which it falls geometrically. With 0, the deviation is learned after the beginning.
        first, last: numbers of steps of the run at which the phase begins and ends.
    """

    model: PPO

    def __init__(self, start: float, end: float, first: int, last: int) -> None:
        super().__init__()
        self.start, self.end, self.first, self.last = start, end, first, last

    def _on_rollout_start(self) -> None:
        if self.end > 0.0:
            share = min(1.0, (self.num_timesteps - self.first) / (self.last - self.first))
            set_noise(self.model, self.start * (self.end / self.start) ** share)
        elif self.num_timesteps == self.first:  # and not in a run that is resumed later
            set_noise(self.model, self.start)

    def _on_step(self) -> bool:
        return True
