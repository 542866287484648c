"""Pixel observations: what a picture shows, and that every batch and thread draws the same one."""

from __future__ import annotations

import dataclasses
import hashlib
import os
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import FrameStackObservation
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

from airhockey_env import PRESETS, AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.drawing import raster
from airhockey_env.game import Game
from airhockey_env.kernel.parameters import make_parameters
from airhockey_env.kernel.state import LEFT, RIGHT
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.tables import FULL_SIZE
from tests.helpers import pursue, random_actions, same, turned

pytestmark = [pytest.mark.filterwarnings("error")]

SHAPES = {"rgb": (84, 84, 3), "grayscale": (84, 84)}
KINDS = list(SHAPES)
PIXEL = np.array([1.0 / 39.0, 1.0 / 37.0])
"""A pixel of the picture in the units of a state observation."""


def state(**changes):
    """A state observation (1, 13) with paddles at home and the puck in the middle; by index: `at8=0.5`."""
    seen = np.zeros((1, 13), np.float32)
    seen[0, 0], seen[0, 4] = -0.8, 0.8
    for name, value in changes.items():
        seen[0, int(name[2:])] = value
    return seen


def picture(seen, kind="rgb", **arguments):
    """The picture of state observations."""
    return Game(len(seen), obs_type=kind, num_threads=1, **arguments).as_observations(seen)


SURFACE = (slice(8, 82), slice(3, 81))
"""Rows and columns of the playing surface: the rest has the clock and the goals, in the players' colours."""


# What the spaces and the arguments are ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_spaces(kind):
    space = gym.spaces.Box(0, 255, SHAPES[kind], np.uint8)
    env = AirHockeyEnv(obs_type=kind)
    envs = AirHockeyVectorEnv(3, obs_type=kind)
    vec_env = AirHockeySB3VecEnv(3, obs_type=kind)
    assert env.observation_space == space
    assert envs.single_observation_space == space
    assert envs.observation_space == gym.vector.utils.batch_space(space, 3)
    assert vec_env.observation_space == gym.spaces.Box(0, 255, (84, 84, 3 if kind == "rgb" else 1), np.uint8)
    assert env.reset(seed=0)[0] in env.observation_space
    assert envs.reset(seed=0)[0] in envs.observation_space
    assert vec_env.reset()[0] in vec_env.observation_space


# What a picture shows -----------------------------------------------------------------------------------------------


TINY = dataclasses.replace(FULL_SIZE, puck_radius=0.002, paddle_radius=0.003)


@pytest.mark.parametrize("table", [*PRESETS, TINY], ids=lambda table: table if isinstance(table, str) else "tiny")
@pytest.mark.parametrize("kind", KINDS)
def test_a_tenth_of_a_pixel_shows(kind, table):
    rng = np.random.default_rng(3)
    for _ in range(30):
        x, y = rng.uniform(-0.9, 0.9, 2)
        for at, one in ((8, x), (9, y)):
            other = one + 0.1 * PIXEL[at - 8]
            before = picture(state(at8=x, at9=y), kind, table=table)
            after = picture(state(**{"at8": x, "at9": y, f"at{at}": other}), kind, table=table)
            assert (before != after).any()


@pytest.mark.parametrize("at", [0, 4])
def test_paddles_move(at):
    assert (picture(state(**{f"at{at}": -0.5})) != picture(state(**{f"at{at}": -0.5 + 0.1 * PIXEL[0]}))).any()
    assert (picture(state(**{f"at{at + 1}": 0.5})) != picture(state(**{f"at{at + 1}": 0.5 + 0.1 * PIXEL[1]}))).any()


def test_pieces_are_where_they_should_be():
    rng = np.random.default_rng(4)
    rows, columns = (numbers[SURFACE] + 0.5 for numbers in np.mgrid[0:84, 0:84])
    for _ in range(20):
        x, y = rng.uniform(0.2, 0.85, 2)
        seen = state(at0=-x, at1=y, at4=x, at5=-y, at8=-x, at9=-y)
        for at in (0, 4, 8):
            elsewhere = seen.copy()
            elsewhere[0, at : at + 2] = 0.0
            middle = picture(elsewhere)[0].astype(float)
            change = np.abs(picture(seen)[0] - middle).sum(axis=-1)[SURFACE]
            change[(np.abs(columns - 42) < 4) & (np.abs(rows - 45) < 6)] = 0.0  # where it was moved to
            place = [(columns * change).sum() / change.sum(), (rows * change).sum() / change.sum()]
            assert place == pytest.approx([42 + 39 * seen[0, at], 45 - 37 * seen[0, at + 1]], abs=0.2)


def test_an_ellipse_with_equal_radii_is_a_disc():
    rng = np.random.default_rng(2)
    for x, y, radius, softness in rng.uniform((-5, -5, 1, 0.5), (25, 20, 9, 4), (50, 4)):
        disc, ellipse = (np.full((15, 20, 3), 30, np.uint8) for _ in range(2))
        raster.disc(disc, x, y, radius, softness, (255, 138, 156), 0.9)
        raster.ellipse(ellipse, x, y, radius, radius, softness, (255, 138, 156), 0.9)
        assert np.abs(disc.astype(int) - ellipse).max() <= 1


def test_touching_looks_like_touching():
    # The walls are the edges of the surface: at a wall the puck reaches them, and never beyond.
    spec = FULL_SIZE
    x, y = 1.0 - 2.0 * spec.puck_radius / spec.length, 1.0 - 2.0 * spec.puck_radius / spec.width
    empty = picture(state(at8=0.0))[0].astype(float)
    for place in ((x, y), (-x, y), (x, -y), (-x, -y)):
        change = np.abs(picture(state(at8=place[0], at9=place[1]))[0] - empty).sum(axis=-1)
        change[30:60, 30:54] = 0.0  # where it was
        rows, columns = np.nonzero(change)
        assert (columns.min() == 3) if place[0] < 0 else (columns.max() == 80)
        assert (rows.min() == 8) if place[1] > 0 else (rows.max() == 81)


@pytest.mark.parametrize("kind", KINDS)
def test_every_tick_of_the_clock_shows(kind):
    shares = np.arange(-350, 351) / np.float32(350)
    seen = np.repeat(state(), len(shares), axis=0)
    seen[:, 12] = shares
    images = picture(seen, kind).reshape(len(shares), -1)
    assert len(np.unique(images, axis=0)) == len(shares)


def test_the_clock_grows_towards_the_side_of_the_puck_and_is_full_at_the_foul():
    blank = picture(state())[0].astype(int)
    own, far = (picture(state(at12=share))[0].astype(int) for share in (1.0, -1.0))
    for image, columns in ((own, slice(3, 42)), (far, slice(42, 81))):
        changed = np.zeros((84, 84), bool)
        changed[1:4, columns] = True
        np.testing.assert_array_equal((image != blank).any(axis=-1), changed)
    half = picture(state(at12=0.5))[0].astype(int)
    changed = np.nonzero((half != blank).any(axis=-1))
    assert set(changed[1]) == set(range(22, 42))


def test_grey_levels_are_far_apart():
    image = picture(state(at0=-0.5, at8=0.0), "grayscale")[0]
    levels = [image[20, 20], *(image[45, int(42 + 39 * x)] for x in (0.8, -0.5, 0.0))]  # ground, other, own, puck
    assert (np.diff(np.array(levels, int)) > 45).all()


def test_goals_are_as_wide_as_the_tables():
    for spec in PRESETS.values():
        image = picture(state(), table=spec)[0].astype(int)
        rail = image[10, 0]
        for column in (0, 83):
            # Pixels that are partly goal count partly.
            goal = image[45, column]
            share = (np.abs(image[8:82, column] - rail).sum(axis=-1) / np.abs(goal - rail).sum()).sum() / 74
            assert share == pytest.approx(spec.goal_width / spec.width, abs=0.01)


def test_tables_with_physics_of_their_own_look_as_they_do_alone():
    specs = [*PRESETS.values(), dataclasses.replace(FULL_SIZE, goal_width=0.6, puck_radius=0.08)]
    game = Game(4, obs_type="rgb", num_threads=1)
    game.parameters = np.concatenate([make_parameters(spec, 50) for spec in specs])
    seen = np.repeat(state(at8=-0.97, at9=0.3), 4, axis=0)
    images = game.as_observations(seen)
    for i, spec in enumerate(specs):
        alone = picture(seen[:1], table=spec)
        assert same(images[i], alone[0])
        assert same(game.as_observations(seen[:1], np.array([i])), alone)


# Whose side a picture shows -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_the_right_hand_player_sees_the_turned_table(kind):
    n = 40
    game, mirror = (Game(n, right=None, obs_type=kind, num_threads=1) for _ in range(2))
    game.reset(seed=0)
    for left, right in zip(random_actions(5, 80, n), random_actions(6, 80, n), strict=True):
        game.step(left, right)
    mirror.set_state(turned(game.get_state()))
    assert same(mirror.observations(RIGHT), game.observations(LEFT))
    assert same(mirror.observations(LEFT), game.observations(RIGHT))
    assert not same(mirror.observations(), game.observations())


# Every batch and thread draws the same; every API: see test_parity ----------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_picture_is_drawn_from_the_state_observation_and_nothing_else(kind):
    drawn, states = (
        AirHockeyVectorEnv(3, obs_type=obs_type, autoreset_mode="SameStep", max_episode_steps=15)
        for obs_type in (kind, "state")
    )
    assert same(drawn.reset(seed=7)[0], picture(states.reset(seed=7)[0], kind))
    finals = 0
    for actions in random_actions(8, 40, 3):
        observations, *_, infos = drawn.step(actions)
        seen, *_, told = states.step(actions)
        assert same(observations, picture(seen, kind))
        for i in np.flatnonzero(infos.get("_final_obs", ())):
            assert same(infos["final_obs"][i], picture(told["final_obs"][i][None], kind)[0])
            assert not same(infos["final_obs"][i], observations[i])
            finals += 1
    assert finals > 5


@pytest.mark.parametrize("kind", KINDS)
def test_threads_and_batch_sizes_do_not_change_a_bit(kind):
    n = 333
    seen = np.random.default_rng(1).uniform(-1.0, 1.0, (n, 13)).astype(np.float32)
    expected = picture(seen, kind)
    for threads in (2, 3, 7):
        game = Game(n, obs_type=kind, num_threads=threads)
        assert same(game.as_observations(seen), expected)
    for i in range(0, n, 50):
        assert same(picture(seen[i : i + 1], kind)[0], expected[i])


# Whose memory it is -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_pictures_that_a_user_holds_stay_as_they_are(kind):
    envs = AirHockeyVectorEnv(2, obs_type=kind)
    held = [envs.reset(seed=2)[0]]
    digests = [held[0].tobytes()]
    for k, actions in enumerate(random_actions(3, 40, 2)):
        observations = envs.step(actions)[0]
        digests.append(observations[1].tobytes())
        # All kinds of hold: the array, a view of a view, a memoryview.
        held.append([observations, observations[1:][0], memoryview(observations)[1:]][k % 3])
        del observations
    for k, (image, digest) in enumerate(zip(held, digests, strict=True)):
        held_bytes = np.asarray(image).tobytes()
        assert held_bytes == digest or held_bytes.endswith(digest), k


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_user_writes_into_a_picture_is_gone_with_the_next(kind):
    envs, clean = (AirHockeyVectorEnv(2, obs_type=kind) for _ in range(2))
    for one in (envs, clean):
        one.reset(seed=2)
    for actions in random_actions(3, 10, 2):
        observations, expected = envs.step(actions)[0], clean.step(actions)[0]
        assert same(observations, expected)
        observations[:] = 77


# What is built on top -----------------------------------------------------------------------------------------------


def test_a_callable_opponent_sees_states():
    def watch(seen):
        seen_shapes.add((seen.shape, seen.dtype))
        return pursue(seen)

    seen_shapes = set()
    envs = AirHockeyVectorEnv(3, obs_type="rgb", opponent=watch)
    envs.reset(seed=0)
    envs.step(np.zeros((3, 2), np.float32))
    assert seen_shapes == {((3, 13), np.dtype(np.float32))}


def test_states_need_no_drawing():
    assert Game(1).pixels is None


def test_stable_baselines_learns_from_stacked_single_environments():
    envs = DummyVecEnv([lambda: FrameStackObservation(AirHockeyEnv(obs_type="grayscale", max_episode_steps=50), 4)] * 2)
    model = PPO("CnnPolicy", envs, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    assert model.learn(64).num_timesteps == 64


# Bits ---------------------------------------------------------------------------------------------------------------


def digest():
    """Of one frame of every kind; also run as plain Python, below."""
    seen = np.array([[-0.713, 0.341, 0, 0, 0.666, -0.123, 0, 0, -0.05, 0.777, 0, 0, 0.4321]], np.float32)
    return hashlib.sha256(b"".join(picture(seen, kind).tobytes() for kind in KINDS)).hexdigest()


def test_plain_python_draws_the_same_bits():
    command = [sys.executable, "-c", "from tests.drawing.test_pixels import digest; print(digest())"]
    run = subprocess.run(
        command, env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True, check=True, timeout=300
    )
    assert run.stdout.strip() == digest()
