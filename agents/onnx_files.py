"""Policies as ONNX files, for programs that play them without this package, and a check that they are the same."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from agents.onnx_graph import IR_VERSION, OPSET, Column, Graph
from airhockey_env.actions import DIRECTIONS
from airhockey_env.cameras import ROBOTS
from airhockey_env.game import Game
from airhockey_env.kernel.observations import COLUMNS, SCALES
from airhockey_env.kernel.state import OBSERVATION_SIZE, observation_shape
from airhockey_env.opponents.foresight import FORESEEN_SIZE, foresee, table_of
from airhockey_env.opponents.policy import MlpPolicy

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
    from onnx import TensorProto, checker, helper

    graph = Graph()
    values = INPUT if policy.stack == 1 else graph.add("Flatten", INPUT, axis=1)
    if policy.foresight is not None:
        foreseen: dict[int, Column] = {}
        foresee(graph.columns(INPUT, OBSERVATION_SIZE), table_of(policy.foresight), foreseen)
        joined = graph.add("Concat", *(foreseen[k].name for k in range(FORESEEN_SIZE)), axis=1)
        values = graph.add("Concat", INPUT, graph.add("Cast", joined, to=TensorProto.FLOAT), axis=1)
    last = len(policy.weights) - 1
    for k, (weight, bias) in enumerate(zip(policy.weights, policy.biases, strict=True)):
        parts = graph.constant(f"weight_{k}", weight), graph.constant(f"bias_{k}", bias)
        values = graph.add("Gemm", values, *parts, transB=1)
        if k < last:
            values = graph.add("Tanh" if policy.activation == "tanh" else "Relu", values)
    if policy.squash:
        values = graph.add("Tanh", values)
    if policy.discrete:
        best = graph.add("ArgMax", values, axis=1, keepdims=0)
        graph.add("Gather", graph.constant("directions", DIRECTIONS), best, axis=0, outputs=(OUTPUT,))
    else:
        limits = graph.constant("least", np.float32(-1.0)), graph.constant("greatest", np.float32(1.0))
        graph.add("Clip", values, *limits, outputs=(OUTPUT,))
    made = helper.make_graph(
        graph.nodes,
        "policy",
        [helper.make_tensor_value_info(INPUT, TensorProto.FLOAT, ["N", *observation_shape(policy.stack)])],
        [helper.make_tensor_value_info(OUTPUT, TensorProto.FLOAT, ["N", 2])],
        graph.constants,
    )
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
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
    values = policy.inputs(observations).astype(np.float64)
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
