"""Cameras: what they do to the observations, and that all wrappers do the same."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from airhockey_env.sensing.frames import SIGHT, draw_normal
from airhockey_env.sensing.sb3 import CameraSB3Observation
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import DelayObservation, FrameStackObservation, RescaleObservation
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecMonitor, VecNormalize

import airhockey_env  # noqa: F401
from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.sensing import ROBOT, Camera, CameraObservation, CameraVectorObservation, sense
from tests.helpers import COPIES, random_actions, same

DOCS = Path(__file__).parents[2] / "docs" / "sensing.md"
OTHER, PUCK = slice(4, 8), slice(8, 12)
NOT_SEEN_BY_CAMERA = [0, 1, 2, 3, 12]
STILL = np.zeros(2, np.float32)
HEAVY = Camera(
    camera_hz=77,
    delay_ms=33,
    jitter_ms=30,
    noise_mm=5,
    opponent_noise_mm=3,
    velocity_frames=3,
    dropout=0.2,
    occlusion_mm=300,
)
STACKS = {
    "robot": [ROBOT],
    "heavy": [HEAVY],
    "stack": [Camera(noise_mm=2), Camera(delay_ms=30, jitter_ms=20), Camera(camera_hz=20), Camera(velocity_frames=2)],
    "reversed": [
        Camera(velocity_frames=2),
        Camera(camera_hz=20),
        Camera(delay_ms=30, jitter_ms=20),
        Camera(noise_mm=2),
    ],
}
MODES = ["NextStep", "SameStep", "Disabled"]


def through(env, cameras):
    for camera in cameras:
        env = sense(env, camera)
    return env


def ideal(camera, control_hz=50, **arguments):
    """A table without loss whose opponent stays home: (with the camera, without)."""
    arguments = {"table": "ideal", "opponent": "idle", "control_hz": control_hz, **arguments}
    return sense(AirHockeyEnv(**arguments), camera), AirHockeyEnv(**arguments)


def shot(env, position=(-0.3, 0.1), velocity=(0.5, 0.2), steps=40, action=STILL, seed=0):
    """Observations of an episode that begins with a shot, the first included, without its end."""
    rows = [env.reset(seed=seed, options={"puck_position": position, "puck_velocity": velocity})[0]]
    for _ in range(steps):
        observation, _, terminated, _, _ = env.step(action)
        assert not terminated
        rows.append(observation)
    return np.array(rows)


# Values


@pytest.mark.parametrize(
    ("field", "given", "allowed"),
    [
        ("camera_hz", 0, "from 1 to 1000"),
        ("camera_hz", 1001, "from 1 to 1000"),
        ("camera_hz", "fast", "None or a number"),
        ("delay_ms", -1, "from 0 to 1000"),
        ("delay_ms", math.nan, "from 0 to 1000"),
        ("delay_ms", None, "from 0 to 1000"),
        ("jitter_ms", -1, "from 0 to 1000"),
        ("jitter_ms", 1, "delay_ms"),
        ("noise_mm", math.inf, "from 0 to 100"),
        ("noise_mm", True, "from 0 to 100"),
        ("opponent_noise_mm", -0.1, "from 0 to 100"),
        ("velocity_frames", 1, "from 2 to 64"),
        ("velocity_frames", 65, "from 2 to 64"),
        ("velocity_frames", 2.0, "from 2 to 64"),
        ("velocity_frames", True, "from 2 to 64"),
        ("dropout", 1.1, "from 0 to 1"),
        ("dropout", [0.5], "from 0 to 1"),
        ("occlusion_mm", -1, "from 0 to 1000"),
    ],
)
def test_bad_values_are_named(field, given, allowed):
    for make in (Camera, lambda **fields: CameraObservation(AirHockeyEnv(), **fields)):
        with pytest.raises(ValueError, match=field) as error:
            make(**{field: given})
        assert allowed in str(error.value) and repr(given) in str(error.value)


def test_every_field_is_checked_and_documented():
    fields = [field.name for field in dataclasses.fields(Camera)]
    checked = {mark.args[1][k][0] for mark in test_bad_values_are_named.pytestmark for k in range(len(mark.args[1]))}
    assert checked == set(fields)
    rows = re.findall(r"^\| `(\w+)` \|.* \| (\S+) \| (\S+) \|$", DOCS.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert [row[0] for row in rows] == fields
    for name, default, robot in rows:
        assert str(getattr(Camera(), name)).removesuffix(".0") == default
        assert str(getattr(ROBOT, name)).removesuffix(".0") == robot


def test_fields_are_frozen_numbers():
    camera = Camera(camera_hz=np.int64(60), delay_ms=np.float32(7), velocity_frames=np.int64(3))
    assert camera == Camera(camera_hz=60, delay_ms=7, velocity_frames=3)
    assert all(type(value) in (float, int) for value in camera.fields().values())
    with pytest.raises(dataclasses.FrozenInstanceError):
        camera.delay_ms = 3
    with pytest.raises(TypeError, match="blur"):
        CameraObservation(AirHockeyEnv(), blur=1)


def test_environments_that_a_camera_cannot_look_at():
    with pytest.raises(TypeError, match="AirHockeyEnv"):
        sense(gym.make("CartPole-v1"), ROBOT)
    with pytest.raises(TypeError, match="AirHockeyVectorEnv"):
        sense(gym.make_vec("CartPole-v1", num_envs=2), ROBOT)
    with pytest.raises(ValueError, match="state observations"):
        sense(RescaleObservation(AirHockeyEnv(), np.float32(0), np.float32(1)), ROBOT)
    with pytest.raises(ValueError, match="state observations"):
        sense(AirHockeyEnv(obs_type="rgb"), ROBOT)
    for wrong in (None, "Robot", Camera, {"blur": 1.0}, 3):
        with pytest.raises(ValueError, match=r"^camera must be "):
            sense(AirHockeyEnv(), wrong)


@pytest.mark.parametrize("camera", [ROBOT, HEAVY], ids=["robot", "heavy"])
def test_a_camera_by_its_name_or_its_fields(camera):
    given = [camera, camera.fields(), *(["robot"] if camera is ROBOT else [])]
    for make in (AirHockeyEnv, lambda: AirHockeyVectorEnv(2), lambda: AirHockeySB3VecEnv(2)):
        assert [sense(make(), one).camera for one in given] == [camera] * len(given)
    with pytest.raises(ValueError, match=r"^delay_ms must be "):
        sense(AirHockeyEnv(), {"delay_ms": -1})


# What a camera does


@pytest.mark.parametrize("camera", [Camera(), Camera(camera_hz=50), Camera(camera_hz=500)], ids=str)
def test_a_perfect_camera_changes_nothing(camera):
    single, alone = sense(AirHockeyEnv(opponent="random"), camera), AirHockeyEnv(opponent="random")
    assert same(single.reset(seed=1), alone.reset(seed=1))
    for action in random_actions(0, 400, 1)[:, 0]:
        results = single.step(action), alone.step(action)
        assert same(*results)
        if results[0][2]:
            assert same(single.reset(), alone.reset())


@pytest.mark.parametrize("cameras", STACKS.values(), ids=STACKS)
def test_what_is_not_the_cameras_passes(cameras):
    arguments = {"num_envs": 50, "max_episode_steps": 60}
    envs, alone = through(gym.make_vec("AirHockey-v0", **arguments), cameras), gym.make_vec("AirHockey-v0", **arguments)
    assert same(envs.reset(seed=1)[0][:, NOT_SEEN_BY_CAMERA], alone.reset(seed=1)[0][:, NOT_SEEN_BY_CAMERA])
    for actions in random_actions(0, 150, 50):
        seen, *rest = envs.step(actions)
        true, *expected = alone.step(actions)
        assert seen in envs.observation_space
        assert same(seen[:, NOT_SEEN_BY_CAMERA], true[:, NOT_SEEN_BY_CAMERA])
        assert same(rest[:3], expected[:3])


@pytest.mark.parametrize(("delay_ms", "steps"), [(0.1, 1), (7, 1), (20, 1), (20.5, 2), (40, 2), (100, 5), (1000, 50)])
def test_delay_counts_in_whole_steps_rounded_up(delay_ms, steps):
    env, alone = ideal(Camera(delay_ms=delay_ms))
    seen, true = shot(env, steps=60), shot(alone, steps=60)
    expected = np.vstack([np.repeat(true[:1], steps, axis=0), true[:-steps]])
    assert same(seen[:, 4:12], expected[:, 4:12])
    assert same(seen[:, NOT_SEEN_BY_CAMERA], true[:, NOT_SEEN_BY_CAMERA])


def test_delay_is_gymnasiums_for_what_the_camera_sees():
    env, other = sense(AirHockeyEnv(), Camera(delay_ms=60)), DelayObservation(AirHockeyEnv(), 3)
    env.reset(seed=3), other.reset(seed=3)
    for k in range(60):
        seen, expected = env.step(STILL)[0], other.step(STILL)[0]
        if k >= 2:
            assert same(seen[4:12], expected[4:12])


@pytest.mark.parametrize(
    ("camera_hz", "frames"),
    [(25, [0, 0, 2, 2, 4, 4]), (10, [0] * 5 + [5] * 5 + [10]), (12.5, [0, 0, 0, 0, 4]), (1, [0] * 50 + [50])],
)
def test_slow_cameras_hold_frames(camera_hz, frames):
    env, alone = ideal(Camera(camera_hz=camera_hz))
    seen, true = shot(env, steps=len(frames) - 1), shot(alone, steps=len(frames) - 1)
    assert same(seen[:, 4:12], true[frames][:, 4:12])


@pytest.mark.parametrize(("velocity", "steps"), [((0.3, 2.9), 60), ((-3.0, 5.3), 20), ((0.0, 0.0), 5)])
def test_frames_between_control_steps(velocity, steps):
    """A camera that looks at the middle of every step sees what an environment of twice the rate plays then."""
    env, _ = ideal(Camera(camera_hz=100, delay_ms=10))
    _, fast = ideal(Camera(), control_hz=100)
    seen = shot(env, velocity=velocity, steps=steps)[1:]
    true = shot(fast, velocity=velocity, steps=2 * steps)[1::2]
    assert len(seen) == len(true)
    np.testing.assert_allclose(seen[:, 4:12], true[:, 4:12], atol=2e-6)


def test_frames_between_control_steps_with_drag():
    arguments = {"table": "full_size", "opponent": "idle"}
    env = sense(AirHockeyEnv(**arguments), Camera(camera_hz=100, delay_ms=10))
    fast = AirHockeyEnv(control_hz=100, **arguments)
    seen = shot(env, position=(-0.5, 0.0), velocity=(10.0, 0.0), steps=5)[1:]
    true = shot(fast, position=(-0.5, 0.0), velocity=(10.0, 0.0), steps=10)[1::2]
    assert np.abs(seen[:, 8] - true[:, 8]).max() * 0.5 * fast.table.length < 0.2e-3


def test_age_of_what_a_fast_camera_shows():
    """The delay and the wait since the last frame."""
    camera = Camera(camera_hz=120, delay_ms=7)
    env, alone = ideal(camera)
    seen = shot(env, velocity=(1.0, 0.0), steps=50)[2:]
    true = shot(alone, velocity=(1.0, 0.0), steps=50)[2:]
    ages = (true[:, 8].astype(float) - seen[:, 8]) * 0.5 * alone.table.length * 1e3  # mm at 1 m/s: ms
    assert ages.min() > 7 - 1e-3 and ages.max() < 7 + 1000 / 120 + 1e-3
    assert ages.max() - ages.min() > 5


def test_jitter_changes_the_age_and_keeps_the_order():
    env, alone = ideal(Camera(camera_hz=240, delay_ms=30, jitter_ms=25), control_hz=240)
    seen = shot(env, velocity=(0.2, 0.0), steps=400)
    true = shot(alone, velocity=(0.2, 0.0), steps=400)
    ages = (true[:, 8].astype(float) - seen[:, 8]) * 0.5 * alone.table.length / 0.2 * 1e3
    assert ages[50:].min() > 5 - 0.1 and ages[50:].max() < 55 + 1000 / 240 + 0.1
    assert len(np.unique(ages[50:].round(1))) > 3
    assert (np.diff(seen[:, 8]) >= 0).all()


def test_noise_is_gaussian_in_mm():
    n = 4000
    envs = AirHockeyVectorEnv(n, opponent="idle")
    camera = Camera(noise_mm=2, opponent_noise_mm=0.5)
    true = envs.reset(seed=0)[0]
    seen = sense(envs, camera).reset(seed=0)[0]
    half = 0.5 * np.array([envs.table.length, envs.table.width]) * 1e3
    for column, sigma in ((8, 2.0), (4, 0.5)):
        errors = (seen[:, column : column + 2].astype(float) - true[:, column : column + 2]) * half / sigma
        assert abs(errors.mean()) < 0.05
        assert errors.std(axis=0) == pytest.approx([1, 1], abs=0.05)
        assert (errors**4).mean() == pytest.approx(3, abs=0.4)
        assert abs(np.corrcoef(errors.T)[0, 1]) < 0.06
        assert same(seen[:, column + 2 : column + 4], true[:, column + 2 : column + 4])


def test_the_normal_distribution():
    sight = np.zeros(1, SIGHT).view(np.recarray)[0]
    draws = np.array([draw_normal(sight) for _ in range(100_000)])
    assert draws.mean() == pytest.approx(0, abs=0.02)
    assert draws.std() == pytest.approx(1, abs=0.02)
    for edge in (0.25, 1.0, 2.0, 3.0, 3.7):
        share = math.erfc(edge / math.sqrt(2))
        assert (np.abs(draws) > edge).mean() == pytest.approx(share, abs=4 * math.sqrt(share / len(draws)))
    assert len(np.unique(draws)) > 99_990


def test_noise_cannot_leave_the_space():
    envs = sense(AirHockeyVectorEnv(500), Camera(noise_mm=100, opponent_noise_mm=100, velocity_frames=2))
    observations, _ = envs.reset(seed=0)
    for actions in random_actions(0, 30, 500):
        assert observations in envs.observation_space
        observations = envs.step(actions)[0]
    assert (np.abs(observations[:, 4:12]) == 1).any()


@pytest.mark.parametrize("frames", [2, 3, 6, 64])
@pytest.mark.parametrize("camera_hz", [None, 20, 120])
def test_velocities_from_positions_without_noise(frames, camera_hz):
    env, alone = ideal(Camera(velocity_frames=frames, camera_hz=camera_hz))
    seen, true = shot(env), shot(alone)
    assert (seen[0, [6, 7, 10, 11]] == 0).all()
    np.testing.assert_allclose(seen[3:, 10:12], true[3:, 10:12], atol=1e-5)
    assert (seen[:, 6:8] == 0).all()


@pytest.mark.parametrize("frames", [2, 6])
def test_noise_of_velocities_is_as_documented(frames):
    n = 2000
    envs = sense(AirHockeyVectorEnv(n, opponent="idle"), Camera(noise_mm=1, velocity_frames=frames))
    envs.reset(seed=0)
    for _ in range(frames):
        observations = envs.step(np.zeros((n, 2)))[0]
    deviation = observations[:, 10:12].std() * envs.unwrapped.table.puck_speed
    assert deviation == pytest.approx(1e-3 * 50 * math.sqrt(12 / (frames * (frames**2 - 1))), rel=0.05)


def test_dropout():
    env, alone = ideal(Camera(dropout=1))
    seen, true = shot(env), shot(alone)
    assert same(seen[:, 4:12], np.repeat(true[:1, 4:12], len(true), axis=0))
    env, _ = ideal(Camera(dropout=0.3), control_hz=240)
    seen, true = shot(env, steps=600), shot(_, steps=600)
    fresh = (seen[1:, PUCK] == true[1:, PUCK]).all(axis=1)
    assert fresh.mean() == pytest.approx(0.7, abs=0.06)
    held = (seen[1:, PUCK] == seen[:-1, PUCK]).all(axis=1)
    assert (fresh | held).all()


def test_occlusion_near_the_opponents_paddle():
    camera = Camera(occlusion_mm=150)
    env, alone = ideal(camera)
    arguments = {"position": (0.3, 0.3), "velocity": (1.0, -0.4), "steps": 70}
    seen, true = shot(env, **arguments), shot(alone, **arguments)
    half = 0.5 * np.array([alone.table.length, alone.table.width])
    distances = np.linalg.norm((true[:, 8:10] - true[:, 4:6]) * half, axis=1)
    hidden = distances < 0.15 + alone.table.puck_radius + alone.table.paddle_radius
    assert 5 < hidden.sum() < 60
    assert same(seen[~hidden], true[~hidden])
    last = 0
    for k in range(len(true)):
        last = k if not hidden[k] else last
        assert same(seen[k, PUCK], true[last, PUCK])
    assert same(seen[:, OTHER], true[:, OTHER])


@pytest.mark.parametrize("control_hz", [10, 47.3, 240])
@pytest.mark.parametrize(
    "camera",
    [
        Camera(camera_hz=1000, delay_ms=1000, jitter_ms=1000, velocity_frames=64, dropout=0.5),
        Camera(camera_hz=1, delay_ms=1000, jitter_ms=1000, velocity_frames=2),
        Camera(camera_hz=59.94, delay_ms=16.683, jitter_ms=16.683, velocity_frames=5, noise_mm=1),
        Camera(delay_ms=1000, jitter_ms=1000, occlusion_mm=1000),
    ],
    ids=["fast", "slow", "odd", "late"],
)
def test_frames_are_never_lost_on_their_way(camera, control_hz):
    envs = sense(AirHockeyVectorEnv(8, control_hz=control_hz, max_episode_steps=-1), camera)
    observations, _ = envs.reset(seed=0)
    memory = envs._sight._memory
    most = 0
    for actions in random_actions(0, 300, 8):
        observations = envs.step(actions)[0]
        assert observations in envs.observation_space
        most = max(most, memory.sights["waiting"].max())
        late = (camera.delay_ms + camera.jitter_ms) * 1e-3 * control_hz
        oldest = memory.queue[np.arange(8), memory.sights["first"], 0]
        waiting = memory.sights["waiting"] > 0
        assert (memory.sights["step"] - oldest <= late + 1e-6)[waiting].all()
    assert most < memory.queue.shape[1]


# The same through all wrappers


def play_alone(cameras, seed, actions, arguments):
    """What one table shows: (observation, whether its episode begins with it) for every step and reset."""
    env = through(AirHockeyEnv(**arguments), cameras)
    rows = [(env.reset(seed=seed)[0], True)]
    for action in actions:
        observation, _, terminated, truncated, _ = env.step(action)
        rows.append((observation, False))
        if terminated or truncated:
            rows.append((env.reset()[0], True))
    return rows


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("cameras", STACKS.values(), ids=STACKS)
def test_rows_of_a_batch_are_single_tables(mode, cameras):
    n, steps, arguments = 5, 200, {"opponent": "random", "max_episode_steps": 40}
    actions = random_actions(1, steps, n)
    envs = through(AirHockeyVectorEnv(n, autoreset_mode=mode, **arguments), cameras)
    rows = [[(row, True)] for row in envs.reset(seed=11)[0]]
    played = [[] for _ in range(n)]
    over = np.zeros(n, bool)
    for k in range(steps):
        observations, _, terminated, truncated, infos = envs.step(actions[k])
        for i in range(n):
            begins = mode == "NextStep" and over[i]
            if not begins:
                played[i].append(actions[k, i])
            if mode == "SameStep" and (terminated | truncated)[i]:
                rows[i].append((infos["final_obs"][i], False))
                begins = True
            rows[i].append((observations[i], bool(begins)))
        over = terminated | truncated
        if mode == "Disabled" and over.any():
            kept = observations.copy()
            observations, _ = envs.reset(options={"reset_mask": over})
            assert same(observations[~over], kept[~over])
            for i in np.flatnonzero(over):
                rows[i].append((observations[i], True))
    for i in range(n):
        expected = play_alone(cameras, 11 + i, played[i], arguments)
        assert sum(begins for _, begins in rows[i]) > 4
        assert same(rows[i], expected[: len(rows[i])])


@pytest.mark.parametrize("arguments", [{"opponent": "random"}, {"randomize": {"length": (2.0, 2.6)}}], ids=str)
@pytest.mark.parametrize("cameras", STACKS.values(), ids=STACKS)
def test_stable_baselines_batch_is_the_same_step_batch(cameras, arguments):
    n, arguments = 5, {"max_episode_steps": 40, **arguments}
    envs = through(AirHockeyVectorEnv(n, autoreset_mode="SameStep", **arguments), cameras)
    sb3 = through(AirHockeySB3VecEnv(n, **arguments), cameras)
    ended = 0
    for seed in (11, None):
        if seed is not None:
            sb3.seed(seed)
        assert same(sb3.reset(), envs.reset(seed=seed)[0])
        for actions in random_actions(1, 100, n):
            seen, _, dones, infos = sb3.step(actions)
            expected, _, terminated, truncated, details = envs.step(actions)
            assert same((seen, dones), (expected, terminated | truncated))
            for i in np.flatnonzero(dones):
                assert same(infos[i]["terminal_observation"], details["final_obs"][i])
                ended += 1
    assert ended > n


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_copies_of_a_stable_baselines_batch_go_on_the_same(copied):
    sb3 = through(AirHockeySB3VecEnv(4, max_episode_steps=25), [HEAVY, ROBOT])
    sb3.seed(0)
    sb3.reset()
    for actions in random_actions(0, 60, 4):
        sb3.step(actions)
    other = copied(sb3)
    for actions in random_actions(1, 60, 4):
        assert same(other.step(actions), sb3.step(actions))


def test_stable_baselines_wrappers_around_cameras_and_inside():
    sb3 = VecFrameStack(sense(VecMonitor(AirHockeySB3VecEnv(3, max_episode_steps=9)), ROBOT), 4)
    assert sb3.reset().shape == (3, 52)
    for _ in range(9):
        *_, infos = sb3.step(np.zeros((3, 2), np.float32))
    assert [info["episode"]["l"] for info in infos] == [9, 9, 9]
    assert infos[0]["terminal_observation"].shape == (52,)
    assert isinstance(sb3.venv, CameraSB3Observation) and sb3.venv.camera == ROBOT
    with pytest.raises(ValueError, match="inside of VecNormalize"):
        sense(VecNormalize(AirHockeySB3VecEnv(3)), ROBOT)
    with pytest.raises(ValueError, match="state observations"):
        sense(AirHockeySB3VecEnv(3, obs_type="rgb"), ROBOT)
    with pytest.raises(TypeError, match="AirHockeySB3VecEnv"):
        sense(DummyVecEnv([AirHockeyEnv]), ROBOT)
    fresh = sense(AirHockeySB3VecEnv(3), ROBOT)
    fresh.venv.reset()
    with pytest.raises(ResetNeeded, match="through the camera"):
        fresh.step(np.zeros((3, 2)))


def test_the_size_of_the_batch_does_not_matter():
    large, small = sense(AirHockeyVectorEnv(3000), ROBOT), sense(AirHockeyVectorEnv(2), ROBOT)
    assert same(large.reset(seed=5)[0][:2], small.reset(seed=5)[0])
    for actions in random_actions(0, 30, 3000):
        assert same(large.step(actions)[0][:2], small.step(actions[:2])[0])


def test_same_step_copies_are_the_callers():
    envs = sense(AirHockeyVectorEnv(3, autoreset_mode="SameStep", max_episode_steps=4), ROBOT)
    envs.reset(seed=0)
    for _ in range(4):
        observations, *_, infos = envs.step(np.zeros((3, 2)))
    kept = observations.copy(), [one.copy() for one in infos["final_obs"]]
    envs.step(np.zeros((3, 2)))
    assert same(kept, (observations, list(infos["final_obs"])))


def test_memories_end_with_their_episode():
    """Nothing of the old episode is on its way, or in the estimate of a velocity, when the next has begun."""
    env = sense(AirHockeyEnv(opponent="idle"), Camera(delay_ms=200, velocity_frames=6))
    shot(env, velocity=(1.0, 0.5), steps=10)
    place = {"puck_position": (-0.4, 0.0), "puck_velocity": (0.0, 0.0)}
    first = env.reset(options=place)[0]
    for _ in range(30):
        assert same(env.step(STILL)[0][PUCK], first[PUCK])
    assert (first[10:12] == 0).all()


# Seeds and streams


def test_seeds():
    env = sense(AirHockeyEnv(opponent="goalie"), HEAVY)

    def play(seed):
        return [env.reset(seed=seed)[0], *(env.step(STILL)[0] for _ in range(50)), env.reset()[0]]

    first = play(3)
    assert same(first, play(3))
    assert not same(first, play(4))
    unseeded = [sense(AirHockeyEnv(), Camera(noise_mm=50)).reset(options={"puck_position": (-0.3, 0)})[0] for _ in "ab"]
    assert not same(*unseeded)


def test_resets_without_a_seed_go_on():
    env, place = sense(AirHockeyEnv(), Camera(noise_mm=5)), {"puck_position": (-0.3, 0.0)}
    starts = [env.reset(seed=3, options=place)[0], *(env.reset(options=place)[0] for _ in range(9))]
    assert len({start.tobytes() for start in starts}) == 10


def test_seeds_of_some_tables():
    envs, single = sense(AirHockeyVectorEnv(3), ROBOT), sense(AirHockeyEnv(), ROBOT)
    envs.reset(seed=[5, 6, 7])
    single.reset(seed=6)
    assert same(envs.reset(seed=[2**70, None, 8])[0][1], single.reset()[0])
    mask = np.array([False, True, False])
    assert same(envs.reset(seed=[1, 2, 3], options={"reset_mask": mask})[0][1], single.reset(seed=2)[0])


def test_each_camera_has_a_stream_of_its_own():
    env, place = AirHockeyEnv(), {"puck_position": (-0.3, 0.0)}
    true = env.reset(seed=3, options=place)[0]
    once, both = sense(env, Camera(noise_mm=5)), through(env, [Camera(noise_mm=5)] * 2)
    first = once.reset(seed=3, options=place)[0] - true
    second = both.reset(seed=3, options=place)[0] - true - first
    assert not np.allclose(first[8:10], second[8:10])
    assert np.abs(second[8:10]).min() > 0


def test_noise_does_not_change_the_game():
    env, alone = sense(AirHockeyEnv(opponent="random"), HEAVY), AirHockeyEnv(opponent="random")
    env.reset(seed=2), alone.reset(seed=2)
    for action in random_actions(0, 60, 1)[:, 0]:
        env.step(action), alone.step(action)
        assert same(env.unwrapped.get_state(), alone.get_state())


# Conventions


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("mode", MODES[:2])
def test_copies_of_a_batch_go_on_the_same(copied, mode):
    envs = through(AirHockeyVectorEnv(4, autoreset_mode=mode, max_episode_steps=25), [HEAVY, ROBOT])
    envs.reset(seed=0)
    for actions in random_actions(0, 60, 4):
        envs.step(actions)
    other = copied(envs)

    def go_on(which):
        return [which.step(actions)[:4] for actions in random_actions(1, 60, 4)], which.reset()[0]

    assert same(go_on(other), go_on(envs))


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_copies_of_a_table_go_on_the_same(copied):
    env = through(gym.make("AirHockey-v0"), [HEAVY, ROBOT])
    env.reset(seed=0)
    for _ in range(20):
        env.step(STILL)
    other = copied(env)
    assert same([other.step(STILL)[:4] for _ in range(60)], [env.step(STILL)[:4] for _ in range(60)])
    assert same(other.reset()[0], env.reset()[0])


@pytest.mark.parametrize("cameras", STACKS.values(), ids=STACKS)
def test_checker_has_no_complaint(cameras):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*is different from the unwrapped version.*")  # which is the point
        env = through(AirHockeyEnv(render_mode="rgb_array", render_size=(64, 48)), cameras)
        check_env(env, skip_render_check=True)
        env = through(gym.make("AirHockey-v0"), cameras)
        check_env(env, skip_render_check=True)


def test_the_specification_makes_the_same_environment():
    env = through(gym.make("AirHockey-v0", opponent="goalie"), [ROBOT, Camera(delay_ms=20)])
    spec = gym.envs.registration.EnvSpec.from_json(env.spec.to_json())
    again = gym.make(spec)
    assert same(again.reset(seed=3)[0], env.reset(seed=3)[0])
    assert same([again.step(STILL)[0] for _ in range(30)], [env.step(STILL)[0] for _ in range(30)])


def test_gymnasiums_wrappers_around_cameras():
    env = FrameStackObservation(sense(gym.make("AirHockey-v0"), ROBOT), 3)
    assert env.reset(seed=0)[0].shape == (3, 13)
    for around in (
        lambda envs: sense(RecordEpisodeStatistics(envs), ROBOT),
        lambda envs: RecordEpisodeStatistics(sense(envs, ROBOT)),
    ):
        envs = around(gym.make_vec("AirHockey-v0", num_envs=3, max_episode_steps=9))
        envs.reset(seed=0)
        for _ in range(9):
            *_, infos = envs.step(envs.action_space.sample())
        assert infos["episode"]["l"].tolist() == [9, 9, 9]


def test_steps_need_a_reset_through_the_wrapper():
    env, envs = AirHockeyEnv(), AirHockeyVectorEnv(2)
    env.reset(seed=0), envs.reset(seed=0)
    single, batch = sense(env, ROBOT), sense(envs, ROBOT)
    for one, action in ((single, STILL), (batch, np.zeros((2, 2)))):
        state = one.unwrapped.get_state()
        with pytest.raises(ResetNeeded):
            one.step(action)
        assert same(one.unwrapped.get_state(), state)
    batch.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ResetNeeded):
        batch.step(np.zeros((2, 2)))
    batch.reset(options={"reset_mask": np.array([False, True])})
    batch.step(np.zeros((2, 2)))


def test_bad_input_changes_nothing():
    for make, good, bad in (
        (lambda: sense(AirHockeyEnv(), HEAVY), STILL, [math.nan, 0]),
        (lambda: sense(AirHockeyVectorEnv(2), HEAVY), np.zeros((2, 2)), np.zeros(3)),
    ):
        one, other = make(), make()
        one.reset(seed=0), other.reset(seed=0)
        for _ in range(20):
            with pytest.raises(ValueError, match="action"):
                one.step(bad)
            with pytest.raises(ValueError, match="seed"):
                one.reset(seed=-1)
            with pytest.raises(ValueError, match="options must be a mapping"):
                one.reset(options=[1])
            with pytest.raises(ValueError, match="options"):
                one.reset(options={"serve": "up"})
            assert same(one.step(good)[0], other.step(good)[0])


def test_the_vector_wrapper_is_the_vector_wrapper():
    envs = sense(gym.make_vec("AirHockey-v0", num_envs=2), ROBOT)
    assert isinstance(envs, CameraVectorObservation) and envs.camera == ROBOT
    assert envs.num_envs == 2 and envs.spec.id == "AirHockey-v0"
    assert envs.observation_space == envs.unwrapped.observation_space
    assert isinstance(sense(gym.make("AirHockey-v0"), ROBOT), CameraObservation)
    envs.close()


def test_examples_of_the_documentation():
    blocks = re.findall(r"^```python\n(.*?)^```", DOCS.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    assert len(blocks) == 5
    exec(compile("\n".join(blocks), str(DOCS), "exec"), {})


@pytest.mark.skipif("randomize" not in inspect.signature(AirHockeyEnv).parameters, reason="not there")
@pytest.mark.parametrize("mode", MODES[:2])
def test_randomized_tables(mode):
    """The scales of the observation are each table's own, and change with the episode."""
    arguments = {"randomize": {"length": (2.0, 2.6), "puck_radius": (0.03, 0.045)}, "max_episode_steps": 20}
    envs = AirHockeyVectorEnv(50, autoreset_mode=mode, **arguments)
    alone = AirHockeyVectorEnv(50, autoreset_mode=mode, **arguments)
    envs = sense(envs, Camera())
    assert same(envs.reset(seed=0)[0], alone.reset(seed=0)[0])
    for actions in random_actions(0, 100, 50):
        assert same(envs.step(actions)[0], alone.step(actions)[0])
