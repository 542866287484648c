"""Start a run with the network of another run, or with a trained policy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from torch import nn

from agents.features import ForesightFeatures, RelativeFeatures, stack_of_shape
from agents.sb3_files import read_model
from agents.training.runs import RunFolder
from airhockey_env.opponents.foresight import FORESEEN_SIZE
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.trained import TRAINED, trained_policy

START_HELP = (
    "Begin with the network of this run (its folder, or its name under runs/), or with the policy of a policy.npz or "
    f"of {' or '.join(TRAINED)}, instead of shooting practice."
)

STRONGEST = "expert"
"""The strongest player that ships."""

KINDS = {
    "scratch": "from an untrained network, as train_ppo does",
    "own": "from the player's own network, if its inputs and layers are like those of train_ppo",
    STRONGEST: f"from {STRONGEST}, the strongest player that ships",
}
"""The kinds of best responses: where their training begins."""


def take_over(model: PPO, start: str) -> None:
    """Copy a network into a new model, except for its exploration noise.

    The network of a run includes its value network. A policy has none, so the model's own value network, which is
    untrained, remains.

    Args:
        start: a run's folder or its name under runs/, the path of a policy.npz, or a name in `TRAINED`.

    Raises:
        FileNotFoundError: there is no such run or file.
        ValueError: the networks differ in shape, or the file is damaged.
    """
    try:
        if start in TRAINED or Path(start).suffix == ".npz":
            policy = _read_policy(start)
            _check_foresight(policy.foresight is not None, model, start)
            _copy_policy(policy, model)
        else:
            _copy_network(RunFolder.open(start, "--start"), model)
    except RuntimeError as error:
        raise ValueError(f"--start must have hidden layers of --net-width units, got {start!r}") from error


def _read_policy(start: str) -> MlpPolicy:
    try:
        return trained_policy(start) if start in TRAINED else MlpPolicy.load(start)
    except FileNotFoundError as error:
        raise FileNotFoundError(f"--start must be a run, a trained player or its file; there is no {start}") from error


def can_start(policy: MlpPolicy) -> bool:
    """Whether training can start with a policy: its inputs and layers must be those of `train_ppo` by default."""
    widths = [len(bias) for bias in policy.biases]
    layers = widths[2:] == [2] and widths[0] == widths[1]
    return policy.stack == 1 and policy.activation == "relu" and not policy.squash and layers


def policy_layers(model: PPO) -> list[nn.Linear]:
    """The layers of the policy network, the one that gives the actions last."""
    policy: Any = model.policy
    return [m for m in (*policy.mlp_extractor.policy_net, policy.action_net) if isinstance(m, nn.Linear)]


def _copy_network(folder: RunFolder, model: PPO) -> None:
    network = {**read_model(folder.model).params["policy"], "log_std": model.policy.log_std}
    foresees = "features_extractor.table" in network
    _check_foresight(foresees, model, str(folder.path))
    if not foresees and isinstance(model.policy.features_extractor, ForesightFeatures):
        for name in ("mlp_extractor.policy_net.0.weight", "mlp_extractor.value_net.0.weight"):
            network[name] = nn.functional.pad(network[name], (0, FORESEEN_SIZE))  # it ignores what it did not have
        network |= {name: own for name, own in model.policy.state_dict().items() if "features_extractor" in name}
    model.policy.load_state_dict(network)


def _check_foresight(foresees: bool, model: PPO, start: str) -> None:
    """Raise ValueError if a network with foresight would begin a model that has none."""
    if foresees and not isinstance(model.policy.features_extractor, ForesightFeatures):
        raise ValueError(f"--foresight must be on for --start {start}, which has foresight")


def _copy_policy(policy: MlpPolicy, model: PPO) -> None:
    """Copy the weights of a policy, in which the features are part of the first layer."""
    features = model.policy.features_extractor
    assert isinstance(features, RelativeFeatures)
    layers = policy_layers(model)
    if policy.activation != "relu" or policy.squash or len(policy.weights) != len(layers):
        raise ValueError(
            f"--start must be a policy with {len(layers) - 1} hidden layers of ReLU units and clipped outputs"
        )
    assert isinstance(model.observation_space, spaces.Box)
    stack = stack_of_shape(model.observation_space.shape)
    if policy.stack != stack:
        raise ValueError(f"--stack must be {policy.stack}, as in --start, got {stack}")
    width = len(policy.biases[0])
    if width != layers[0].out_features:
        raise ValueError(f"--net-width must be {width}, as in --start, got {layers[0].out_features}")
    weights = [torch.as_tensor(weight) for weight in policy.weights]
    weights[0] = features.weights_after(weights[0])
    for layer, weight, bias in zip(layers, weights, policy.biases, strict=True):
        layer.load_state_dict({"weight": weight, "bias": torch.as_tensor(bias)})
