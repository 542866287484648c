"""The controller of a robot: what it makes of a camera's frames is what the environment makes of them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from airhockey_env import LEFT, AirHockeyEnv, MlpPolicy
from airhockey_env.cameras import CAMERAS, Camera
from airhockey_env.controller import Controller
from airhockey_env.kernel.camera import OTHER, SHOWS_PUCK, STATES, TAKEN, THE_PUCK
from airhockey_env.kernel.state import SHOT_CLOCK, observation_shape
from airhockey_env.tables import CHALLENGE
from tests.helpers import HEAVY, INF, NAN, shown

SPACING = 2.0**-24
"""Between neighbouring numbers of float32 just below 1: two numbers that are all but equal round to no others."""


class Frame(NamedTuple):
    """What a camera sends."""

    time: float  # s, when it was taken
    puck: NDArray[np.float64] | None
    opponent: NDArray[np.float64]


def camera_of(env: AirHockeyEnv) -> Any:
    part = env._game.interfaces[LEFT].camera
    assert part is not None
    return part.arrays


def first_frame(env: AirHockeyEnv) -> Frame:
    """What the camera saw at the start of an episode."""
    seen = camera_of(env).states[0]["seen"]
    return Frame(0.0, seen[THE_PUCK, :2].copy(), seen[OTHER, :2].copy())


def arrived(env: AirHockeyEnv, first: int, control_hz: float) -> Iterator[Frame]:
    """The frames that arrived in the last step, in order.

    Args:
        first: place in the camera's queue, before the step, of the frame that arrives next.
        control_hz: of the environment.
    """
    arrays = camera_of(env)
    queue = arrays.queue[0]
    while first != arrays.states[0]["first"]:
        row = queue[first]
        other, puck = row[STATES : STATES + 2].copy(), row[STATES + 4 : STATES + 6].copy()
        yield Frame(row[TAKEN] / control_hz, puck if row[SHOWS_PUCK] else None, other)
        first = (first + 1) % len(queue)


def network(stack: int) -> MlpPolicy:
    """A policy that moves to and fro and uses all that it is shown."""
    rng = np.random.default_rng(stack)
    size = math.prod(observation_shape(stack))
    weights = [rng.normal(size=(32, size)) / math.sqrt(size), rng.normal(size=(2, 32)) / 4.0]
    return MlpPolicy(weights, [rng.normal(size=32), np.zeros(2)], stack=stack)


@pytest.mark.parametrize("stack", [1, 5])
@pytest.mark.parametrize(
    ("camera", "control_hz"),
    [(CAMERAS["robot"], 50.0), (CAMERAS["slow"], 50.0), (HEAVY, 50.0), (CAMERAS["robot"], 120.0)],
    ids=shown,
)
def test_it_plays_what_the_environment_plays(camera: Camera, control_hz: float, stack: int) -> None:
    """It is fed with what the simulated camera saw, and its actions are played."""
    policy = network(stack)
    env = AirHockeyEnv(camera=camera, stack=stack, control_hz=control_hz, table="challenge", max_episode_steps=1500)
    assert isinstance(camera.velocity_frames, int)
    controller = Controller(policy, "challenge", camera.velocity_frames)
    hidden, lost, same, steps = 0, 0, 0, 0
    for seed in range(8):
        observation, _ = env.reset(seed=seed)
        controller.reset()
        frames, over, taken = [first_frame(env)], False, [0.0]
        while not over:
            for frame in frames:
                controller.see(*frame)
                hidden += frame.puck is None
            row = observation if stack == 1 else observation[-1]
            clock = float(row[12]) * SHOT_CLOCK
            command = controller.act(env.positions[LEFT], env.velocities[LEFT], clock)
            expected = policy(observation[np.newaxis])[0]
            assert controller.observation is not None
            assert controller.observation.shape == observation.shape and controller.observation.dtype == np.float32
            np.testing.assert_allclose(controller.observation, observation, rtol=0, atol=SPACING)
            np.testing.assert_allclose(command.action, expected, rtol=0, atol=1e-6)
            same += np.array_equal(controller.observation, observation)
            steps += 1
            first = int(camera_of(env).states[0]["first"])
            observation, _, terminated, truncated, _ = env.step(command.action)
            over = terminated or truncated
            frames = list(arrived(env, first, control_hz))
            taken += [frame.time for frame in frames]
        lost += round(taken[-1] * float(camera.camera_hz or 0)) + 1 - len(taken)
    assert steps > 500 and same > 0.999 * steps
    assert hidden > 0 and lost > 0


def test_the_velocity_is_the_action_at_the_speed_of_the_paddle() -> None:
    table = CHALLENGE
    for action in ((0.3, -0.4), (1.0, 1.0), (-3.0, 0.0)):
        controller = Controller(lambda seen, action=action: [action], table)
        controller.see(0.0, (0.1, 0.0), (0.5, 0.0))
        command = controller.act((-0.8, 0.0), (0.0, 0.0))
        clipped = np.clip(action, -1.0, 1.0)
        np.testing.assert_allclose(command.action, clipped, rtol=1e-6)
        speed = table.paddle_speed * min(1.0, float(np.hypot(*clipped)))
        assert math.isclose(np.hypot(*command.velocity), speed, rel_tol=1e-6)
        assert math.isclose(np.arctan2(*command.velocity), np.arctan2(*clipped), rel_tol=1e-6)


def test_what_was_not_found_keeps_its_position_and_velocity() -> None:
    controller = Controller("adept")
    controller.see(10.0, (0.10, 0.02), (0.5, 0.0))
    controller.see(10.1, (0.20, 0.00), (0.5, 0.1))
    before = controller.act((-0.8, 0.0), (0.0, 0.0)), controller.observation
    for lost in (None, (NAN, NAN), np.full(2, NAN), (0.3, NAN)):
        controller.see(controller._time + 0.1, lost, None)
        again = controller.act((-0.8, 0.0), (0.0, 0.0)), controller.observation
        np.testing.assert_array_equal(again[1], before[1])
        np.testing.assert_array_equal(again[0].action, before[0].action)
    assert before[1] is not None
    np.testing.assert_allclose(before[1][10:12] * 12.0, (1.0, -0.2), rtol=1e-6)
    np.testing.assert_allclose(before[1][6:8] * 5.0, (0.0, 1.0), rtol=1e-6)


def test_a_serve_forgets_what_was_before() -> None:
    rows = []
    for before in (0, 3):
        controller = Controller(network(4), velocity_frames=3)
        for k in range(before):
            controller.see(0.1 * k, (0.1 * k, 0.0), (0.5, 0.1 * k))
            controller.act((-0.8, 0.0), (0.0, 0.0))
        controller.reset()
        assert not controller.ready and controller.observation is None
        controller.see(0.0, (0.1, 0.2), (0.6, 0.0))
        controller.act((-0.9, 0.1), (0.0, 0.5), 1.0)
        rows.append(controller.observation)
    np.testing.assert_array_equal(*rows)
    assert rows[0] is not None and (rows[0] == rows[0][-1]).all() and not rows[0][:, 13:].any()


def test_it_waits_until_both_were_seen() -> None:
    controller = Controller("expert")
    for time, puck, opponent in ((0.0, None, None), (0.1, (0.0, 0.0), None)):
        controller.see(time, puck, opponent)
        assert not controller.ready
        with pytest.raises(RuntimeError, match="puck"):
            controller.act((-0.8, 0.0), (0.0, 0.0))
    controller.see(0.2, None, (0.5, 0.0))
    assert controller.ready
    assert np.isfinite(controller.act((-0.8, 0.0), (0.0, 0.0)).velocity).all()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("policy", value) for value in ("striker", "nobody", 3, None, "none.npz")),
        *(("table", value) for value in ("pool", 3, {"length": 2.0})),
        *(("velocity_frames", value) for value in (1, 65, 6.0, None)),
    ],
    ids=shown,
)
def test_what_it_is_made_of_is_checked(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=f"^{name} must be "):
        Controller(**{"policy": "adept", name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("time", value) for value in (NAN, INF, 1.0, 0.5, "2", None)),
        *(("puck", value) for value in ((0.0, INF), (0.0,), (0.0, 0.0, 0.0), 0.0, "seen", True)),
        *(("opponent", value) for value in ((0.0, -INF), [[0.0, 0.0]])),
        *(("position", value) for value in ((NAN, 0.0), None, (0.0, 0.0, 0.0))),
        *(("velocity", value) for value in ((0.0, INF), "still")),
        *(("clock", value) for value in (NAN, 7.1, -7.1, None)),
    ],
    ids=shown,
)
def test_wrong_arguments_are_named_and_change_nothing(name: str, value: object) -> None:
    controller, other = Controller("adept"), Controller("adept")
    for one in (controller, other):
        one.see(1.0, (0.0, 0.1), (0.5, 0.0))
        one.act((-0.8, 0.0), (0.0, 0.0))
    see: dict[str, Any] = {"time": 2.0, "puck": (0.1, 0.1), "opponent": (0.5, 0.1)}
    act: dict[str, Any] = {"position": (-0.8, 0.0), "velocity": (0.0, 0.0), "clock": 0.5}
    with pytest.raises(ValueError, match=f"^{name} must be .*got {re.escape(repr(value))}"):
        controller.see(**{**see, name: value}) if name in see else controller.act(**{**act, name: value})
    for one in (controller, other):
        one.see(**see)
        one.act(**act)
    np.testing.assert_array_equal(controller.observation, other.observation)


@pytest.mark.parametrize("answer", [[0.0, 0.0], [[NAN, 0.0]], None, [[0.0]]], ids=shown)
def test_what_a_policy_returns_is_checked(answer: object) -> None:
    controller = Controller(lambda seen: answer)  # type: ignore[arg-type, return-value]
    controller.see(0.0, (0.0, 0.1), (0.5, 0.0))
    with pytest.raises(ValueError, match="policy"):
        controller.act((-0.8, 0.0), (0.0, 0.0))
