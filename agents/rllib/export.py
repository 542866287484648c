"""From the weights of an RLlib agent to a policy that plays without torch and Ray."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from airhockey_env.opponents.policy import MlpPolicy

HIDDEN, LAST = "encoder.actor_encoder.net.mlp.", "pi.net.mlp."
"""Where RLlib's default module for PPO keeps the layers of its policy, if it shares none with the value network."""


def export_policy(weights: Mapping[str, Any], activation: str) -> MlpPolicy:
    """Convert the policy of RLlib's default module for PPO, with `vf_share_layers=False`.

    The result is the deterministic policy. RLlib clips its actions as it does.

    Args:
        weights: of one module, from `algorithm.get_weights`.
        activation: "relu" or "tanh", the module's `fcnet_activation`.

    Raises:
        ValueError: it is another module.
    """
    arrays = {name: np.asarray(value, np.float32) for name, value in weights.items()}
    parts = []
    for prefix in (HIDDEN, LAST):
        names = [name[: -len(".weight")] for name in arrays if name.startswith(prefix) and name.endswith(".weight")]
        parts += sorted(names, key=lambda name: int(name.rpartition(".")[2]))
    if not parts or not parts[-1].startswith(LAST):
        raise ValueError(f"weights must have the layers {HIDDEN}* and {LAST}*, got {sorted(arrays)}")
    layers = [(arrays[f"{part}.weight"], arrays[f"{part}.bias"]) for part in parts]
    weight, bias = layers.pop()
    layers.append((weight[:2], bias[:2]))  # the means; the logarithms of the deviations follow
    return MlpPolicy([one for one, _ in layers], [one for _, one in layers], activation)
