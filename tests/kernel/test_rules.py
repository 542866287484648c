"""The game as it is documented: serves, goals, clocks, paddles, rewards, and what `info` tells about contacts."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from airhockey_env import PRESETS, AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.game import Game
from airhockey_env.kernel.observations import view_of
from airhockey_env.kernel.rewards import SHAPING_DISCOUNT, potential
from airhockey_env.kernel.state import CONTACT_ROWS, LEFT, PUCK, RIGHT, STATE
from airhockey_env.tables import CHALLENGE, FULL_SIZE, IDEAL
from tests.helpers import SHOT, SHOT_BACK, pursue, random_actions, turned

STILL = np.zeros(2, np.float32)
TICK = 0.02
FOR, AGAINST = tuple(SHOT.values()), tuple(SHOT_BACK.values())


def started(position=None, velocity=None, serve="random", seed=0, **arguments):
    """A table with an idle opponent, unless told otherwise, and a puck in a given place."""
    env = AirHockeyEnv(**{"opponent": "idle", **arguments})
    options = {"serve": serve, "puck_position": position, "puck_velocity": velocity}
    env.reset(seed=seed, options=options)
    return env


# Serves


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("serve", ["left", "right", "random"])
def test_serves(name, serve):
    envs = AirHockeyVectorEnv(3000, table=name)
    observations, infos = envs.reset(seed=0, options={"serve": serve})
    half = np.array([0.5 * envs.table.length, 0.5 * envs.table.width])
    assert (envs.velocities == 0.0).all()
    np.testing.assert_allclose(envs.positions[:, :PUCK] / half, np.broadcast_to([[-0.8, 0], [0.8, 0]], (3000, 2, 2)))
    x, y = (envs.positions[:, PUCK] / half).T
    assert np.abs(x).min() == pytest.approx(0.2, abs=1e-3) and np.abs(x).max() == pytest.approx(0.5, abs=1e-3)
    assert np.abs(x).min() >= 0.2 and np.abs(x).max() <= 0.5
    assert np.abs(y).max() == pytest.approx(0.5, abs=1e-3) and np.abs(y).max() <= 0.5
    assert abs(y.mean()) < 0.05
    share_left = (x < 0.0).mean()
    assert {"left": share_left == 1.0, "right": share_left == 0.0, "random": abs(share_left - 0.5) < 0.05}[serve]
    assert (observations[:, 12] == 0.0).all() and (infos["score"] == 0).all()


@pytest.mark.parametrize(("shot", "winner"), [(FOR, 0), (AGAINST, 1)])
def test_who_concedes_is_served_to_and_a_match_goes_on(shot, winner):
    game = Game(1, right="idle", points=3)
    game.reset(seed=4, options={"puck_position": shot[0], "puck_velocity": shot[1]})
    for _ in range(2):
        game.step(np.zeros((1, 2), np.float32))
    assert tuple(game.out.reward[:, 0]) == ((1.0, -1.0), (-1.0, 1.0))[winner]
    assert not game.out.terminated[0]
    assert game.states["score"][0].tolist() == [winner == 0, winner == 1]
    conceded = 1.0 if winner == 0 else -1.0
    assert 0.2 <= conceded * game.states["position"][0, PUCK, 0] / (0.5 * FULL_SIZE.length) <= 0.5
    assert game.states["side"][0] == conceded and game.states["clock"][0] == 0
    assert (game.states["velocity"] == 0.0).all()
    assert (game.states["position"][0, :PUCK, 1] == 0.0).all()
    for points in (2, 3):
        game.states["position"][0, PUCK], game.states["velocity"][0, PUCK] = shot
        for _ in range(2):
            game.step(np.zeros((1, 2), np.float32))
        assert game.states["score"][0, winner] == points
        assert game.out.terminated[0] == (points == 3)


# Goals


@pytest.mark.parametrize(("shot", "sign"), [(FOR, 1.0), (AGAINST, -1.0)])
def test_a_goal_ends_the_point(shot, sign):
    env = started(*shot)
    assert env.step(STILL)[1:4] == (0.0, False, False)
    observation, reward, terminated, truncated, info = env.step(STILL)
    assert (reward, terminated, truncated) == (sign, True, False)
    assert info["score"].tolist() == [sign > 0, sign < 0] and info["score"].dtype == np.int32
    assert info["is_success"] is (sign > 0)
    assert observation[8] == sign  # the puck is shown on the goal line


def test_a_goal_is_when_the_centre_is_over_the_line():
    env = started((1.05, 0.1), (5.0, 0.0))
    _, reward, *_ = env.step(STILL)
    assert reward == 0.0 and 0.5 * FULL_SIZE.length - FULL_SIZE.puck_radius < env.positions[PUCK, 0]
    _, reward, *_ = env.step(STILL)
    assert reward == 1.0


@pytest.mark.parametrize("y", [0.14, 0.1672, 0.18, 0.2, 0.4])
def test_no_goal_beside_the_goal(y):
    env = started((1.0, y), (5.0, 0.0))
    for _ in range(5):
        _, reward, terminated, _, _ = env.step(STILL)
        assert not terminated and reward == 0.0
    assert env.velocities[PUCK, 0] < 0.0


# Clocks


@pytest.mark.parametrize("rate", [50, 24, 10])
@pytest.mark.parametrize(("serve", "side"), [("left", 1.0), ("right", -1.0)])
def test_shot_clock_and_foul(rate, serve, side):
    env = started(serve=serve, control_hz=rate)
    place = env.positions[PUCK]
    for tick in range(1, 7 * rate + 1):
        observation, reward, terminated, truncated, _ = env.step(STILL)
        assert observation[12] == np.float32(side * tick / (7 * rate))
        assert (env.positions[PUCK] == place).all()
    assert observation[12] == side
    observation, reward, terminated, truncated, info = env.step(STILL)  # past 7 s: the other side serves
    assert (reward, terminated, truncated) == (0.0, False, False) and info["score"].tolist() == [0, 0]
    assert 0.2 <= side * env.positions[PUCK, 0] / (0.5 * FULL_SIZE.length) <= 0.5
    assert observation[12] == 0.0
    assert env.step(STILL)[0][12] == np.float32(-side / (7 * rate))


def test_a_foul_puts_the_paddles_home():
    env = started(serve="left")
    for step in range(351):
        env.step([1.0, 1.0] if step < 200 else [0.0, -1.0])
        moved = np.abs(env.positions[LEFT] - (-0.8 * 0.5 * FULL_SIZE.length, 0.0)).max() > 0.1
        assert moved or step < 10 or step == 350
    assert not moved and (env.velocities == 0.0).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_crossing_the_centre_line_starts_the_other_sides_clock(sign):
    env = started((-0.1 * sign, 0.4), (0.53 * sign, 0.0), table="ideal")
    clocks = []
    for _ in range(20):
        observation = env.step(STILL)[0]
        clocks.append((env.positions[PUCK, 0] * sign > 0.0, round(350 * sign * float(observation[12]))))
    assert clocks == [(False, tick) for tick in range(1, 10)] + [(True, -tick) for tick in range(11)]


def test_a_puck_that_only_touches_the_line_stays_where_it_was():
    env = started((0.0, 0.4), (0.0, 0.0))
    sign = 1.0 if env.step(STILL)[0][12] > 0.0 else -1.0
    for tick in range(2, 20):
        assert env.step(STILL)[0][12] == np.float32(sign * tick / 350)


# Paddles


def test_paddle_gathers_speed_at_its_acceleration():
    env = started()
    for k in range(1, 40):
        env.step([1.0, 0.0])
        np.testing.assert_allclose(env.velocities[LEFT], [min(30.0 * TICK * k, 5.0), 0.0], rtol=1e-12)
        if k == 10:
            break
    place = env.positions[LEFT, 0]
    env.step([1.0, 0.0])
    assert env.positions[LEFT, 0] - place == pytest.approx(5.0 * TICK)


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("rate", [10, 50, 240])
def test_paddles_keep_to_their_limits(name, rate):
    rng = np.random.default_rng(2)
    env = AirHockeyEnv(opponent=lambda seen: rng.uniform(-2.0, 2.0, (1, 2)), table=name, control_hz=rate)
    table = env.table
    env.reset(seed=1)
    r = table.paddle_radius
    far, side = 0.5 * table.length - r, 0.5 * table.width - r
    limited = 0
    for actions in random_actions(5, 600, 1):
        before, contacts_before = env.velocities[:PUCK], env.positions
        info = env.step(actions[0])[-1]
        if info["score"].any():
            env.reset()
            continue
        after, places = env.velocities[:PUCK], env.positions
        assert (np.linalg.norm(after, axis=1) <= table.paddle_speed * (1 + 1e-12)).all()
        mirrored = places[:PUCK] * [[-1.0], [1.0]]
        assert (mirrored[:, 0] >= r - 1e-12).all() and (mirrored[:, 0] <= far + 1e-12).all()
        assert (np.abs(places[:PUCK, 1]) <= side + 1e-12).all()
        for player, sign in ((LEFT, -1.0), (RIGHT, 1.0)):
            change = np.linalg.norm(after[player] - before[player])
            x, y = places[player]
            at_edge = min(abs(sign * x - r), abs(sign * x - far), abs(abs(y) - side)) < 1e-9
            squeezed = len(env.contacts) == CONTACT_ROWS
            served = (places[:PUCK, 1] == 0.0).all() and not np.array_equal(places, contacts_before)
            if not (at_edge or squeezed or served):
                assert change <= table.paddle_acceleration / rate * (1 + 1e-9)
                limited += 1
    assert limited > 300


@pytest.mark.parametrize(("x", "y"), [d for d in itertools.product((-1, 0, 1), repeat=2) if any(d)])
def test_paddle_is_confined(x, y):
    env = started(position=(0.5, 0.4))
    for _ in range(120):
        env.step([x, y])
    r = FULL_SIZE.paddle_radius
    low = (-0.5 * FULL_SIZE.length + r, -0.5 * FULL_SIZE.width + r)
    high = (-r, 0.5 * FULL_SIZE.width - r)
    home = (-0.8 * 0.5 * FULL_SIZE.length, 0.0)
    expected = [(low[k], home[k], high[k])[1 + (x, y)[k]] for k in range(2)]
    np.testing.assert_allclose(env.positions[LEFT], expected, atol=1e-12)
    np.testing.assert_allclose(env.velocities[LEFT], 0.0, atol=1e-9)


def test_a_long_action_is_shortened_to_the_greatest_speed():
    env = started(position=(0.5, 0.4))
    for _ in range(11):
        env.step([1.0, 1.0])
    np.testing.assert_allclose(env.velocities[LEFT], [5.0 * math.sqrt(0.5)] * 2, rtol=1e-12)


def test_an_action_is_a_share_of_the_greatest_speed():
    env = started(position=(0.5, 0.4))
    for _ in range(10):
        env.step([0.25, -0.5])
    np.testing.assert_allclose(env.velocities[LEFT], [1.25, -2.5], rtol=1e-12)


@pytest.mark.parametrize("action", range(9))
def test_discrete_actions(action):
    env = started(continuous=False)
    env.step(action)
    angle = math.radians(45.0 * (action - 1))
    speed = 0.0 if action == 0 else 30.0 * TICK
    np.testing.assert_allclose(env.velocities[LEFT], [speed * math.cos(angle), speed * math.sin(angle)], atol=1e-7)


def test_puck_is_slowed_to_its_cap():
    table = dataclasses.replace(IDEAL, puck_speed=6.0)
    env = started((-0.5, 0.0), (0.0, 0.0), table=table)
    fastest = 0.0
    for _ in range(30):
        env.step([1.0, 0.0])
        speed = math.hypot(*env.velocities[PUCK])
        fastest = max(fastest, speed)
        if len(env.contacts) and env.contacts["b"][0] == PUCK:
            break
    assert fastest == pytest.approx(6.0, rel=1e-12)  # without a cap it would leave at twice the paddle's speed


# Motion


def free_flight(table, speed, time):
    """Speed and way of a puck that glides for a time, by the closed forms."""
    a, b, c = table.drag_constant, table.drag_quadratic, table.drag_linear
    if c > 0.0:
        return speed * math.exp(-c * time), speed / c * (1.0 - math.exp(-c * time))
    if b == 0.0:
        return speed, speed * time
    start, rate = math.atan(speed * math.sqrt(b / a)), math.sqrt(a * b)
    return math.sqrt(a / b) * math.tan(start - rate * time), math.log(
        math.cos(start - rate * time) / math.cos(start)
    ) / b


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("rate", [10, 50, 240])
def test_glide_is_the_closed_form(name, rate):
    table = PRESETS[name]
    assert table in (FULL_SIZE, CHALLENGE, IDEAL)
    env = started((-0.8, 0.4), (1.0, 0.0), table=name, control_hz=rate)
    deceleration = table.drag_constant + table.drag_linear + table.drag_quadratic
    change = (table.drag_linear + 2.0 * table.drag_quadratic) * deceleration  # of it, per second, greatest here
    for step in range(1, int(1.5 * rate) + 1):
        env.step(STILL)
        speed, way = free_flight(table, 1.0, step / rate)
        assert env.velocities[PUCK, 0] == pytest.approx(speed, rel=1e-12)
        assert env.positions[PUCK, 0] + 0.8 == pytest.approx(way, abs=step * change / rate**3 / 24.0 + 1e-12)
        assert env.positions[PUCK, 1] == 0.4 and env.velocities[PUCK, 1] == 0.0


def test_a_slow_puck_comes_to_rest():
    env = started((-0.5, 0.4), (0.03, 0.04), serve="left")
    stop = math.ceil(math.atan(0.05 * math.sqrt(0.0348 / 0.0145)) / math.sqrt(0.0348 * 0.0145) / TICK)
    for step in range(1, stop + 20):
        env.step(STILL)
        assert (math.hypot(*env.velocities[PUCK]) == 0.0) == (step >= stop)
    assert math.dist(env.positions[PUCK], (-0.5, 0.4)) == pytest.approx(
        free_flight(FULL_SIZE, 0.05, stop * TICK)[1], abs=1e-4
    )


# Contacts


def test_contacts_are_what_happened():
    """Without glide, impulses explain every change of velocity; and the first touches lie where they must."""
    m, r, reach = IDEAL.puck_mass, IDEAL.puck_radius, IDEAL.puck_radius + IDEAL.paddle_radius
    env = AirHockeyEnv(opponent="striker", table="ideal")
    observation, _ = env.reset(seed=2)
    assert len(env.contacts) == 0
    rng = np.random.default_rng(0)
    seen = {"wall": 0, LEFT: 0, RIGHT: 0}
    for step in range(6000):
        places, velocities = env.positions, env.velocities
        chase = pursue(observation[None])[0] if step % 3 else rng.uniform(-1.0, 1.0, 2)
        observation, _, over, _, _ = env.step(chase)
        contacts = env.contacts
        if len(contacts):
            paddle = np.where(contacts["a"] < PUCK, contacts["a"], -1)
            assert ((contacts["a"] == PUCK) == (contacts["b"] == -1)).all()
            assert (contacts["b"][paddle >= 0] == PUCK).all()
            assert (contacts["impulse"] > 0.0).all() and (np.diff(contacts["time"]) >= 0.0).all()
            assert (contacts["time"] >= 0.0).all() and (contacts["time"] <= TICK).all()
            normal = np.stack([contacts["nx"], contacts["ny"]], axis=1)
            on_puck = np.where(paddle >= 0, -1.0, 1.0)[:, None] * normal
            first = contacts[0]
            puck = places[PUCK] + first["time"] * velocities[PUCK]
            np.testing.assert_allclose((first["x"], first["y"]), puck - r * on_puck[0], atol=1e-9)
            if paddle[0] >= 0:
                disc = env.positions[paddle[0]] - (TICK - first["time"]) * env.velocities[paddle[0]]
                if len(contacts) < CONTACT_ROWS and not over:
                    assert math.dist(disc, puck) == pytest.approx(reach, abs=1e-9)
            if len(contacts) < CONTACT_ROWS and not over:
                change = env.velocities[PUCK] - velocities[PUCK]
                capped = math.hypot(*env.velocities[PUCK]) > IDEAL.puck_speed * (1 - 1e-9)
                if not capped:
                    np.testing.assert_allclose(
                        change, (contacts["impulse"][:, None] * on_puck).sum(axis=0) / m, atol=1e-9
                    )
            for who in paddle:
                seen["wall" if who < 0 else int(who)] += 1
        elif not over and observation[12] != 0.0:
            np.testing.assert_allclose(env.velocities[PUCK], velocities[PUCK], rtol=1e-14)
        if over:
            observation, _ = env.reset()
    assert min(seen.values()) > 20


# Both sides are the same game


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("rate", [10, 50])
def test_turning_the_table_turns_the_game(name, rate):
    game, mirror = (Game(1, table=name, control_hz=rate, points=2**30, right=None) for _ in range(2))
    game.reset(seed=3)
    mirror.reset(seed=3)
    mirror.states[:] = turned(game.states)
    total = 0
    for drawn in random_actions(4, 3000, 2):
        ours, theirs = game.out, mirror.out
        chase = pursue(game.observations(LEFT)), pursue(game.observations(RIGHT))
        left, right = chase if drawn[0, 0] > 0.0 else (drawn[:1], drawn[1:])
        game.step(left, right)
        mirror.step(right, left)
        assert (ours.observation[:, 0] == theirs.observation[::-1, 0]).all()
        assert (ours.reward[:, 0] == theirs.reward[::-1, 0]).all() and ours.point[0] == -theirs.point[0]
        for told in ("foul", "terminated", "truncated", "n_contacts"):
            assert getattr(ours, told)[0] == getattr(theirs, told)[0], told
        expected = turned(game.states)
        for field in STATE.names:
            assert (mirror.states[field] == expected[field]).all(), field
        contacts, reflected = game.contacts_of(0), mirror.contacts_of(0)
        total += len(contacts)
        for field in ("x", "y", "nx", "ny"):
            assert (contacts[field] == -reflected[field]).all()
        assert (contacts["impulse"] == reflected["impulse"]).all()
    assert total > 100 and game.states["score"].sum() > 3


# Rewards


@pytest.mark.parametrize("name", PRESETS)
def test_shaped_reward_is_sparse_plus_a_potential_that_telescopes(name):
    shaped, sparse = (AirHockeyEnv(table=name, reward=r, max_episode_steps=150) for r in ("shaped", "sparse"))

    def phi():
        return potential(view_of(shaped._game.states[0], LEFT), shaped._game.parameters[0], LEFT)

    ends = []
    for seed in range(30):
        observation, _ = shaped.reset(seed=seed)
        assert (sparse.reset(seed=seed)[0] == observation).all()
        first, total, discount, over = phi(), 0.0, 1.0, False
        while not over:
            action = pursue(observation[None])[0]
            before = phi()
            observation, reward, terminated, truncated, _ = shaped.step(action)
            seen, points, *ends_sparse, _ = sparse.step(action)
            assert (seen == observation).all() and ends_sparse == [terminated, truncated]
            after = 0.0 if terminated else phi()
            assert reward == pytest.approx(points + SHAPING_DISCOUNT * after - before, abs=1e-12)
            total += discount * (reward - points)
            discount *= SHAPING_DISCOUNT
            over = terminated or truncated
        assert total == pytest.approx(discount * after - first, abs=1e-9)
        ends.append((terminated, truncated))
    assert {(True, False), (False, True)} == set(ends)


def test_potential_grows_with_what_is_promising():
    def phi(position, velocity=(0.0, 0.0)):
        env = started(position, velocity)
        return potential(view_of(env._game.states[0], LEFT), env._game.parameters[0], LEFT)

    assert phi((0.5, 0.0)) > phi((0.1, 0.0)) > phi((-0.5, 0.3))
    assert phi((0.1, 0.0), (3.0, 0.0)) > phi((0.1, 0.0)) > phi((0.1, 0.0), (-3.0, 0.0))
    assert phi((-0.7, 0.0)) > phi((-0.7, 0.45))  # the paddle is nearer to the first one
