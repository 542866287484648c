"""Units of a policy network that are set by hand: they bring the paddle home while the puck is away.

An agent that stays where it has shot from loses its goal to whoever returns the puck at once, and one that goes along
with a puck at a side wall loses it to a shot across the table. Most opponents do neither, so agents learn to come back
late or never, and others that train against them find out (docs/exploitability.md). With these units an agent comes
back from the start: what it learns is added to them, and training does not change them.

They are ordinary ReLU units, so that such a policy is exported, saved and played like any other.
"""

from __future__ import annotations

import torch
from stable_baselines3 import PPO
from torch import nn

from agents.features import RelativeFeatures, stack_of_shape
from agents.training.start import policy_layers
from airhockey_env.kernel.state import OBSERVATION_SIZE, ROW_SIZE
from airhockey_env.tables import TableSpec

HOME_LENGTH, HOME_WIDTH = 0.3, 0.25
"""Home reaches so far from the goal line, in half lengths, and so far off the long axis, in half widths."""

AWAY_SECONDS = 0.08
"""The puck is away if it would be on the far side after this time, at the velocity that it has. One that is on the far
side, but will be back by then, is not."""

PULL = 400.0
"""The change of a target velocity for each half length or half width that the paddle is outside home, as a share of its
greatest speed. Learned velocities are clipped only after it has been added: agents reach 7, and kept a paddle outside
with a pull of 25."""

RELEASE = 100.0
"""A puck that is nearer than away by some distance frees a paddle that is outside home by up to this many times that
distance. It is large, so that a paddle can reach a puck that rests on its side close to the centre line."""

UNITS = 4, 3
"""The number of units in the first and in the second hidden layer: the last ones of each."""

FEWEST_UNITS = 8
"""The fewest units of a layer, so that some are left for what is learned."""


def add_home_units(model: PPO, spec: TableSpec) -> None:
    """Set the units of a model's policy network, in place of those that matter least or of such units.

    Args:
        model: a model with two hidden layers of `FEWEST_UNITS` ReLU units or more after `RelativeFeatures`.
        spec: the table on which it plays.
    """
    first, second, out = policy_layers(model)
    weights = _weights_of_observation(spec)
    features = model.policy.features_extractor
    assert isinstance(features, RelativeFeatures)
    inputs = features.matrix.shape[1]
    stack = stack_of_shape(model.observation_space.shape or ())
    newest = 0 if stack == 1 else inputs - ROW_SIZE  # the first number of the newest row
    rows = torch.zeros(UNITS[0], inputs)
    rows[:, newest : newest + OBSERVATION_SIZE] = weights[:, :-1]
    rows = features.weights_after(rows)
    with torch.no_grad():
        if not torch.allclose(first.weight[-UNITS[0] :].cpu(), rows, atol=1e-4):  # a policy file has rounded them
            _least_last(first, second)
            _least_last(second, out)
        first.weight[-UNITS[0] :], first.bias[-UNITS[0] :] = rows, weights[:, -1]
        second.weight[:, -UNITS[0] :], second.weight[-UNITS[1] :], second.bias[-UNITS[1] :] = 0.0, 0.0, 0.0
        second.weight[-UNITS[1] :, -UNITS[0] : -1] = torch.eye(3)  # forward, left and right of home,
        second.weight[-UNITS[1] :, -1] = -RELEASE  # and the nearness of the puck
        out.weight[:, -UNITS[1] :] = torch.tensor([[-PULL, 0.0, 0.0], [0.0, -PULL, PULL]])


def keep_home_units(model: PPO) -> None:
    """Let training leave the units as they are, by gradients of zero."""
    first, second, out = policy_layers(model)
    parameters = first.weight, first.bias, second.weight, second.bias, out.weight
    masks = [torch.ones_like(parameter) for parameter in parameters]
    masks[0][-UNITS[0] :], masks[1][-UNITS[0] :] = 0.0, 0.0
    masks[2][-UNITS[1] :], masks[2][:, -UNITS[0] :], masks[3][-UNITS[1] :] = 0.0, 0.0, 0.0
    masks[4][:, -UNITS[1] :] = 0.0
    for parameter, mask in zip(parameters, masks, strict=True):
        parameter.register_hook(lambda gradient, mask=mask: gradient * mask)


def _weights_of_observation(spec: TableSpec) -> torch.Tensor:
    """What the units in the first layer compute of an observation: (4, 14), the last numbers are biases.

    The paddle counts as further on in the direction of its velocity, by what it needs to stop at full speed, so that it
    does not run past home.
    """
    stop = 0.5 * spec.paddle_speed / spec.paddle_acceleration  # s; speed * stop is the distance at full speed
    along, across = 2.0 * stop * spec.paddle_speed / spec.length, 2.0 * stop * spec.paddle_speed / spec.width
    weights = torch.zeros(UNITS[0], OBSERVATION_SIZE + 1)
    forward, left, right, near = weights
    forward[[0, 2, -1]] = torch.tensor([1.0, along, 1.0 - HOME_LENGTH])
    left[[1, 3, -1]] = torch.tensor([1.0, across, -HOME_WIDTH])
    right[[1, 3, -1]] = torch.tensor([-1.0, -across, -HOME_WIDTH])
    near[[8, 10]] = torch.tensor([-1.0, -AWAY_SECONDS * 2.0 * spec.puck_speed / spec.length])
    return weights


def _least_last(layer: nn.Linear, following: nn.Linear) -> None:
    """Order the units between two layers by the sizes of their weights. The network computes the same as before."""
    size = torch.linalg.vector_norm(torch.cat([layer.weight, layer.bias[:, None]], dim=1), dim=1)
    order = torch.argsort(size * torch.linalg.vector_norm(following.weight, dim=0), descending=True)
    layer.weight[:], layer.bias[:], following.weight[:] = (
        layer.weight[order],
        layer.bias[order],
        following.weight[:, order],
    )
