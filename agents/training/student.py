"""A student: PPO that can also imitate a teacher, on the states that its own play leads to.

The student sees whatever its tables show: late and noisy states, several of them at once, or pictures. While it learns,
its teacher and its critic see the exact states. When it imitates, it plays, the teacher labels what it would have done,
and the student learns these labels. That is DAgger (Ross, Gordon and Bagnell, "A reduction of imitation learning and
structured prediction to no-regret online learning", AISTATS 2011) without its growing data set: tables are so quick
that every update gets new samples. When it learns from points, its critic, which plays no part later, may know more
than the actor (Pinto et al., "Asymmetric actor critic for image-based robot learning", RSS 2018).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, MlpExtractor
from torch import nn
from torch.nn import functional

from agents.features import RelativeFeatures
from agents.sight import StateFromPictures
from agents.training.student_tables import EXACT_STATE, SEEN, TABLE
from airhockey_env.opponents.players import Policy
from airhockey_env.tables import FULL_SIZE, TableSpec

LINEAR_FROM = 0.1
"""Differences of actions greater than this count linearly instead of by their squares. Where the student cannot know on
which side of a decision the teacher is, it then takes a side too, instead of doing half of both."""


class StudentFeatures(BaseFeaturesExtractor):
    """What the actor makes of what the student sees, and behind that what the critic makes of the exact states."""

    def __init__(self, observation_space: spaces.Dict, spec: TableSpec = FULL_SIZE) -> None:
        space, exact, table = (observation_space[name] for name in (SEEN, EXACT_STATE, TABLE))
        assert isinstance(space, spaces.Box) and isinstance(exact, spaces.Box) and table.shape is not None
        seen = StateFromPictures(space, spec) if space.dtype == np.uint8 else RelativeFeatures(space, spec)
        known = RelativeFeatures(exact, spec)
        super().__init__(observation_space, seen.features_dim + known.features_dim + table.shape[0])
        self.seen, self.known = seen, known

    def forward(self, observations: dict[str, torch.Tensor]) -> torch.Tensor:
        seen, known = self.seen(observations[SEEN]), self.known(observations[EXACT_STATE])
        return torch.cat([seen, known, observations[TABLE]], dim=1)

    def estimation_error(self, features: torch.Tensor) -> torch.Tensor:
        """The mean error of the state that is estimated from pictures, where there are any, else 0.

        Args:
            features: what `forward` has returned.
        """
        if not isinstance(self.seen, StateFromPictures):
            return features.new_zeros(())
        estimated, exact = features.split([self.seen.features_dim, features.shape[1] - self.seen.features_dim], dim=1)
        return functional.smooth_l1_loss(estimated, exact[:, : self.known.features_dim], beta=LINEAR_FROM)


class Apart(MlpExtractor):
    """The actor's and the critic's hidden layers, each over its own part of the features."""

    def __init__(self, first: int, features: int, net_arch: dict[str, list[int]], activation: type[nn.Module]) -> None:
        super().__init__(first, {"pi": net_arch["pi"]}, activation)
        critic = MlpExtractor(features - first, {"vf": net_arch["vf"]}, activation)
        self.value_net, self.latent_dim_vf = critic.value_net, critic.latent_dim_vf
        self.first = first

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        return self.policy_net(features[:, : self.first])

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        return self.value_net(features[:, self.first :])


class StudentPolicy(MultiInputActorCriticPolicy):
    """An actor that sees what the student sees, and a critic that sees the exact states."""

    def extract_features(self, obs: Any, features_extractor: BaseFeaturesExtractor | None = None) -> torch.Tensor:
        """The features of observations, which are taken as they are: pictures stay bytes."""
        return self.features_extractor(obs)

    def _build_mlp_extractor(self) -> None:
        features = self.features_extractor
        assert isinstance(features, StudentFeatures) and isinstance(self.net_arch, dict)
        self.mlp_extractor = Apart(features.seen.features_dim, self.features_dim, self.net_arch, self.activation_fn)


class Student(PPO):
    """PPO whose updates imitate a teacher as long as there is one.

    Attributes:
        teacher: a policy; it is given the exact states (N, 13). None: the student learns from points.
    """

    teacher: Policy | None = None

    def train(self) -> None:
        """Update the network from the rollout buffer."""
        if self.teacher is None:
            super().train()
            return
        policy: Any = self.policy
        optimizer = policy.optimizer
        policy.set_training_mode(True)
        self._update_learning_rate(optimizer)
        errors: list[torch.Tensor] = []
        for _ in range(self.n_epochs):
            samples: Any
            for samples in self.rollout_buffer.get(self.batch_size):
                labels = self._labels(samples.observations[EXACT_STATE])
                features = policy.extract_features(samples.observations)
                latent, latent_vf = policy.mlp_extractor(features)
                error = imitation_error(policy.action_net(latent), labels)
                values = policy.value_net(latent_vf).flatten()
                loss = error + policy.features_extractor.estimation_error(features)
                loss = loss + self.vf_coef * functional.mse_loss(values, samples.returns)
                optimizer.zero_grad()
                loss.backward()
                nn.utils.clip_grad_norm_(policy.parameters(), self.max_grad_norm)
                optimizer.step()
                errors.append(error.detach())
        self._n_updates += self.n_epochs
        self.logger.record("train/imitation_error", float(torch.stack(errors).mean()))

    def _labels(self, exact: torch.Tensor) -> torch.Tensor:
        """What the teacher does in these exact states."""
        assert self.teacher is not None
        return torch.as_tensor(np.asarray(self.teacher(exact.cpu().numpy())), device=self.device)

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "teacher"]


def imitation_error(means: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """The mean error of actions before clipping, (N, 2), against the teacher's in [-1, 1].

    Actions are clipped, so there is no error beyond a limit that the teacher's action is at.
    """
    beyond = ((labels >= 1.0) & (means > 1.0)) | ((labels <= -1.0) & (means < -1.0))
    return functional.smooth_l1_loss(torch.where(beyond, labels, means), labels, beta=LINEAR_FROM)


class Imitation(BaseCallback):
    """Lets a student imitate a teacher until it has played a number of steps.

    Args:
        teacher: see `Student.teacher`.
        steps: number of steps of the run.
    """

    model: Student

    def __init__(self, teacher: Policy, steps: int) -> None:
        super().__init__()
        self.teacher, self.steps = teacher, steps

    def _on_training_start(self) -> None:
        self.model.teacher = self.teacher

    def _on_step(self) -> bool:
        return self.num_timesteps < self.steps

    def _on_training_end(self) -> None:
        self.model.teacher = None
