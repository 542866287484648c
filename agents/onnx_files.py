"""Policies as ONNX files, for programs that play them without this package, and a check that they are the same."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from airhockey_env.actions import DIRECTIONS
from airhockey_env.cameras import ROBOTS
from airhockey_env.game import Game
from airhockey_env.kernel.observations import COLUMNS, SCALES
from airhockey_env.kernel.state import observation_shape
from airhockey_env.opponents.policy import MlpPolicy

OPSET, IR_VERSION = 13, 7
"""Versions of the operators and of the format: of 2020, so that old runtimes read the files too."""

INPUT, OUTPUT = "observations", "actions"
"""The names of the input, (N, 13) or (N, stack, 15), and of the output, (N, 2); both are float32."""

TOLERANCE = 1e-6
"""Greatest difference between the actions of a file and those of its policy, beyond the rounding of the latter."""

_TABLES, _STEPS = 64, 128
"""Tables and steps of the game whose observations the check takes."""


def check_onnx(what: str) -> None:
    """Raise DependencyNotInstalled if ONNX or its runtime is missing; `what` is the beginning of the message."""
    try:
        import onnx  # noqa: F401
        import onnxruntime  # noqa: F401
    except ImportError as error:
        raise DependencyNotInstalled(f'{what} the extra "onnx": pip install -e ".[onnx]"') from error


def to_onnx(policy: MlpPolicy) -> bytes:
    """The contents of an ONNX file with the network of a policy.

    Its metadata are `stack`, and `columns` and `scales`, separated by commas: the names of the columns of an
    observation, or of a row of a stack, and what each of them is divided by. Speeds are fields of a `TableSpec`.
    """
    from onnx import TensorProto, checker, helper, numpy_helper

    nodes: list[Any] = []
    constants: list[Any] = []

    def constant(name: str, value: Any) -> str:
        constants.append(numpy_helper.from_array(np.asarray(value), name))
        return name

    def add(kind: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        output = output or f"{kind.lower()}_{len(nodes)}"
        nodes.append(helper.make_node(kind, list(inputs), [output], **attributes))
        return output

    values = INPUT if policy.stack == 1 else add("Flatten", INPUT, axis=1)
    last = len(policy.weights) - 1
    for k, (weight, bias) in enumerate(zip(policy.weights, policy.biases, strict=True)):
        values = add("Gemm", values, constant(f"weight_{k}", weight), constant(f"bias_{k}", bias), transB=1)
        if k < last:
            values = add("Tanh" if policy.activation == "tanh" else "Relu", values)
    if policy.squash:
        values = add("Tanh", values)
    if policy.discrete:
        best = add("ArgMax", values, axis=1, keepdims=0)
        add("Gather", constant("directions", DIRECTIONS), best, axis=0, output=OUTPUT)
    else:
        limits = constant("least", np.float32(-1.0)), constant("greatest", np.float32(1.0))
        add("Clip", values, *limits, output=OUTPUT)
    graph = helper.make_graph(
        nodes,
        "policy",
        [helper.make_tensor_value_info(INPUT, TensorProto.FLOAT, ["N", *observation_shape(policy.stack)])],
        [helper.make_tensor_value_info(OUTPUT, TensorProto.FLOAT, ["N", 2])],
        constants,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    sent = ("sent_action_x", "sent_action_y") if policy.stack > 1 else ()
    scales = (*SCALES, *("paddle_speed" for _ in sent))
    helper.set_model_props(
        model, {"stack": str(policy.stack), "columns": ",".join((*COLUMNS, *sent)), "scales": ",".join(scales)}
    )
    checker.check_model(model)
    return bytes(model.SerializeToString())


def run_onnx(contents: bytes, observations: NDArray[np.float32]) -> NDArray[np.float32]:
    """The actions (N, 2) of an ONNX file for observations (N, 13) or (N, stack, 15), by ONNX Runtime."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1  # more take longer for a network of this size
    session = onnxruntime.InferenceSession(contents, options, providers=["CPUExecutionProvider"])
    return np.asarray(session.run([OUTPUT], {INPUT: observations})[0])


class Difference(NamedTuple):
    """How far the actions of a file are from those of its policy."""

    largest: float
    rounding: float
    """How far the policy's own are from those of the same network in double precision."""

    @property
    def is_rounding(self) -> bool:
        """Whether there is no more than rounding, of both, to see."""
        return self.largest <= TOLERANCE + 2.0 * self.rounding


def compare(contents: bytes, policy: MlpPolicy, observations: NDArray[np.float32]) -> Difference:
    """Compare an ONNX file with its policy on observations (N, 13) or (N, stack, 15).

    Observations in which two directions of a discrete policy have the same score, but for rounding, are left out.
    """
    outputs = _in_double_precision(policy, observations)
    if policy.discrete:
        second, best = np.sort(outputs, axis=1)[:, -2:].T
        clear = best - second > 1e-4 * np.abs(outputs).max()
        observations, exact = observations[clear], DIRECTIONS[outputs[clear].argmax(axis=1)]
    else:
        exact = outputs.clip(-1.0, 1.0)
    played, own = run_onnx(contents, observations), policy(observations)
    return Difference(*(float(np.abs(own - other).max(initial=0.0)) for other in (played, exact)))


def _in_double_precision(policy: MlpPolicy, observations: NDArray[np.float32]) -> NDArray[np.float64]:
    """The outputs of the network, before they are clipped."""
    values = observations.reshape(len(observations), -1).astype(np.float64)
    last = len(policy.weights) - 1
    for k, (weight, bias) in enumerate(zip(policy.weights, policy.biases, strict=True)):
        values = values @ weight.T.astype(np.float64) + bias
        if k < last:
            values = np.tanh(values) if policy.activation == "tanh" else np.maximum(values, 0.0)
    return np.tanh(values) if policy.squash else values


def random_observations(policy: MlpPolicy) -> NDArray[np.float32]:
    """Observations that are uniform in [-1, 1]."""
    shape = (_TABLES * _STEPS, *observation_shape(policy.stack))
    return np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)


def played_observations(policy: MlpPolicy) -> NDArray[np.float32]:
    """What the policy is shown when it plays against the striker through the cameras of robots."""
    shown: list[NDArray[np.float32]] = []

    def player(observations: NDArray[np.float32]) -> NDArray[np.float32]:
        shown.append(observations.copy())
        return policy(observations)

    player.stack = policy.stack  # type: ignore[attr-defined]
    game = Game(_TABLES, left=player, right="striker", camera=(ROBOTS, None))
    game.reset(seed=0)
    for _ in range(_STEPS):
        game.step()
    return np.concatenate(shown)
