"""A trained policy that plays without torch: the weights of a small network, and NumPy."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.files import replace
from airhockey_env.game import DIRECTIONS
from airhockey_env.records import OBSERVATION_SIZE

_ACTIVATIONS: dict[str, Callable[[NDArray[np.float32]], NDArray[np.float32]]] = {
    "tanh": np.tanh,
    "relu": lambda x: np.maximum(x, 0.0),
}


class MlpPolicy:
    """A deterministic policy: a fully connected network from state observations to actions.

    Args:
        weights: one (out, in) array a layer; the first takes the 13 observations, the last gives two target
            velocities (a continuous policy) or nine scores (a discrete one, which takes the highest).
        biases: one (out,) array a layer.
        activation: `"tanh"` or `"relu"`, between the layers.

    Raises:
        ValueError: the layers do not fit together, or hold what is no finite number.
    """

    def __init__(
        self, weights: Sequence[NDArray[np.float32]], biases: Sequence[NDArray[np.float32]], activation: str = "tanh"
    ) -> None:
        if not isinstance(activation, str) or activation not in _ACTIVATIONS:
            raise ValueError(f"activation must be one of {sorted(_ACTIVATIONS)}, got {activation!r}")
        self.weights, self.biases = _layers("weights", weights), _layers("biases", biases)
        if len(self.weights) != len(self.biases):
            raise ValueError(
                f"weights and biases must be as many, got {len(self.weights)} and {len(self.biases)} layers"
            )
        size = OBSERVATION_SIZE
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if weight.ndim != 2 or weight.shape[1] != size or bias.shape != weight.shape[:1]:
                raise ValueError(
                    f"layer {k} must have weights (n, {size}) and biases (n,), got {weight.shape} and {bias.shape}"
                )
            size = weight.shape[0]
        if size not in (2, len(DIRECTIONS)):
            raise ValueError(f"the last layer must have 2 or {len(DIRECTIONS)} outputs, got {size}")
        self.activation = activation

    def __call__(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (N, 2) in [-1, 1] for observations (N, 13)."""
        x = observations
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = _ACTIVATIONS[self.activation](x @ weight.T + bias)
        x = x @ self.weights[-1].T + self.biases[-1]
        return np.clip(x, -1.0, 1.0) if x.shape[1] == 2 else DIRECTIONS[x.argmax(axis=1)]

    def save(self, path: str | Path) -> None:
        """Write the weights to an .npz file; a file that is there already is replaced at once or not at all."""
        arrays: dict[str, Any] = {"activation": np.array(self.activation)}
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays[f"weight_{k}"], arrays[f"bias_{k}"] = weight, bias
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)
        replace(path, lambda part: part.write_bytes(buffer.getvalue()))

    @classmethod
    def load(cls, path: str | Path) -> MlpPolicy:
        """Read a policy that `save` wrote.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file does not hold a policy.
        """
        try:
            with Path(path).open("rb") as stream, np.load(stream, allow_pickle=False) as file:
                layers = range(sum(name.startswith("weight_") for name in file.files))
                weights = [file[f"weight_{k}"] for k in layers]
                biases = [file[f"bias_{k}"] for k in layers]
                return cls(weights, biases, str(file["activation"]))
        except FileNotFoundError:
            raise
        except Exception as error:  # whatever a damaged file makes of it
            raise ValueError(f"{path} does not hold a policy: {error}") from error


def _layers(name: str, arrays: Any) -> list[NDArray[np.float32]]:
    try:
        layers = [np.ascontiguousarray(array, np.float32) for array in arrays]
    except (TypeError, ValueError) as error:
        raise ValueError(
            f"{name} must be one array of numbers a layer, got {type(arrays).__name__}: {error}"
        ) from error
    if not layers or not all(np.isfinite(layer).all() for layer in layers):
        raise ValueError(f"{name} must be one array of finite numbers a layer, and some; got {len(layers)} layers")
    return layers
