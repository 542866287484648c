"""A match against the wall clock, and the hand that follows the pointer."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.live.hand import Hand, approach_speed
from airhockey_env.live.match import (
    CONTROL_HZ,
    MOST_BEHIND,
    POINT_PAUSE,
    POLICY_HZ,
    START_PAUSE,
    Event,
    LiveMatch,
)
from airhockey_env.live.pointer import Pointer
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.replay import play_back
from airhockey_env.saved_states import game_state
from airhockey_env.tables import FULL_SIZE

TICK = 1.0 / CONTROL_HZ
STEP = FULL_SIZE.paddle_acceleration * TICK
HAND = Hand(FULL_SIZE.paddle_speed, STEP, TICK, (-1.13, -0.52), (-0.05, 0.52))
START = 10.0
BEGUN = START + START_PAUSE


# The hand


def drive(place: np.ndarray, velocity: np.ndarray, action: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """What the game makes of an action, away from the edges."""
    assert math.hypot(*action) <= 1.0 + 1e-12
    change = np.array(action) * HAND.speed - velocity
    length = np.hypot(*change)
    velocity = velocity + change * min(1.0, HAND.step / length if length > 0.0 else 1.0)
    return place + velocity * HAND.tick, velocity


@pytest.mark.parametrize("distance", [0.0, 1e-9, 1e-4, 0.003, 0.05, 0.4])
def test_the_approach_ends_at_the_target(distance: float) -> None:
    left, speed = distance, approach_speed(distance, STEP, TICK)
    while left > 1e-12:
        following = approach_speed(left, STEP, TICK)
        assert following >= speed - STEP - 1e-9  # it can brake as hard as that
        speed = following
        left -= speed * TICK
        assert left >= -1e-12
    assert speed <= STEP + 1e-9  # and stand still a tick later


def test_a_resting_paddle_reaches_a_still_target_without_overshoot_and_in_the_least_time() -> None:
    generator = np.random.default_rng(0)
    for _ in range(200):
        start, target = generator.uniform(HAND.near, HAND.far), generator.uniform(HAND.near, HAND.far)
        place, velocity, elapsed = start, np.zeros(2), 0.0
        distance = float(np.hypot(*(target - start)))
        way = (target - start) / distance
        while np.hypot(*(place - target)) > 1e-9 or np.hypot(*velocity) > 1e-9:
            action = HAND.follow(place, velocity, (float(target[0]), float(target[1])))
            place, velocity = drive(place, velocity, action)
            elapsed += TICK
            assert (place - target) @ way < 1e-9
            assert elapsed < 1.0
        top = min(HAND.speed, math.sqrt(distance * FULL_SIZE.paddle_acceleration))
        least = distance / top + top / FULL_SIZE.paddle_acceleration
        assert elapsed <= least + 3.0 * TICK


def test_a_moving_paddle_comes_to_rest_at_any_target() -> None:
    generator = np.random.default_rng(1)
    for _ in range(200):
        place, velocity = generator.uniform(HAND.near, HAND.far), generator.uniform(-3.0, 3.0, 2)
        target = generator.uniform(HAND.near, HAND.far)
        for _ in range(round(1.2 / TICK)):
            action = HAND.follow(place, velocity, (float(target[0]), float(target[1])))
            place, velocity = drive(place, velocity, action)
        assert np.hypot(*(place - target)) < 1e-6


def test_a_steady_target_is_caught_up_with() -> None:
    place, velocity = np.array([-0.8, -0.4]), np.zeros(2)
    for k in range(round(0.4 / TICK)):
        target = (-0.8, -0.4 + 1.5 * (k + 1) * TICK)
        place, velocity = drive(place, velocity, HAND.follow(place, velocity, target, (0.0, 1.5)))
    assert place == pytest.approx(target, abs=1e-9)


def test_reachable() -> None:
    assert HAND.reachable((0.5, -3.0)) == (-0.05, -0.52)
    assert HAND.reachable((-0.5, 0.1)) == (-0.5, 0.1)


# The pointer


def test_a_pointer_between_reports() -> None:
    pointer = Pointer()
    assert not pointer
    pointer.move(1.0, (0.0, 1.0))
    assert pointer.place(0.5) == pointer.place(1.5) == (0.0, 1.0)
    pointer.move(1.1, (0.2, 0.0))
    assert pointer.place(1.05) == pytest.approx((0.1, 0.5))
    assert pointer.place(2.0) == (0.2, 0.0)
    assert pointer


def test_the_velocity_of_a_pointer() -> None:
    def velocity(path: Callable[[float], float]) -> float:
        pointer = Pointer()
        for k in range(31):
            pointer.move(k / 60, (path(k / 60), 0.0))
        assert pointer.velocity(0.5)[1] == 0.0
        return pointer.velocity(0.5)[0]

    assert velocity(lambda t: 0.3) == 0.0
    assert velocity(lambda t: 2.0 * t) == pytest.approx(2.0)
    assert velocity(lambda t: 0.0 if t < 0.49 else 0.4) < 0.05 * 0.4 * 60  # a jump
    assert velocity(lambda t: min(t, 0.45)) == 0.0  # it has stopped
    assert velocity(lambda t: abs(t - 0.485)) == 0.0  # it has turned back
    assert 0.0 < velocity(lambda t: -((0.55 - t) ** 2)) < 2.0 * (0.55 - 0.5) + 0.02  # it is stopping


def test_a_pointer_remembers_moments_only() -> None:
    pointer = Pointer()
    for k in range(10_000):
        pointer.move(k / 1000, (k / 1000, 0.0))
    assert len(pointer._path) < 300


# The match


def begun(opponent: MlpPolicy | str = "idle", **arguments: object) -> LiveMatch:
    """A match that is being played from `BEGUN` on, with the puck out of the left paddle's way."""
    match = LiveMatch(opponent, seed=0, **arguments)  # type: ignore[arg-type]
    match.restart(START)
    match._state["position"][PUCK] = (0.4, 0.1)
    match._state["side"] = 1
    match.advance(BEGUN, None)
    assert not match.resting
    return match


def steps(match: LiveMatch) -> int:
    """Control steps that were played since the match began."""
    return int(match._state["steps"])


def shoot(match: LiveMatch, side: int) -> None:
    """Put the puck before a goal, on its way in."""
    match._state["position"][PUCK] = (side * (0.5 * FULL_SIZE.length - 0.05), 0.0)
    match._state["velocity"][PUCK] = (side * 5.0, 0.0)
    match._state["position"][LEFT if side < 0 else RIGHT, 1] = 0.4


@pytest.mark.parametrize("fps", [23.7, 60.0, 144.0, 480.0])
def test_the_game_keeps_the_time_of_the_wall(fps: float) -> None:
    match = begun()
    for k in range(1, round(3.0 * fps) + 1):
        match.advance(BEGUN + k / fps, None)
        assert abs(steps(match) - k / fps * CONTROL_HZ) <= 1.0 + 1e-6


def test_a_hold_up_is_not_caught_up_with() -> None:
    match = begun()
    match.advance(BEGUN + 60.0, None)
    assert steps(match) <= MOST_BEHIND * CONTROL_HZ + 1
    before = steps(match)
    match.advance(BEGUN + 60.0 + 10 * TICK, None)
    assert abs(steps(match) - before - 10) <= 1


def test_the_frame_rate_does_not_change_the_game() -> None:
    ends = []
    for fps in (25, 50, 100, 200):
        match = begun("striker")
        for k in range(1, 2 * fps + 1):
            match.advance(BEGUN + k / fps + 1e-7, (-0.8, 0.2))
        ends.append(match._state["position"].copy())
    for end in ends[1:]:
        np.testing.assert_array_equal(end, ends[0])


def test_a_picture_lies_between_the_last_two_steps() -> None:
    match = begun()
    match._state["velocity"][PUCK] = (1.0, 0.0)
    match.advance(BEGUN + 10.01 * TICK, None)
    at = match.positions[PUCK, 0]
    for share in (0.25, 0.5, 0.99):
        match.advance(BEGUN + (10.0 + share) * TICK, None)
        assert match.positions[PUCK, 0] - at == pytest.approx((share - 0.01) * TICK, rel=0.01)
    match.advance(BEGUN + 11.01 * TICK, None)  # and goes on without a jump
    assert match.positions[PUCK, 0] - at == pytest.approx(TICK, rel=0.01)


def test_the_paddle_goes_where_the_pointer_jumps_to_and_no_further() -> None:
    match = begun()
    home = match.positions[LEFT].copy()
    target = np.array([-0.5, -0.3])
    way = (target - home) / np.hypot(*(target - home))
    furthest = 0.0
    for k in range(1, 61):
        match.advance(BEGUN + k / 60, (float(target[0]), float(target[1])) if k > 3 else (float(home[0]), 0.0))
        furthest = max(furthest, float((match.positions[LEFT] - home) @ way))
    assert match.positions[LEFT] == pytest.approx(target, abs=1e-6)
    assert furthest <= np.hypot(*(target - home)) + 1e-4


@pytest.mark.parametrize("fps", [60, 144])
def test_the_paddle_keeps_up_with_a_hand(fps: int) -> None:
    """Over 0.4 m in 0.35 s, as smoothly as people do it (minimum jerk): 2.1 m/s at most."""
    match = begun()
    home = float(match.positions[LEFT, 0])

    def hand(elapsed: float) -> float:
        share = min(max((elapsed - 0.2) / 0.35, 0.0), 1.0)
        return 0.4 * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)

    behind = []
    for k in range(1, fps + 1):
        elapsed = k / fps
        match.advance(BEGUN + elapsed, (home, hand(elapsed)))
        behind.append(hand(elapsed - TICK) - float(match.positions[LEFT, 1]))  # a picture shows the step before
    assert max(behind) < 0.015
    assert min(behind) > -0.001


def test_a_pointer_out_of_reach_leads_along_the_edge() -> None:
    match = begun()
    for k in range(1, 91):
        match.advance(BEGUN + k / 60, (1.0, -0.1))
    assert match.positions[LEFT] == pytest.approx((-FULL_SIZE.paddle_radius, -0.1), abs=1e-6)
    assert match.target == (1.0, -0.1)


def test_without_a_pointer_the_paddle_stays() -> None:
    match = begun()
    home = match.positions[LEFT].copy()
    match.advance(BEGUN + 0.09, None)
    np.testing.assert_array_equal(match.positions[LEFT], home)
    assert match.target is None


@pytest.mark.parametrize(("side", "kind", "score"), [(1, "goal", (1, 0)), (-1, "conceded", (0, 1))])
def test_after_a_goal_the_picture_rests_and_does_not_slide_to_the_serve(
    side: int, kind: str, score: tuple[int, int]
) -> None:
    match = begun()
    shoot(match, side)
    paddles = match._state["position"][:PUCK].copy()
    events = match.advance(BEGUN + 0.05, None)
    assert events[-1].kind == match.notice == kind and match.resting and not match.over
    assert match.score == score
    assert abs(match.positions[PUCK, 0]) == pytest.approx(0.5 * FULL_SIZE.length, abs=0.03)
    np.testing.assert_array_equal(match.positions[:PUCK], paddles)
    rested = match.positions.copy()
    scored = BEGUN + 0.05
    match.advance(scored + POINT_PAUSE - 0.06, None)
    np.testing.assert_array_equal(match.positions, rested)
    match.advance(scored + POINT_PAUSE + 0.25 * TICK, None)
    assert not match.resting and match.notice == ""
    served = match._state["position"].copy()  # the serve is at rest, and so is everything in the picture
    np.testing.assert_allclose(match.positions, served, atol=1e-12)
    assert served[PUCK, 0] * side > 0.0


def test_a_foul_is_noticed() -> None:
    match = begun()
    events: list[Event] = []
    for k in range(1, round(7.2 * 60)):
        events += match.advance(BEGUN + k / 60, None)
    assert [event.kind for event in events] == ["foul"]
    assert match.notice == "foul" and match.score == (0, 0)


def test_hits_are_reported_with_their_strength() -> None:
    match = begun()
    match._state["position"][PUCK] = (0.5, 0.5 * FULL_SIZE.width - FULL_SIZE.puck_radius - 0.02)
    match._state["velocity"][PUCK] = (0.0, 4.0)
    (event,) = match.advance(BEGUN + 0.02, None)
    assert event.kind == "wall" and event.x == pytest.approx(0.5, abs=0.01)
    expected = 4.0 * (1.0 + FULL_SIZE.wall_restitution) / FULL_SIZE.puck_speed
    assert event.strength == pytest.approx(expected, rel=0.02)


def test_contacts_are_the_engines_and_the_puck_bends_where_they_are() -> None:
    match = begun()
    wall = 0.5 * FULL_SIZE.width - FULL_SIZE.puck_radius
    match._state["position"][PUCK] = (0.5, wall - 4.3 * TICK)
    match._state["velocity"][PUCK] = (0.0, 2.0)
    heights = {}
    contacts = []
    for k in range(1, 61):
        match.advance(BEGUN + 0.1 * k * TICK, None)
        heights[match.elapsed] = float(match.positions[PUCK, 1])
        contacts += match.contacts
    (contact,) = contacts
    assert contact.a == PUCK and contact.b == -1 and (contact.nx, contact.ny) == (0.0, -1.0)
    assert contact.time == pytest.approx(2.15 * TICK, rel=1e-3)
    assert contact.x == 0.5 and contact.y == pytest.approx(0.5 * FULL_SIZE.width)
    assert contact.impulse == pytest.approx(2.0 * FULL_SIZE.puck_mass * (1.0 + FULL_SIZE.wall_restitution), rel=0.02)
    for time, height in heights.items():
        back = 2.0 if time < contact.time else FULL_SIZE.wall_restitution * 2.0
        assert height == pytest.approx(wall - back * abs(time - contact.time), abs=2e-4), time


@pytest.mark.parametrize(("side", "kind"), [(1, "won"), (-1, "lost")])
def test_the_end_of_a_match_and_another(side: int, kind: str) -> None:
    match = begun(points=2)
    now = BEGUN
    for _ in range(2):
        while match.resting:
            now += 0.05
            match.advance(now, None)
        shoot(match, side)
        now += 0.05
        match.advance(now, None)
    assert match.over and match.notice == kind and match.score == ((2, 0) if side > 0 else (0, 2))
    played, shown = steps(match), match.positions.copy()
    for k in range(100):
        assert match.advance(now + k, (-0.5, 0.0)) == []
    assert steps(match) == played
    np.testing.assert_array_equal(match.positions, shown)
    match.restart(now + 100.0)
    assert not match.over and match.notice == "start" and match.score == (0, 0) and match.clock == 0.0
    assert match.positions[LEFT] == pytest.approx((-0.4 * FULL_SIZE.length, 0.0))
    match.advance(now + 100.0 + START_PAUSE + 0.05, None)
    assert steps(match) > 0


def test_a_restart_in_mid_play() -> None:
    match = begun("striker")
    match.advance(BEGUN + 0.09, (-0.5, 0.3))
    match.restart(BEGUN + 0.1)
    assert match.resting and match.target is None and steps(match) == 0


def test_a_trained_policy_plays_at_the_rate_that_it_learned_at() -> None:
    asked = []

    class Policy(MlpPolicy):
        def __call__(self, observations: np.ndarray) -> np.ndarray:
            asked.append(observations.copy())
            return np.ones((1, 2), np.float32)

    policy = Policy([np.zeros((2, 13), np.float32)], [np.zeros(2, np.float32)])
    match = begun(policy, skill=0.5)
    for k in range(1, 21):
        match.advance(BEGUN + k / 20, None)
    assert abs(len(asked) - POLICY_HZ) <= 1
    assert asked[0].shape == (1, 13) and asked[0][0, 0] == pytest.approx(-0.8)  # it sees its own home
    # Forward and to its left is towards -x and -y; at half skill its paddle has half its speed.
    assert match.positions[RIGHT, 0] < 0.1 and match.positions[RIGHT, 1] < -0.4


@pytest.mark.parametrize(("name", "value"), [("right", "nobody"), ("left", "nobody"), ("points", 0), ("table", "pool")])
def test_bad_arguments_are_named(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=f"{name} must be"):
        LiveMatch(**{"right": "idle", name: value})  # type: ignore[arg-type]


# Pauses


def test_a_pause_lasts_until_the_match_is_resumed() -> None:
    match = begun("striker")
    match.advance(BEGUN + 0.05, (-0.5, 0.3))
    match.pause()
    before = match.game.get_state().tobytes()
    shown = match.positions.copy()
    assert match.advance(BEGUN + 60.0, (-0.9, -0.3)) == [] and match.notice == "paused"
    match.resume(BEGUN + 60.0)
    match.advance(BEGUN + 60.0 + 0.9 * START_PAUSE, None)
    assert match.game.get_state().tobytes() == before
    np.testing.assert_array_equal(match.positions, shown)
    match.advance(BEGUN + 60.0 + START_PAUSE + 2.5 * TICK, None)
    assert not match.resting and match.game.get_state().tobytes() != before


def test_what_is_over_is_not_paused_and_what_is_on_not_resumed() -> None:
    match = begun(points=1)
    match.resume(BEGUN)
    assert not match.resting
    shoot(match, 1)
    match.advance(BEGUN + 0.05)
    match.pause()
    assert match.notice == "won"


# Two players, and replays


@pytest.mark.parametrize("left", ["striker", "adept"])
@pytest.mark.parametrize("right", ["goalie", "expert"])
def test_two_players_play_by_themselves(left: str, right: str) -> None:
    match = LiveMatch(right, left=left, seed=3)
    now = START_PAUSE
    homes = match.positions[:PUCK].copy()
    while sum(match.score) < 2:
        now += 0.05
        assert now < 300.0
        match.advance(now)
    assert (np.abs(match.positions[:PUCK] - homes).max(axis=1) > 0.01).all()


@pytest.mark.parametrize("conditions", [{}, {"camera": "robot", "action_delay_ms": 33}], ids=["exact", "robot"])
@pytest.mark.parametrize("right", ["striker", "expert"])
def test_a_replay_of_a_match_plays_back_to_the_bit(right: str, conditions: dict[str, Any]) -> None:
    match = LiveMatch(right, seed=4, skill=0.7, points=2, recorded=True, **conditions)
    for match_number in range(2):
        now = 1000.0 * match_number
        match.restart(now)
        while not match.over:
            now += 1 / 60
            match.advance(now, (-0.9 + 0.3 * math.sin(7.0 * now), 0.3 * math.cos(5.0 * now)))
            if match_number == 0 and now > 20.0:
                break
    states = list(play_back(match.replay()))
    assert states[-1].tobytes() == game_state(match.game.get_state()).tobytes()
    assert sorted(states[-1]["score"][0])[-1] == 2
    assert len(states) == match.game.states["steps"][0] + 1


def test_the_right_player_has_the_camera_and_the_delay() -> None:
    """A policy that sees nothing and obeys late moves other ways than one that sees; the person's side is exact."""
    paths = []
    for conditions in ({}, {"camera": {"noise_mm": 100}}, {"action_delay_ms": 500}):
        match = LiveMatch("expert", seed=4, **conditions)
        for k in range(60):
            match.advance(START_PAUSE + k / 20, (-0.5, 0.1))
        assert np.array_equal(match.game.exact_observations(LEFT), match.game.out.observation[LEFT])
        paths.append(match.game.positions[0, RIGHT])
    assert len({path.tobytes() for path in paths}) == 3


def test_a_replay_ends_where_the_recording_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("airhockey_env.live.recording.MOST_SECONDS", 0.5)
    match = LiveMatch("striker", seed=4, recorded=True)
    for k in range(60):
        match.advance(START_PAUSE + k / 20, (-0.5, 0.1))
    assert len(list(play_back(match.replay()))) == 0.5 * CONTROL_HZ + 1


def test_a_match_that_was_not_recorded_has_no_replay() -> None:
    with pytest.raises(ValueError, match="recorded"):
        LiveMatch("idle").replay()
