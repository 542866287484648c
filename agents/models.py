"""Trained models: from Stable-Baselines3's files to policies that play."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from airhockey_env.players import NAMES
from airhockey_env.policy import MlpPolicy
from airhockey_env.trained import resolved


def export_policy(model: Any) -> MlpPolicy:
    """The deterministic policy of a Stable-Baselines3 PPO, A2C, SAC, TD3 or DDPG with an `MlpPolicy`, without torch.

    Raises:
        ValueError: its actions are clipped (SAC's with gSDE are), and its hidden layers are not rectified.
    """
    from torch import nn

    from agents.features import RelativeFeatures

    policy = model.policy
    actor = getattr(policy, "actor", None)
    if actor is None:  # actor and critic are one network
        layers, features = [*policy.mlp_extractor.policy_net, policy.action_net], policy.features_extractor
    else:  # TD3's layers are all in `mu`; SAC's `mu` is the last of them
        layers = [*getattr(actor, "latent_pi", ()), *(actor.mu if isinstance(actor.mu, nn.Sequential) else [actor.mu])]
        features = actor.features_extractor
    linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
    weights = [layer.weight.detach().numpy() for layer in linear]
    biases = [layer.bias.detach().numpy() for layer in linear]
    if isinstance(features, RelativeFeatures):
        weights[0] = weights[0] @ features.matrix.numpy()
    activation = "relu" if any(isinstance(layer, nn.ReLU) for layer in layers) else "tanh"
    if isinstance(clip := layers[-1], nn.Hardtanh):
        if activation != "relu":
            raise ValueError("policy must have rectified hidden layers to be exported with clipped actions, got tanh")
        # Two rectifiers clip: low + max(x - low, 0) - max(x - high, 0).
        low, high = np.float32(clip.min_val), np.float32(clip.max_val)
        one = np.eye(len(biases[-1]), dtype=np.float32)
        weights[-1:] = [np.concatenate([weights[-1]] * 2), np.concatenate([one, -one], axis=1)]
        biases[-1:] = [np.concatenate([biases[-1] - low, biases[-1] - high]), np.full(len(one), low)]
    return MlpPolicy(weights, biases, activation, squash=actor is not None)


def load_player(model: str, option: str = "MODEL") -> MlpPolicy | str:
    """What a MODEL argument means.

    Args:
        model: an opponent's name, a run's folder, a `policy.npz` or a `model.zip`.
        option: what the error about one that is none of these calls the argument.

    Raises:
        FileNotFoundError: there is no such file or name.
        ValueError: the file holds no policy of this environment.
    """
    if model in NAMES:
        return resolved(model)
    path = Path(model)
    if path.is_dir():
        path = path / "policy.npz"
    if not path.exists():
        raise FileNotFoundError(
            f"{option} must be one of {sorted(NAMES)}, a run's folder, a policy.npz or a model.zip; "
            f"{model!r} is none of these"
        )
    if path.suffix != ".zip":
        return MlpPolicy.load(path)
    try:
        return export_policy(load_ppo(path))
    except AttributeError as error:  # another kind of network
        raise ValueError(f"{path} does not hold a PPO model of this environment: {error}") from error


def short_name(model: str) -> str:
    """What tables and plots call a MODEL: an opponent's name, the run's folder, or a file's name."""
    path = Path(model)
    return path.parent.name if path.name in ("policy.npz", "model.zip") and path.parent.name else path.name or model


def load_ppo(path: Path, env: Any = None) -> Any:
    """A Stable-Baselines3 PPO model. Its file holds pickles, which can run code: open only files you trust.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file does not hold such a model.
    """
    from stable_baselines3 import PPO

    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    if not zipfile.is_zipfile(path):
        raise ValueError(f"{path} does not hold a PPO model of this environment: it is not a zip file, or was cut off")
    try:
        return PPO.load(path, env=env, device="cpu")
    except Exception as error:  # whatever a damaged file makes of zip, pickle and torch
        raise ValueError(f"{path} does not hold a PPO model of this environment: {error}") from error
