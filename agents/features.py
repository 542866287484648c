"""Feature extractors: the puck relative to the paddle and what can be foreseen for states, convolutions for pictures.

Where a shot goes depends on millimetres between paddle and puck, which are small differences of large numbers in the
observation. A fixed linear layer in front of the network computes them at a useful scale. It costs nothing when the
exported policy plays, because it is folded into the weights of the first layer. What a network of sums and ReLUs hardly
computes at all are quotients, such as the time until the puck is there: `airhockey_env.opponents.foresight` adds them.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

from airhockey_env.checks import MOST_STACK
from airhockey_env.kernel.state import OBSERVATION_SIZE, ROW_SIZE, observation_shape
from airhockey_env.opponents.foresight import FORESEEN_SIZE, table_of, with_foresight
from airhockey_env.tables import FULL_SIZE, TableSpec

_DISTANCE_SCALE = 6.0
"""1/m. With this scale, the sum of the radii of a paddle and a puck is about half a unit."""

_SPEED_SCALE = 3.0
"""Factor on the puck's velocity, because the puck is usually far slower than its greatest speed."""


_CHANGE_SCALE = 4.0
"""Factor on the changes from one row of a stack to the next, which are small for the same reason."""


def relative_features(spec: TableSpec, stack: int = 1) -> NDArray[np.float32]:
    """The matrix that maps an observation to the features: (17, 13), or (19 * stack, 15 * stack) of a stack's rows.

    Of a stack, the features are those of the newest row and its action, and for each older row the changes of these
    features from it to the next, with the older action as it is.
    """
    one = _of_one_row(spec)
    if stack == 1:
        return one
    inputs, outputs = ROW_SIZE, len(one) + 2
    row = np.zeros((outputs, inputs), np.float32)
    row[: len(one), :OBSERVATION_SIZE] = one
    row[len(one) :, OBSERVATION_SIZE:] = np.eye(2)
    matrix = np.zeros((outputs * stack, inputs * stack), np.float32)
    matrix[-outputs:, -inputs:] = row
    for k in range(stack - 1):
        older, newer = (slice(inputs * j, inputs * (j + 1)) for j in (k, k + 1))
        change = matrix[outputs * k : outputs * (k + 1)]
        change[: len(one), older], change[: len(one), newer] = -_CHANGE_SCALE * row[:-2], _CHANGE_SCALE * row[:-2]
        change[len(one) :, older] = row[-2:]
    return matrix


def _of_one_row(spec: TableSpec) -> NDArray[np.float32]:
    matrix = np.zeros((17, 13), np.float32)
    matrix[range(13), range(13)] = 1.0
    matrix[10, 10] = matrix[11, 11] = _SPEED_SCALE
    for row, puck, paddle, half in ((13, 8, 0, 0.5 * spec.length), (14, 9, 1, 0.5 * spec.width)):
        matrix[row, puck], matrix[row, paddle] = _DISTANCE_SCALE * half, -_DISTANCE_SCALE * half
    for row, puck, paddle in ((15, 10, 2), (16, 11, 3)):
        matrix[row, puck], matrix[row, paddle] = spec.puck_speed / spec.paddle_speed, -1.0
    return matrix


class RelativeFeatures(BaseFeaturesExtractor):
    """The fixed linear layer, for Stable-Baselines3's `features_extractor_class`."""

    matrix: torch.Tensor

    def __init__(self, observation_space: spaces.Box, spec: TableSpec = FULL_SIZE) -> None:
        matrix = self._matrix(spec, stack_of_shape(observation_space.shape))
        super().__init__(observation_space, matrix.shape[0])
        self.register_buffer("matrix", torch.as_tensor(matrix))

    @property
    def foresight(self) -> TableSpec | None:
        """The table on which the network foresees the puck, None for none: see `MlpPolicy`."""
        return None

    def _matrix(self, spec: TableSpec, stack: int) -> NDArray[np.float32]:
        return relative_features(spec, stack)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        return observations.flatten(1) @ self.matrix.T

    def weights_after(self, weights: torch.Tensor) -> torch.Tensor:
        """The weights of a layer after this one that stand for weights (n, inputs) of a policy's first layer.

        Weights of observations alone are taken as weights that ignore what is foreseen.
        """
        missing = self.matrix.shape[1] - weights.shape[1]
        weights = torch.nn.functional.pad(weights, (0, missing))
        return weights @ torch.linalg.pinv(self.matrix.cpu())  # the matrix has full rank, so this undoes it


class ForesightFeatures(RelativeFeatures):
    """The fixed linear layer, and beside it what can be foreseen from a single observation: (N, 47)."""

    table: torch.Tensor
    """The fields of the table; like `matrix`, it is saved with the network."""

    def __init__(self, observation_space: spaces.Box, spec: TableSpec = FULL_SIZE) -> None:
        if stack_of_shape(observation_space.shape) != 1:
            raise ValueError(f"observations must be of one row for foresight, got {observation_space.shape}")
        super().__init__(observation_space, spec)
        self.register_buffer("table", torch.tensor(dataclasses.astuple(spec), dtype=torch.float64))

    def _matrix(self, spec: TableSpec, stack: int) -> NDArray[np.float32]:
        relative = relative_features(spec, stack)
        matrix = np.zeros((len(relative) + FORESEEN_SIZE, relative.shape[1] + FORESEEN_SIZE), np.float32)
        matrix[: len(relative), : relative.shape[1]] = relative
        matrix[len(relative) :, relative.shape[1] :] = np.eye(FORESEEN_SIZE)
        return matrix

    @property
    def foresight(self) -> TableSpec:
        return TableSpec(*self.table.tolist())

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        seen = with_foresight(observations.cpu().numpy(), table_of(self.foresight))
        return torch.from_numpy(seen).to(observations.device) @ self.matrix.T


class SmallCnn(BaseFeaturesExtractor):
    """Two convolutions for stacks of 84 x 84 pictures, designed for CPUs: the first sees each 4 x 4 patch once.

    Nothing is pooled, so positions, which are all that matters here, are preserved. Use `normalize_images=False` in the
    policy: the division by 255 is done here, on the weights of the first layer instead of the pictures.
    """

    def __init__(self, observation_space: spaces.Box, features_dim: int = 128) -> None:
        super().__init__(observation_space, features_dim)
        self.patches = torch.nn.Conv2d(observation_space.shape[0], 16, 4, stride=4)
        self.layers = torch.nn.Sequential(
            torch.nn.ReLU(),
            torch.nn.Conv2d(16, 16, 3, stride=2),
            torch.nn.ReLU(),
            torch.nn.Flatten(),
            torch.nn.Linear(16 * 10 * 10, features_dim),
            torch.nn.ReLU(),
        )

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        patches = self.patches
        seen = torch.nn.functional.conv2d(observations, patches.weight / 255.0, patches.bias, patches.stride)
        return self.layers(seen)


def stack_of_shape(shape: tuple[int, ...]) -> int:
    """The number of state observations in observations of this shape: see `AirHockeyEnv`'s `stack`; 0 for others."""
    stack = shape[0] if len(shape) == 2 else 1
    return stack if stack <= MOST_STACK and shape == observation_shape(stack) else 0
