"""Networks that are symmetric about the long axis of the table: to a mirrored observation they give a mirrored action.

The game is the same in a mirror that stands on that axis, so what an agent learns on one side holds on the other. A
network with this symmetry need not learn it twice (van der Pol et al., "MDP Homomorphic Networks: Group Symmetries in
Reinforcement Learning", NeurIPS 2020).

Here every hidden unit has a twin that sees the mirror image: the first unit of a layer and the last one, and so on.
That makes pairs of weights equal, up to their signs. They begin equal, and their gradients are averaged, so that an
optimizer that treats each weight alone keeps them so. In every other way the network is an ordinary one, and so are its
files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import torch
from torch import nn

from agents.features import RelativeFeatures

Mirror = Callable[[torch.Tensor], torch.Tensor]
"""Maps the weights of a layer to those with which it would give the same outputs in the mirrored world."""

_ACROSS = (1, 3, 5, 7, 9, 11)
"""The numbers of an observation that change their signs in the mirror: positions and velocities across the table."""

_ROW = torch.tensor([-1.0 if k in (*_ACROSS, 14) else 1.0 for k in range(15)])
"""The signs of an observation and, in a stack's row, of the action after it."""

_ACTION = torch.tensor([1.0, -1.0])

_TOLERANCE = 1e-4
"""Weights that differ by less count as equal: a processor may round the last few of many in another way."""


def make_symmetric(model: Any) -> None:
    """Make the random weights of a new PPO model with `RelativeFeatures` symmetric."""
    with torch.no_grad():
        for weight, mirror in _mirrors(model.policy):
            mean = 0.5 * (weight + mirror(weight))
            independent = weight.ndim == 2 and weight is not model.policy.log_std
            weight.copy_(mean * 2.0**0.5 if independent else mean)  # the mean of two random weights is smaller


def is_symmetric(model: Any) -> bool:
    """Whether a PPO model with `RelativeFeatures` has symmetric weights."""
    return all(
        torch.allclose(weight, mirror(weight), rtol=0.0, atol=_TOLERANCE) for weight, mirror in _mirrors(model.policy)
    )


def keep_symmetric(model: Any) -> None:
    """Let a model with symmetric weights have symmetric gradients from now on."""
    for weight, mirror in _mirrors(model.policy):
        weight.register_hook(lambda gradient, mirror=mirror: 0.5 * (gradient + mirror(gradient)))


def _mirrors(policy: Any) -> Iterator[tuple[torch.Tensor, Mirror]]:
    """The weights of the policy and the value network, and of the exploration, each with its mirror."""
    features = policy.features_extractor
    assert isinstance(features, RelativeFeatures)
    both, networks = features.matrix.device, policy.mlp_extractor
    for hidden, last, outputs in (
        (networks.policy_net, policy.action_net, _ACTION.to(both)),
        (networks.value_net, policy.value_net, torch.ones(1, device=both)),
    ):
        layers = [module for module in (*hidden, last) if isinstance(module, nn.Linear)]
        for layer in layers:
            signs = _signs(features.matrix) if layer is layers[0] else None
            yield from _of_layer(layer, signs, outputs if layer is layers[-1] else None)
    if policy.log_std.ndim == 2:  # gSDE has one for every unit of the last hidden layer
        yield policy.log_std, lambda spread: spread.flip(0)


def _of_layer(
    layer: nn.Linear, inputs: torch.Tensor | None, outputs: torch.Tensor | None
) -> Iterator[tuple[torch.Tensor, Mirror]]:
    """The weights and biases of a layer. Inputs and outputs have signs, unless they are hidden units."""

    def of_inputs(weight: torch.Tensor) -> torch.Tensor:
        return weight.flip(1) if inputs is None else weight * inputs

    def of_outputs(values: torch.Tensor) -> torch.Tensor:
        signs = outputs[:, None] if outputs is not None and values.ndim == 2 else outputs
        return values.flip(0) if signs is None else values * signs

    yield layer.weight, lambda weight: of_outputs(of_inputs(weight))
    yield layer.bias, of_outputs


def _signs(matrix: torch.Tensor) -> torch.Tensor:
    """The signs of the features in the mirror. Each is a sum of inputs with the same sign."""
    row = _ROW.to(matrix.device)
    inputs = row[:13] if matrix.shape[1] == 13 else row.repeat(matrix.shape[1] // len(row))
    return inputs[matrix.abs().argmax(dim=1)]
