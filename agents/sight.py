"""A network that estimates the state of the game from pictures: it looks where they differ from the empty table."""

from __future__ import annotations

import functools

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from torch import nn

from agents.features import RelativeFeatures
from airhockey_env.drawing.pixels import SIZE, Pixels
from airhockey_env.kernel.parameters import make_parameters
from airhockey_env.kernel.state import OBSERVATION_SIZE
from airhockey_env.tables import FULL_SIZE, TableSpec

PATCH = 4
"""Width and height of a patch, px. As bytes, a row of a patch is one int32, which makes comparing quick."""

PATCHES = SIZE // PATCH
"""Patches in a row or column of a picture."""

_CHANGE_SCALE = 4.0
"""Factor on the changes from one picture to the next, which are small."""


class Centres(nn.Module):
    """Centres of what is on pictures: stacks of K grey pictures (N, K, 84, 84) to features (N, 3 * width * K).

    A picture is cut into patches of 4 x 4 pixels. Those that show the empty table are left out, which are more than
    nine in ten. The others go through the same two layers, each with its position, and each output weighs the patches.
    The features are the sum of its weights and the two coordinates of their centre, as in Finn et al., "Deep spatial
    autoencoders for visuomotor learning" (ICRA 2016): what has been learned about a disc in one place holds everywhere.
    They are given for the newest picture, and for each older one as changes from it to the next.

    Args:
        spec: the table, without its discs, is what the pictures are compared with.
        width: number of centres.
    """

    empty: torch.Tensor

    def __init__(self, spec: TableSpec, width: int) -> None:
        super().__init__()
        self.weigh = nn.Sequential(nn.Linear(PATCH**2 + 2, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU())
        picture = Pixels("grayscale").background(make_parameters(spec, 50.0)).reshape(SIZE, SIZE)
        self.register_buffer("empty", torch.tensor(picture))

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        """The features of pictures, uint8."""
        rows = pictures.contiguous().view(torch.int32).view(-1, PATCHES, PATCH, PATCHES)
        empty = self.empty.view(torch.int32).view(PATCHES, PATCH, PATCHES)
        # any() along a short axis that is not the last takes several times as long
        changed = functools.reduce(torch.logical_or, (rows != empty).unbind(2))
        number, i, j = changed.nonzero(as_tuple=True)
        patches, plain = (part.contiguous().view(torch.uint8) for part in (rows[number, i, :, j], empty[i, :, j]))
        differences = (patches.float() - plain.float()) / 128.0
        x, y = ((2.0 / (PATCHES - 1) * index.float() - 1.0)[:, None] for index in (j, i))
        weights = self.weigh(torch.cat([differences, x, y], dim=1))
        parts = torch.stack([weights, weights * x, weights * y], dim=1)
        total, *moments = parts.new_zeros(len(rows), *parts.shape[1:]).index_add(0, number, parts).unbind(1)
        centres = [moment / (total + 0.01) for moment in moments]  # 0.01: a picture may have no such patch
        seen = torch.cat([0.1 * total, *centres], dim=1).view(*pictures.shape[:2], -1)
        return torch.cat([_CHANGE_SCALE * seen.diff(dim=1), seen[:, -1:]], dim=1).flatten(1)


class StateFromPictures(BaseFeaturesExtractor):
    """An estimate of the state from grey pictures; its outputs are the `RelativeFeatures` of the estimate, (N, 17).

    Pictures may be bytes, which is quickest, or the same numbers in another type. Use `normalize_images=False` in the
    policy.
    """

    def __init__(
        self, observation_space: spaces.Box, spec: TableSpec = FULL_SIZE, width: int = 64, hidden: int = 128
    ) -> None:
        relative = RelativeFeatures(spaces.Box(-1.0, 1.0, (OBSERVATION_SIZE,), np.float32), spec)
        super().__init__(observation_space, relative.features_dim)
        self.centres = Centres(spec, width)
        self.state = nn.Sequential(
            nn.Linear(3 * width * observation_space.shape[0], hidden), nn.ReLU(), nn.Linear(hidden, OBSERVATION_SIZE)
        )
        self.relative = relative

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        return self.relative(self.state(self.centres(observations.to(torch.uint8))))
