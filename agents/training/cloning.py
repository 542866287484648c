"""Behaviour cloning: a policy that imitates the actions in a data set (Pomerleau, "ALVINN", NeurIPS 1988).

It is the baseline of offline learning. It takes no account of rewards, so it comes close to the player that was
recorded, and not beyond.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from agents.conditions import Conditions
from agents.features import relative_features, stack_of_shape
from agents.training.student import imitation_error
from airhockey_env.opponents.policy import MlpPolicy

BATCH = 1024
"""Steps per update of the network."""

RATE = 1e-3
"""Learning rate of Adam at first; it falls linearly to 0."""


def clone(
    observations: NDArray[np.float32],
    actions: NDArray[np.float32],
    matrix: NDArray[np.float32],
    *,
    epochs: int,
    width: int = 64,
    seed: int = 0,
) -> tuple[MlpPolicy, float]:
    """Train a network of two hidden layers to answer observations with the actions.

    Args:
        observations: (n, 13), or (n, stack, 15).
        actions: (n, 2) in [-1, 1].
        matrix: of the features that the network sees, see `agents.features.relative_features`.
        epochs: passes over the steps.
        width: units of each hidden layer.
        seed: determines the first weights and the order of the steps.

    Returns:
        The policy, and the mean error of its last pass: see `agents.training.student.imitation_error`.
    """
    from tqdm import tqdm

    torch.manual_seed(seed)
    stack = stack_of_shape(observations.shape[1:])
    features = torch.as_tensor(observations.reshape(len(observations), -1) @ matrix.T)
    labels = torch.as_tensor(actions)
    net = nn.Sequential(
        nn.Linear(len(matrix), width), nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, 2)
    )
    optimizer = torch.optim.Adam(net.parameters(), lr=RATE)
    updates = epochs * -(-len(labels) // BATCH)
    falling = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.0, updates)
    error = float("nan")
    with tqdm(total=updates, unit="update", delay=2.0, leave=False, disable=None) as bar:
        for _ in range(epochs):
            errors = []
            for rows in torch.randperm(len(labels)).split(BATCH):
                loss = imitation_error(net(features[rows]), labels[rows])
                optimizer.zero_grad()
                loss.backward()
                optimizer.step()
                falling.step()
                errors.append(loss.detach())
                bar.update()
            error = float(torch.stack(errors).mean())
    linear = [layer for layer in net if isinstance(layer, nn.Linear)]
    weights = [layer.weight.detach().numpy() for layer in linear]
    weights[0] = weights[0] @ matrix
    return MlpPolicy(weights, [layer.bias.detach().numpy() for layer in linear], "relu", stack=stack), error


def clone_dataset(dataset: Any, *, epochs: int, seed: int = 0) -> tuple[MlpPolicy, float]:
    """`clone` the player of a `minari.MinariDataset` of this game.

    Raises:
        ValueError: it holds no observations of the state, or other actions.
    """
    if not stack_of_shape(dataset.observation_space.shape or ()) or dataset.action_space.shape != (2,):
        raise ValueError(f"{dataset.id} must hold observations of the state and continuous actions of this game")
    episodes = list(dataset.iterate_episodes())
    observations = np.concatenate([episode.observations[:-1] for episode in episodes])
    actions = np.concatenate([episode.actions for episode in episodes])
    table = Conditions.of_env_arguments(dataset.env_spec.kwargs).table
    matrix = relative_features(table, stack_of_shape(observations.shape[1:]))
    return clone(observations, actions, matrix, epochs=epochs, seed=seed)
