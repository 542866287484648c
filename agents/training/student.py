"""A student: PPO that can also learn by imitating a teacher on the states that its own play leads to.

The teacher sees the exact states, the student whatever its environment shows: late and noisy states, a few of them at
once, or pictures. The student plays, the teacher labels what it would have done, and the student learns these labels.
That is DAgger (Ross, Gordon and Bagnell, "A reduction of imitation learning and structured prediction to no-regret
online learning", AISTATS 2011) without its growing data set: tables are so quick that every update gets new samples.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from torch.nn import functional

from airhockey_env.opponents.players import Policy

LINEAR_FROM = 0.1
"""Differences of actions greater than this count linearly instead of by their squares. Where the student cannot know on
which side of a decision the teacher is, it then decides too, instead of doing half of both."""


class Student(PPO):
    """PPO whose updates imitate the actions in the rollout buffer while `imitates` is true."""

    imitates = False

    def train(self) -> None:
        """Update the network from the rollout buffer."""
        if not self.imitates:
            super().train()
            return
        policy, optimizer = self.policy, self.policy.optimizer
        policy.set_training_mode(True)
        self._update_learning_rate(optimizer)
        errors: list[torch.Tensor] = []
        for _ in range(self.n_epochs):
            for samples in self.rollout_buffer.get(self.batch_size):
                means = policy.get_distribution(samples.observations).distribution.mean
                error = imitation_error(means, samples.actions)
                values = policy.predict_values(samples.observations).flatten()
                loss = error + self.vf_coef * functional.mse_loss(values, samples.returns)
                optimizer.zero_grad()
                loss.backward()
                torch.nn.utils.clip_grad_norm_(policy.parameters(), self.max_grad_norm)
                optimizer.step()
                errors.append(error.detach())
        self._n_updates += self.n_epochs
        self.logger.record("train/imitation_error", float(torch.stack(errors).mean()))


def imitation_error(means: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """The mean error of actions before clipping, (N, 2), against the teacher's in [-1, 1].

    Beyond a limit that the teacher's action is at, an action is clipped to the same, so there is no error.
    """
    beyond = ((labels >= 1.0) & (means > 1.0)) | ((labels <= -1.0) & (means < -1.0))
    return functional.smooth_l1_loss(torch.where(beyond, labels, means), labels, beta=LINEAR_FROM)


class Labels(BaseCallback):
    """Puts the teacher's actions into the rollout buffer in place of the student's, for a number of steps.

    Args:
        teacher: a policy; it is given the exact states (N, 13), whatever the student sees.
        steps: the student imitates until it has played so many steps.
    """

    model: Student

    def __init__(self, teacher: Policy, steps: int) -> None:
        super().__init__()
        self.teacher, self.steps = teacher, steps
        self.labels: list[NDArray[np.float32]] = []

    def _label(self) -> None:
        """Note what the teacher would do now."""
        tables: Any = self.training_env.unwrapped
        self.labels.append(np.asarray(self.teacher(tables.exact_observations()), np.float32))

    def _on_training_start(self) -> None:
        self.model.imitates = True

    def _on_rollout_start(self) -> None:
        self.labels = []
        self._label()

    def _on_step(self) -> bool:
        self._label()
        return self.num_timesteps < self.steps

    def _on_rollout_end(self) -> None:
        actions = self.model.rollout_buffer.actions
        actions[:] = np.stack(self.labels[: len(actions)])

    def _on_training_end(self) -> None:
        self.model.imitates = False
