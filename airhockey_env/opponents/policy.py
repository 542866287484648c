"""A trained policy that plays without torch: the weights of a small network, compiled.

A matrix product of a linear algebra library gives other last bits for other numbers of rows, and `tanh` other ones on
other machines. Here every sum has a fixed order, so that a policy plays the same game to the bit in every environment
and batch.
"""

from __future__ import annotations

import dataclasses
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.actions import DIRECTIONS
from airhockey_env.checks import check_choice, check_stack
from airhockey_env.compiled import compiled, inlined
from airhockey_env.files import read_arrays, replace
from airhockey_env.kernel.state import observation_shape
from airhockey_env.opponents.foresight import FORESEEN_SIZE, table_of, with_foresight
from airhockey_env.tables import FIELDS, TableSpec

ACTIVATIONS = ("tanh", "relu")

MOST_BYTES = 64 * 2**20
"""The greatest size of an unpacked file: sixteen million weights."""

LANES = 64
"""Rows that go through the network side by side."""

FEWEST_LANES = 24
"""Fewer rows than this take less time one by one."""

# A rational function that is tanh to float32's precision: the coefficients of Eigen's `ptanh` (MathFunctionsImpl.h).
_TANH_END = np.float32(7.90531110763549805)
_ODD = tuple(
    np.float32(c)
    for c in (
        -2.76076847742355e-16, 2.00018790482477e-13, -8.60467152213735e-11, 5.12229709037114e-08,
        1.48572235717979e-05, 6.37261928875436e-04, 4.89352455891786e-03,
    )
)  # fmt: skip
_EVEN = tuple(
    np.float32(c) for c in (1.19825839466702e-06, 1.18534705686654e-04, 2.26843463243900e-03, 4.89352518554385e-03)
)


@inlined
def _tanh(x):
    x = _TANH_END if x > _TANH_END else x
    x = -_TANH_END if x < -_TANH_END else x
    x2 = x * x
    odd, even = _ODD[0], _EVEN[0]
    odd = odd * x2 + _ODD[1]
    odd = odd * x2 + _ODD[2]
    odd = odd * x2 + _ODD[3]
    odd = odd * x2 + _ODD[4]
    odd = odd * x2 + _ODD[5]
    odd = odd * x2 + _ODD[6]
    even = even * x2 + _EVEN[1]
    even = even * x2 + _EVEN[2]
    even = even * x2 + _EVEN[3]
    return x * odd / even


@inlined
def _activate(values, use_tanh):
    """Apply the function between the layers to `values`, in place."""
    if use_tanh:
        for k in range(len(values)):
            values[k] = _tanh(values[k])
    else:
        for k in range(len(values)):
            values[k] = values[k] if values[k] > np.float32(0.0) else np.float32(0.0)


@inlined
def _add_products(a, b, c):
    """Add the matrix product of a and b to c, (M, N), each number as c + a[m, 0] * b[0, n] + a[m, 1] * b[1, n] + ...

    Four products are added before a sum is written back, which takes most of the time otherwise.
    """
    inner = len(b)
    fours = inner // 4 * 4
    for m in range(c.shape[0]):
        for k in range(0, fours, 4):
            x, y, z, w = a[m, k], a[m, k + 1], a[m, k + 2], a[m, k + 3]
            for n in range(c.shape[1]):
                c[m, n] = c[m, n] + x * b[k, n] + y * b[k + 1, n] + z * b[k + 2, n] + w * b[k + 3, n]
        for k in range(fours, inner):
            x = a[m, k]
            for n in range(c.shape[1]):
                c[m, n] += x * b[k, n]


@inlined
def _forward_row(i, observations, parameters, sizes, use_tanh, squash, one, other, out):
    """Run the network for row i; in one and other, (widest layer,), there is room for the numbers of two layers."""
    for k in range(sizes[0]):
        one[k] = observations[i, k]
    last = sizes.shape[0] - 2
    at = 0
    for layer in range(last + 1):
        n_in, n_out = sizes[layer], sizes[layer + 1]
        weights, at = parameters[at : at + n_in * n_out].reshape(n_in, n_out), at + n_in * n_out
        bias, at = parameters[at : at + n_out], at + n_out
        for j in range(n_out):
            other[j] = bias[j]
        _add_products(one[:n_in].reshape(1, n_in), weights, other[:n_out].reshape(1, n_out))
        if layer < last:
            _activate(other[:n_out], use_tanh)
        one, other = other, one
    for j in range(out.shape[1]):
        out[i, j] = _tanh(one[j]) if squash else one[j]


@inlined
def _forward_rows(first, rows, observations, parameters, sizes, use_tanh, squash, one, other, out):
    """Run the network for `rows` rows from `first` on, at most LANES, with the same sums as `_forward_row`.

    In one and other, (widest layer, LANES), the numbers of all rows stand side by side, so that the processor adds many
    of them at once. LANES is a constant: the compiler has to know how long a row of these arrays is.
    """
    for k in range(sizes[0]):
        for lane in range(rows):
            one[k, lane] = observations[first + lane, k]
    last = sizes.shape[0] - 2
    at = 0
    for layer in range(last + 1):
        n_in, n_out = sizes[layer], sizes[layer + 1]
        weights, at = parameters[at : at + n_in * n_out].reshape(n_in, n_out), at + n_in * n_out
        bias, at = parameters[at : at + n_out], at + n_out
        for j in range(n_out):
            for lane in range(LANES):
                other[j, lane] = bias[j]
        _add_products(weights.T, one[:n_in], other[:n_out])
        if layer < last:
            for j in range(n_out):
                _activate(other[j], use_tanh)
        one, other = other, one
    for j in range(out.shape[1]):
        for lane in range(rows):
            out[first + lane, j] = _tanh(one[j, lane]) if squash else one[j, lane]


@compiled
def _forward(observations, parameters, sizes, use_tanh, squash, out):
    """Run the network. A row's results are the same to the bit, however many rows there are.

    Args:
        observations: (N, sizes[0]) float32.
        parameters: (P,) float32: for one layer after the other, the weights (in, out) and the biases (out,).
        sizes: (layers + 1,) int64, units of every layer, the inputs first.
        use_tanh: between the layers; else the greater of x and 0.
        squash: whether the outputs go through tanh.
        out: (N, sizes[-1]) float32; written.
    """
    n, widest = observations.shape[0], sizes.max()
    done = 0
    if n >= FEWEST_LANES:
        one, other = np.zeros((widest, LANES), np.float32), np.zeros((widest, LANES), np.float32)
        while n - done >= FEWEST_LANES:
            block = min(LANES, n - done)
            _forward_rows(done, block, observations, parameters, sizes, use_tanh, squash, one, other, out)
            done += block
    if done < n:
        here, there = np.empty(widest, np.float32), np.empty(widest, np.float32)
        for i in range(done, n):
            _forward_row(i, observations, parameters, sizes, use_tanh, squash, here, there, out)


class MlpPolicy:
    """A deterministic policy: a fully connected network from state observations to actions.

    Args:
        weights: one (out, in) array a layer; the first takes the 13 numbers of an observation, or the 15 of each row of
            a stack, from the oldest row on, and with foresight 30 more; the last gives two target velocities (a
            continuous policy) or nine scores (a discrete one, which takes the highest).
        biases: one (out,) array a layer.
        activation: `"tanh"` or `"relu"`, between the layers.
        squash: whether the outputs go through tanh, as those of SAC and TD3 do; else they are clipped to [-1, 1].
        stack: how many observations it is shown at once, 1 to 64: as the argument `stack` of the environments.
        foresight: a table, if the network also sees what can be foreseen there, such as where the puck crosses its goal
            line: see `airhockey_env.opponents.foresight`. None for a network that sees observations alone.

    Attributes:
        discrete: whether it takes one of nine directions.

    Raises:
        ValueError: the layers do not fit together, or hold what is no finite number; `stack` is out of range; or there
            is a stack together with foresight.
    """

    def __init__(
        self,
        weights: Sequence[NDArray[np.float32]],
        biases: Sequence[NDArray[np.float32]],
        activation: str = "tanh",
        squash: bool = False,
        stack: int = 1,
        foresight: TableSpec | None = None,
    ) -> None:
        self.stack: int = check_stack("stack", stack)
        if foresight is not None and self.stack > 1:
            raise ValueError(f"stack must be 1 with foresight, got {self.stack}")
        self.foresight: TableSpec | None = foresight
        self._table = None if foresight is None else table_of(foresight)
        self._shape = observation_shape(self.stack)
        self.activation: str = check_choice("activation", activation, ACTIVATIONS)
        self.weights: list[NDArray[np.float32]]
        self.biases: list[NDArray[np.float32]]
        self.weights, self.biases = _layers("weights", weights), _layers("biases", biases)
        if len(self.weights) != len(self.biases):
            raise ValueError(
                f"weights and biases must be of the same number, got {len(self.weights)} and {len(self.biases)}"
            )
        size = inputs = math.prod(self._shape) + (0 if foresight is None else FORESEEN_SIZE)
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if weight.ndim != 2 or weight.shape[1] != size or bias.shape != weight.shape[:1]:
                raise ValueError(
                    f"layer {k} must have weights (n, {size}) and biases (n,), got {weight.shape} and {bias.shape}"
                )
            size = weight.shape[0]
        if size not in (2, len(DIRECTIONS)):
            raise ValueError(f"the last layer must have 2 or {len(DIRECTIONS)} outputs, got {size}")
        self.discrete: bool = size != 2
        self.squash: bool = bool(squash)
        self._sizes = np.array([inputs, *(len(bias) for bias in self.biases)])
        layers = zip(self.weights, self.biases, strict=True)
        self._parameters = np.concatenate([part for weight, bias in layers for part in (weight.T.ravel(), bias)])

    def __call__(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (N, 2) in [-1, 1] for observations (N, 13), or (N, stack, 15).

        Raises:
            ValueError: the observations have another shape.
        """
        if observations.shape[1:] != self._shape:
            shown = ", ".join(map(str, self._shape))
            raise ValueError(f"observations must be of shape (N, {shown}), got {observations.shape}")
        out = np.empty((len(observations), 2), np.float32)
        self.act(observations, out)
        return out

    def act(self, observations: NDArray[np.float32], out: NDArray[np.float32]) -> None:
        """Write the actions for observations (N, 13), or (N, stack, 15), into out, (N, 2).

        Several threads may do this at once.
        """
        n = len(observations)
        scores = np.empty((n, self._sizes[-1]), np.float32)
        rows = self.inputs(observations)
        _forward(rows, self._parameters, self._sizes, self.activation == "tanh", self.squash, scores)
        if self.discrete:
            out[:] = DIRECTIONS[scores.argmax(axis=1)]
        else:
            np.clip(scores, -1.0, 1.0, out=out)

    def inputs(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """What the first layer takes, (N, inputs), for observations (N, 13), or (N, stack, 15)."""
        if self._table is not None:
            return with_foresight(observations, self._table)
        return observations.reshape(len(observations), self._sizes[0])

    def save(self, path: str | Path) -> None:
        """Write the weights to an .npz file; a file that is there already is replaced at once or not at all."""
        arrays: dict[str, Any] = {name: np.array(getattr(self, name)) for name in ("activation", "squash", "stack")}
        if self.foresight is not None:
            arrays["foresight"] = np.array(dataclasses.astuple(self.foresight))
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
            arrays = read_arrays(path, "MlpPolicy.save", ("activation", "weight_0", "bias_0"), MOST_BYTES)
            layers = range(sum(name.startswith("weight_") for name in arrays))
            weights = [arrays[f"weight_{k}"] for k in layers]
            biases = [arrays[f"bias_{k}"] for k in layers]
            activation = arrays["activation"]
            squash, stack = arrays.get("squash", np.False_), arrays.get("stack", np.int64(1))  # old files have neither
            foresight = arrays.get("foresight")
            if foresight is not None and (foresight.dtype.kind != "f" or foresight.shape != (len(FIELDS),)):
                raise ValueError(f"foresight must be the {len(FIELDS)} numbers of a table")
            table = None if foresight is None else TableSpec(*foresight.tolist())
            kinds = "".join(array.dtype.kind for array in (*weights, *biases))
            if activation.dtype.kind != "U" or squash.dtype.kind != "b" or activation.shape or squash.shape:
                raise ValueError("activation must be a string and squash a bool")
            if stack.dtype.kind not in "iu" or stack.shape:
                raise ValueError("stack must be a whole number")
            if kinds.strip("f"):
                raise ValueError("weights and biases must be floating-point numbers")
            return cls(weights, biases, str(activation), bool(squash), int(stack), table)
        except FileNotFoundError:
            raise
        except Exception as error:  # whatever a damaged file makes of it
            raise ValueError(f"{path} does not hold a policy: {error}") from error


def _layers(name: str, arrays: Any) -> list[NDArray[np.float32]]:
    """Copies: weights that come from a model under training go on changing."""
    try:
        with np.errstate(over="ignore"):  # what float32 cannot hold is refused below
            layers = [np.array(array, np.float32, order="C") for array in arrays]
    except (TypeError, ValueError) as error:
        given = f"{type(arrays).__name__}: {error}"
        raise ValueError(f"{name} must be arrays of numbers, one for each layer, got {given}") from error
    if not layers or not all(np.isfinite(layer).all() for layer in layers):
        given = "numbers that are not finite" if layers else "none"
        raise ValueError(f"{name} must be one or more arrays of finite numbers, one for each layer, got {given}")
    return layers
