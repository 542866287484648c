"""Cameras: what they do to a player's observations.

That every API does the same, autoreset modes and final observations included, is a matter of tests/api/test_parity.py.
"""

from __future__ import annotations

import dataclasses
import math
import re
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from airhockey_env import LEFT, RIGHT, ROBOT, AirHockeyEnv, AirHockeyVectorEnv, Camera, Game
from airhockey_env.cameras import CAMERAS as NAMED
from airhockey_env.cameras import FIELDS, ROBOTS, SLOW
from airhockey_env.kernel.camera import CAMERA_STATE, TAKEN
from airhockey_env.kernel.normal import draw_normal
from airhockey_env.kernel.observations import OTHER_PADDLE, PUCK_COLUMNS
from airhockey_env.kernel.state import SEATS
from airhockey_env.parallel_env import AirHockeyParallelEnv
from airhockey_env.saved_states import game_state
from airhockey_env.sensing import sense
from tests.helpers import COPIES, DRAWN, HEAVY, INF, NAN, ROOT, begin, pursue, random_actions, same, turned

SEEN = slice(OTHER_PADDLE.start, PUCK_COLUMNS.stop)
NOT_SEEN = [0, 1, 2, 3, 12]
STILL = np.zeros(2, np.float32)
CAMERAS = {"robot": ROBOT, "heavy": HEAVY, "slow": Camera(camera_hz=20, delay_ms=30, jitter_ms=20, noise_mm=2)}


def ideal(camera: Camera | None, control_hz: float = 50, **arguments: Any) -> AirHockeyEnv:
    """A table without losses, whose opponent stays at home."""
    return AirHockeyEnv(**{"table": "ideal", "opponent": "idle", **arguments}, control_hz=control_hz, camera=camera)


def shot(
    env: AirHockeyEnv,
    position: tuple[float, float] = (-0.3, 0.1),
    velocity: tuple[float, float] = (0.5, 0.2),
    steps: int = 40,
) -> NDArray[np.float32]:
    """(steps + 1, 13) observations of an episode that begins with a shot."""
    rows = [env.reset(seed=0, options={"puck_position": position, "puck_velocity": velocity})[0]]
    for _ in range(steps):
        observation, _, terminated, _, _ = env.step(STILL)
        assert not terminated
        rows.append(observation)
    return np.array(rows)


# Arguments


@pytest.mark.parametrize(
    ("field", "given"),
    [
        *(("camera_hz", value) for value in (0.9, 1001)),
        *(("velocity_frames", value) for value in (1, 65, 2.0)),
        *((name, value) for name in ("delay_ms", "occlusion_mm") for value in (-0.1, 1001, None, NAN)),
        *((name, value) for name in ("noise_mm", "opponent_noise_mm") for value in (-0.1, 101)),
        *(("dropout", value) for value in (-0.1, 1.1)),
        *(("jitter_ms", value) for value in (-0.1, 7.1)),
        *(("delay_ms", value) for value in ((5, 3), (-1, 3), (0, 1001), (1, None), (1, NAN), (1, 2, 3), (1,))),
        *(("velocity_frames", value) for value in ((2, 65), (2, 3.0), (None, 3), [True, 3])),
        *(("camera_hz", value) for value in ((0.5, 60), (None, 60), ())),
    ],
    ids=str,
)
def test_fields_out_of_range_are_named(field: str, given: object) -> None:
    with pytest.raises(ValueError, match=f"^{field} must be .*got {re.escape(repr(given))}"):
        AirHockeyEnv(camera={"delay_ms": 7, field: given})


def test_the_page_lists_every_field_with_its_values() -> None:
    page = (ROOT / "docs" / "sensing.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|.* \| (\S+) \| (\S+) \|$", page, flags=re.MULTILINE)
    assert [row[0] for row in rows] == [field.name for field in dataclasses.fields(Camera)]
    for name, default, robot in rows:
        assert str(getattr(Camera(), name)).removesuffix(".0") == default
        assert str(getattr(ROBOT, name)).removesuffix(".0") == robot


def test_a_camera_by_name_as_a_camera_and_by_its_fields() -> None:
    seen = [shot(AirHockeyEnv(camera=given)) for given in ("robot", ROBOT, ROBOT.fields())]
    assert same(seen[0], seen[1]) and same(seen[0], seen[2])


@pytest.mark.parametrize("wrong", ["Robot", [], ["robot"], ["robot", 3], ["robot", None, None]], ids=str)
def test_two_players_have_one_camera_or_a_pair(wrong: object) -> None:
    for make in (AirHockeyParallelEnv, partial(Game, 2)):
        with pytest.raises(ValueError, match=r"^camera must be "):
            make(camera=wrong)


def test_sense_is_the_old_way() -> None:
    new = gym.make("AirHockey-v0", camera=HEAVY)
    with pytest.warns(DeprecationWarning, match="camera="):
        old = sense(gym.make("AirHockey-v0"), HEAVY)
    assert same(old.reset(seed=3), new.reset(seed=3))
    assert same([old.step(STILL) for _ in range(20)], [new.step(STILL) for _ in range(20)])
    with pytest.warns(DeprecationWarning, match="camera="):
        sense(old, None)
    with pytest.raises(ResetNeeded):
        old.unwrapped.step(STILL)


# What a camera does


@pytest.mark.parametrize("camera", [Camera(), Camera(camera_hz=50), Camera(camera_hz=500)], ids=str)
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_perfect_camera_changes_nothing(mode: str, camera: Camera) -> None:
    arguments = {"opponent": "random", "randomize": {"length": (2.0, 2.6)}, "max_episode_steps": 20}
    envs = AirHockeyVectorEnv(20, autoreset_mode=mode, camera=camera, **arguments)
    alone = AirHockeyVectorEnv(20, autoreset_mode=mode, **arguments)
    assert same(envs.reset(seed=0), alone.reset(seed=0))
    for actions in random_actions(0, 100, 20):
        assert same(envs.step(actions), alone.step(actions))


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_own_paddle_clock_and_game_stay_what_they_are(camera: Camera) -> None:
    arguments = {"opponent": ["random", pursue], "reward": "shaped", "max_episode_steps": 60}
    envs, alone = AirHockeyVectorEnv(20, camera=camera, **arguments), AirHockeyVectorEnv(20, **arguments)
    envs.reset(seed=1), alone.reset(seed=1)
    for actions in random_actions(0, 150, 20):
        (seen, *rest), (true, *expected) = envs.step(actions), alone.step(actions)
        assert same(rest, expected) and same(seen[:, NOT_SEEN], true[:, NOT_SEEN])
        assert not same(seen[:, SEEN], true[:, SEEN]) and seen in envs.observation_space
        assert same(game_state(envs.get_state()), alone.get_state())


@pytest.mark.parametrize(("delay_ms", "steps"), [(0.1, 1), (7, 1), (20, 1), (20.5, 2), (40, 2), (100, 5), (1000, 50)])
def test_a_delay_is_rounded_up_to_whole_steps(delay_ms: float, steps: int) -> None:
    seen, true = shot(ideal(Camera(delay_ms=delay_ms)), steps=60), shot(ideal(None), steps=60)
    assert same(seen[:, SEEN], np.vstack([np.repeat(true[:1], steps, axis=0), true[:-steps]])[:, SEEN])


@pytest.mark.parametrize(
    ("camera_hz", "frames"),
    [(25, [0, 0, 2, 2, 4, 4]), (10, [0] * 5 + [5] * 5 + [10]), (12.5, [0, 0, 0, 0, 4]), (1, [0] * 50 + [50])],
)
def test_slow_cameras_hold_frames(camera_hz: float, frames: list[int]) -> None:
    seen, true = (shot(ideal(camera), steps=len(frames) - 1) for camera in (Camera(camera_hz=camera_hz), None))
    assert same(seen[:, SEEN], true[frames][:, SEEN])


@pytest.mark.parametrize(
    ("table", "position", "velocity", "steps", "error_mm"),
    [
        ("ideal", (-0.3, 0.1), (0.3, 2.9), 60, 2e-3),  # bounces off the side walls
        ("ideal", (-0.3, 0.1), (-3.0, 5.3), 20, 2e-3),
        ("full_size", (-0.5, 0.0), (10.0, 0.0), 5, 0.2),  # drag, the greatest error that is documented
    ],
)
def test_frames_between_control_steps(table: str, position: Any, velocity: Any, steps: int, error_mm: float) -> None:
    """A camera that looks at the middle of every step sees what a game of twice the rate plays then."""
    slow, fast = ideal(Camera(camera_hz=100, delay_ms=10), table=table), ideal(None, control_hz=100, table=table)
    seen, true = shot(slow, position, velocity, steps)[1:], shot(fast, position, velocity, 2 * steps)[1::2]
    half = 0.5e3 * np.array([fast.table.length, fast.table.width])
    assert np.abs((seen[:, 8:10] - true[:, 8:10]) * half).max() < error_mm
    if table == "ideal":
        np.testing.assert_allclose(seen[:, SEEN], true[:, SEEN], atol=2e-6)


def ages(camera: Camera, control_hz: float, steps: int) -> NDArray[np.float64]:
    """(steps + 1,) how old, in ms, what a camera shows of the puck is: its way at 0.2 m/s."""
    seen, true = (shot(ideal(one, control_hz), velocity=(0.2, 0.0), steps=steps) for one in (camera, None))
    assert (np.diff(seen[:, 8]) >= 0.0).all()  # frames stay in order
    return (true[:, 8].astype(np.float64) - seen[:, 8]) * 0.5 * ideal(None).table.length / 0.2 * 1e3


def test_the_age_of_what_is_seen_is_the_delay_and_the_wait_for_a_frame() -> None:
    found = ages(Camera(camera_hz=120, delay_ms=7), 50, 50)[2:]
    assert found.min() > 7 - 1e-2 and found.max() < 7 + 1000 / 120 + 1e-2
    assert np.ptp(found) > 5


def test_jitter_is_drawn_evenly_for_each_frame() -> None:
    found = ages(Camera(camera_hz=20, delay_ms=30, jitter_ms=25), 240, 400)
    drawn = found[1:][np.diff(found) < 0.0]  # of frames that arrive, rounded up to steps of 4.2 ms
    assert len(drawn) > 25
    assert 5 < drawn.min() < 12 and 50 < drawn.max() < 60 and drawn.mean() == pytest.approx(32, abs=5)
    ages(Camera(camera_hz=240, delay_ms=30, jitter_ms=25), 240, 400)  # many would overtake others


def test_noise_is_gaussian_in_mm() -> None:
    envs = AirHockeyVectorEnv(4000, camera=Camera(noise_mm=2, opponent_noise_mm=0.5))
    seen, true = envs.reset(seed=0)[0].astype(np.float64), AirHockeyVectorEnv(4000).reset(seed=0)[0]
    half = 0.5e3 * np.array([envs.table.length, envs.table.width])
    for column, sigma in ((8, 2.0), (4, 0.5)):
        errors = (seen[:, column : column + 2] - true[:, column : column + 2]) * half / sigma
        assert abs(errors.mean()) < 0.05
        assert errors.std(axis=0) == pytest.approx([1, 1], abs=0.05)
        assert (errors**4).mean() == pytest.approx(3, abs=0.4)
        assert abs(np.corrcoef(errors.T)[0, 1]) < 0.06
        assert same(seen[:, column + 2 : column + 4].astype(np.float32), true[:, column + 2 : column + 4])


def test_noise_is_in_si_units_on_every_table() -> None:
    """The scales of the observation are each table's own, and change with the episode; the noise does not."""

    def errors(**arguments: Any) -> list[NDArray[np.float64]]:
        """What is seen of the puck, in m and m/s, in the second step of some episodes in which it rests."""
        cameras = Camera(noise_mm=5, velocity_frames=2), None
        envs, alone = (AirHockeyVectorEnv(5, opponent="idle", camera=camera, **arguments) for camera in cameras)
        envs.reset(seed=1), alone.reset(seed=1)
        found = []
        for _ in range(3):
            envs.reset(), alone.reset()
            seen, true = (one.step(np.zeros((5, 2)))[0][:, PUCK_COLUMNS].astype(np.float64) for one in (envs, alone))
            tables = [envs._game.table_of(i) for i in range(5)]
            scale = [(0.5 * table.length, 0.5 * table.width, *[table.puck_speed] * 2) for table in tables]
            found.append((seen - true) * scale)
        return found

    drawn = errors(randomize={"length": (1.5, 5.0), "width": (0.8, 1.5), "puck_speed": (6.0, 20.0)})
    np.testing.assert_allclose(drawn, errors(), atol=1e-6)


def test_the_normal_distribution() -> None:
    state = np.zeros(1, CAMERA_STATE).view(np.recarray)[0]
    draws = np.array([draw_normal(state) for _ in range(100_000)])
    assert draws.mean() == pytest.approx(0, abs=0.02) and draws.std() == pytest.approx(1, abs=0.02)
    for edge in (0.25, 1.0, 2.0, 3.0, 3.7):  # beyond 3.65 is the tail, which is drawn another way
        share = math.erfc(edge / math.sqrt(2))
        assert (np.abs(draws) > edge).mean() == pytest.approx(share, abs=4 * math.sqrt(share / len(draws)))
    assert len(np.unique(draws)) > 99_990


def test_noise_cannot_leave_the_space() -> None:
    envs = AirHockeyVectorEnv(200, camera=Camera(noise_mm=100, opponent_noise_mm=100, velocity_frames=2))
    envs.reset(seed=0)
    for actions in random_actions(0, 30, 200):
        observations = envs.step(actions)[0]
        assert observations in envs.observation_space
    assert (np.abs(observations[:, SEEN]) == 1).any()


@pytest.mark.parametrize("frames", [2, 3, 6, 64])
@pytest.mark.parametrize("camera_hz", [None, 20, 120])
def test_velocities_follow_from_positions(frames: int, camera_hz: float | None) -> None:
    seen, true = shot(ideal(Camera(velocity_frames=frames, camera_hz=camera_hz))), shot(ideal(None))
    assert (seen[0, 10:12] == 0).all() and (seen[:, 6:8] == 0).all()
    np.testing.assert_allclose(seen[3:, 10:12], true[3:, 10:12], atol=1e-5)


@pytest.mark.parametrize("frames", [2, 6])
def test_the_noise_of_velocities_is_as_documented(frames: int) -> None:
    envs = AirHockeyVectorEnv(2000, opponent="idle", camera=Camera(noise_mm=1, velocity_frames=frames))
    envs.reset(seed=0)
    for _ in range(frames):
        observations = envs.step(np.zeros((2000, 2)))[0]
    deviation = observations[:, 10:12].std() * envs.table.puck_speed
    assert deviation == pytest.approx(1e-3 * 50 * math.sqrt(12 / (frames * (frames**2 - 1))), rel=0.05)


def test_lost_frames_leave_what_was_seen_last() -> None:
    seen, true = (shot(ideal(camera, control_hz=240), steps=600) for camera in (Camera(dropout=0.3), None))
    fresh, held = ((seen[1:, SEEN] == one[:, SEEN]).all(axis=1) for one in (true[1:], seen[:-1]))
    assert fresh.mean() == pytest.approx(0.7, abs=0.06) and (fresh | held).all()


def test_the_puck_is_hidden_near_the_opponents_paddle() -> None:
    way = {"position": (0.3, 0.3), "velocity": (1.0, -0.4), "steps": 70}
    env = ideal(Camera(occlusion_mm=150))
    seen, true = shot(env, **way), shot(ideal(None), **way)
    half = 0.5 * np.array([env.table.length, env.table.width])
    distances = np.linalg.norm((true[:, 8:10] - true[:, 4:6]) * half, axis=1)
    hidden = distances < 0.15 + env.table.puck_radius + env.table.paddle_radius
    assert 5 < hidden.sum() < 60
    last = np.maximum.accumulate(np.where(hidden, 0, np.arange(len(true))))
    assert same(seen[:, PUCK_COLUMNS], true[last, PUCK_COLUMNS])
    assert same(seen[:, OTHER_PADDLE], true[:, OTHER_PADDLE])


@pytest.mark.parametrize("control_hz", [10, 47.3, 240])
@pytest.mark.parametrize(
    "camera",
    [
        Camera(camera_hz=1000, delay_ms=1000, jitter_ms=1000, velocity_frames=64, dropout=0.5),
        Camera(camera_hz=1, delay_ms=1000, jitter_ms=1000, velocity_frames=2),
        Camera(camera_hz=59.94, delay_ms=16.683, jitter_ms=16.683, velocity_frames=5, noise_mm=1),
        Camera(delay_ms=1000, jitter_ms=1000, occlusion_mm=1000),
        Camera(camera_hz=(1, 1000), delay_ms=(0, 1000), jitter_ms=(0, 1000), velocity_frames=(2, 64)),
    ],
    ids=["fast", "slow", "odd", "late", "drawn"],
)
def test_there_is_room_for_all_frames_on_their_way(camera: Camera, control_hz: float) -> None:
    envs = AirHockeyVectorEnv(8, control_hz=control_hz, max_episode_steps=-1, camera=camera)
    envs.reset(seed=0)
    memory = envs._game.interfaces[LEFT].camera.arrays
    late = sum(camera.ends()[name][1] for name in ("delay_ms", "jitter_ms")) * 1e-3 * control_hz
    for actions in random_actions(0, 300, 8):
        assert envs.step(actions)[0] in envs.observation_space
        waiting, first, step = (memory.states[name] for name in ("waiting", "first", "step"))
        assert waiting.max() < memory.queue.shape[1]
        oldest = memory.queue[np.arange(8), first, TAKEN]
        assert (step - oldest <= late + 1e-6)[waiting > 0].all()
        envs.set_state(envs.get_state())  # which is a state that a camera could be in


def test_memories_end_with_their_episode() -> None:
    """Nothing of the old episode is on its way, in the estimate of a velocity, or in the bytes of the state."""
    played, fresh = (ideal(Camera(delay_ms=200, velocity_frames=6)) for _ in range(2))
    shot(played, velocity=(1.0, 0.5), steps=20)
    at_rest = {"puck_position": (-0.4, 0.0), "puck_velocity": (0.0, 0.0)}
    first = played.reset(seed=1, options=at_rest)[0]
    fresh.reset(seed=1, options=at_rest)
    assert played.get_state().tobytes() == fresh.get_state().tobytes()
    for _ in range(30):
        assert same(played.step(STILL)[0][PUCK_COLUMNS], first[PUCK_COLUMNS])
    assert (first[10:12] == 0).all()


@pytest.mark.parametrize("obs_type", ["rgb", "grayscale"])
def test_pictures_show_what_the_camera_sees(obs_type: str) -> None:
    arguments = {"autoreset_mode": "SameStep", "max_episode_steps": 15}
    drawn = AirHockeyVectorEnv(2, obs_type=obs_type, camera=HEAVY, **arguments)
    state, alone = AirHockeyVectorEnv(2, camera=HEAVY, **arguments), AirHockeyVectorEnv(2, **arguments)
    pictures_of = drawn._game.as_observations
    for env in (drawn, state, alone):
        env.reset(seed=0)
    for rows in random_actions(0, 40, 2):
        pictures, seen, true = drawn.step(rows), state.step(rows), alone.step(rows)
        assert same(pictures[0], pictures_of(seen[0])) and not same(pictures[0], pictures_of(true[0]))
        assert ("final_obs" in pictures[4]) == ("final_obs" in seen[4])
        if "final_obs" in pictures[4]:
            finals = pictures_of(np.stack(list(seen[4]["final_obs"])))
            assert same(np.stack(list(pictures[4]["final_obs"])), finals)


# Two players


def test_each_player_has_a_camera_of_its_own() -> None:
    """Either may have none, and both have other noise."""
    seen = {}
    for name, camera in (("none", None), ("left", (HEAVY, None)), ("right", [None, HEAVY]), ("both", HEAVY)):
        env = begin(AirHockeyParallelEnv(camera=camera), 21)
        seen[name] = env.observe()
        assert same(env.state(), seen["none"]["left"])  # the global state is exact
    assert same(seen["left"], {"left": seen["both"]["left"], "right": seen["none"]["right"]})
    assert same(seen["right"], {"left": seen["none"]["left"], "right": seen["both"]["right"]})
    noisy, exact = (AirHockeyParallelEnv(camera=one).reset(seed=3)[0] for one in (Camera(noise_mm=5), None))
    left, right = (np.abs(noisy[side] - exact[side])[8:10] for side in ("left", "right"))
    assert (left > 0).all() and (right > 0).all() and not np.isclose(left, right).any()


def test_a_turned_table_with_the_cameras_swapped_is_the_same_to_the_other_player() -> None:
    env, other = (AirHockeyParallelEnv(task="match", control_hz=20, camera=HEAVY) for _ in range(2))
    state = begin(env, 21).get_state()
    swapped = state.copy()
    swapped["state"] = turned(state["state"])
    for name in ("camera", "camera_queue", "camera_past"):
        swapped[f"left_{name}"], swapped[f"right_{name}"] = state[f"right_{name}"], state[f"left_{name}"]
    other.set_state(swapped)
    points = fouls = 0
    for (right,) in random_actions(3, 400, 1):
        ours, theirs = env.observe(), other.observe()
        assert same((ours["left"], ours["right"]), (theirs["right"], theirs["left"]))
        left = pursue(ours["left"][np.newaxis])[0]
        told, _ = env.step({"left": left, "right": right}), other.step({"left": right, "right": left})
        points, fouls = points + abs(told[1]["left"]), fouls + told[4]["left"]["foul"]
    assert points > 0 and fouls > 0  # there were serves too


def test_a_policy_looks_through_the_camera_of_its_seat() -> None:
    by_caller = Game(3, left=None, right=None, camera=(None, HEAVY))
    by_policy = Game(3, left=None, right=pursue, camera=(None, HEAVY))
    exact = Game(3, left=None, right=pursue)
    for game in (by_caller, by_policy, exact):
        game.reset(4)
    for actions in random_actions(0, 100, 3):
        by_caller.step(actions, pursue(by_caller.out.observation[RIGHT]))
        by_policy.step(actions)
        exact.step(actions)
        assert same(by_caller.get_state(), by_policy.get_state())
    assert not same(by_policy.positions, exact.positions)


def test_a_policy_that_comes_into_the_pool_sees_what_the_camera_has_seen() -> None:
    seen: dict[str, list[Any]] = {"late": [], "early": []}

    def watcher(name: str) -> Any:
        def watch(observations: NDArray[np.float32]) -> NDArray[np.float32]:
            seen[name].append(observations[0].copy())
            return pursue(observations)

        return watch

    games = {name: Game(2, left=None, right=["goalie", "idle"], camera=("robot", HEAVY)) for name in seen}
    games["early"].pools[RIGHT].replace(1, pursue)  # it looks on from the start, at another table
    for name, game in games.items():
        game.reset(seed=5)
        for actions in random_actions(0, 40, 2):
            game.step(actions)
        game.pools[RIGHT].replace(0, watcher(name))
        for actions in random_actions(1, 5, 2):
            game.step(actions)
    assert len(seen["late"]) == 5 and same(seen["late"], seen["early"])


# Seeds, states and copies


def test_seeds() -> None:
    env, place = AirHockeyEnv(opponent="goalie", camera=HEAVY), {"puck_position": (-0.3, 0.0)}

    def played(seed: int | None) -> list[Any]:
        return [env.reset(seed=seed, options=place)[0], *(env.step(STILL)[0] for _ in range(30))]

    first = played(3)
    assert same(played(3), first)
    starts = [first[0], *(played(seed)[0] for seed in (4, None, None))]  # without a seed, the stream goes on
    starts += [AirHockeyEnv(camera=HEAVY).reset(options=place)[0] for _ in range(2)]
    assert len({row.tobytes() for row in starts}) == 6


def test_seeds_of_some_tables() -> None:
    envs, single = AirHockeyVectorEnv(3, camera=HEAVY), AirHockeyEnv(camera=HEAVY)
    envs.reset(seed=[5, 6, 7]), single.reset(seed=6)
    assert same(envs.reset(seed=[2**70, None, 8])[0][1], single.reset()[0])
    mask = np.array([False, True, False])
    assert same(envs.reset(seed=[1, 2, 3], options={"reset_mask": mask})[0][1], single.reset(seed=2)[0])


@pytest.mark.parametrize("way", ["set_state", *COPIES])
def test_a_game_goes_on_the_same_from_a_state_and_in_a_copy(way: str) -> None:
    """With frames on their way; of the environments, tests/api/test_states.py."""
    game, other = (Game(2, left=None, right=pursue, camera=(ROBOT, HEAVY)) for _ in range(2))
    for one, seed in ((game, 1), (other, 2)):
        one.reset(seed)
        for actions in random_actions(seed, 21, 2):
            one.step(actions)
    assert all(game.interfaces[seat].camera.arrays.states["waiting"].all() for seat in SEATS)
    if way == "set_state":
        other.set_state(game.get_state())
    else:
        other = COPIES[way](game)
    assert same(other.out.observation, game.out.observation)
    for actions in random_actions(3, 60, 2):
        game.step(actions)
        assert not same(other.out.observation, game.out.observation)
        other.step(actions)
        assert same(other.out.observation, game.out.observation)
    assert same(game.get_state(), other.get_state())


# Cameras that are drawn


def drawn_cameras(envs: AirHockeyVectorEnv) -> list[Camera]:
    """The camera of every table in this episode."""
    specs = dict(zip(FIELDS, envs._game.interfaces[LEFT].camera.arrays.camera["spec"].T, strict=True))
    frames = specs.pop("velocity_frames").astype(int)
    specs["jitter_ms"] = np.minimum(specs["jitter_ms"], specs["delay_ms"])
    rows = [{name: float(values[i]) for name, values in specs.items()} for i in range(envs.num_envs)]
    return [Camera(**row, velocity_frames=int(count)) for row, count in zip(rows, frames, strict=True)]


def test_a_camera_is_drawn_evenly_for_every_table_and_episode() -> None:
    envs = AirHockeyVectorEnv(2000, camera=DRAWN)
    first, second = ([*(envs.reset(seed=seed), drawn_cameras(envs))][-1] for seed in (0, None))
    assert len({*first, *second}) == 4000
    for name, (low, high) in DRAWN.ends().items():
        values = np.array([getattr(camera, name) for camera in first])
        if name == "jitter_ms":  # at most as long as the delay
            assert values.max() > 45
            continue
        assert values.min() >= low and values.max() <= high
        shares, _ = np.histogram(values, bins=8, range=(low, high + 1 if name == "velocity_frames" else high))
        assert shares == pytest.approx(250, abs=75)
    alone = AirHockeyVectorEnv(2000)
    alone.reset(seed=0), alone.reset()
    assert same(game_state(envs.get_state()), alone.get_state())  # the camera has a stream of its own


def test_a_table_sees_as_through_the_camera_that_it_has_drawn() -> None:
    """Without noise, which is drawn from the same stream."""
    ranges = {"camera_hz": (30, 200), "delay_ms": (0, 60), "velocity_frames": (2, 9), "occlusion_mm": (0, 200)}
    arguments = {"max_episode_steps": 25, "autoreset_mode": "SameStep", "randomize": {"length": (2.0, 2.6)}}
    envs = AirHockeyVectorEnv(6, camera=ranges, **arguments)
    first = envs.reset(seed=0)[0]
    cameras = drawn_cameras(envs)
    others = [AirHockeyVectorEnv(6, camera=camera, **arguments) for camera in cameras]
    assert all(same(other.reset(seed=0)[0][i], first[i]) for i, other in enumerate(others))
    playing = np.ones(6, bool)
    for actions in random_actions(0, 25, 6):
        seen, _, terminated, truncated, infos = envs.step(actions)
        for i, other in enumerate(others):
            theirs, *_, told = other.step(actions)
            if playing[i] and not (terminated[i] or truncated[i]):
                assert same(theirs[i], seen[i])
            elif playing[i]:
                assert same(told["final_obs"][i], infos["final_obs"][i])
                playing[i] = False
    assert not playing.any() and len({*cameras, *drawn_cameras(envs)}) == 12  # the next episode has another


def test_a_range_as_wide_as_one_value_is_that_value() -> None:
    narrow = {name: [value, value] for name, value in HEAVY.fields().items()}
    assert Camera(**narrow) == HEAVY
    assert same(shot(AirHockeyEnv(camera=narrow)), shot(AirHockeyEnv(camera=HEAVY)))


@pytest.mark.parametrize("name", [name for name in NAMED if NAMED[name] != ROBOT])
def test_the_named_cameras(name: str) -> None:
    env = AirHockeyEnv(camera=name)
    seen = [env.reset(seed=seed)[0] for seed in range(3)]
    assert env._game.interfaces[LEFT].camera is not None and all(one in env.observation_space for one in seen)
    for one in (ROBOT, SLOW):  # lie in the range
        for field, (low, high) in ROBOTS.ends().items():
            assert low <= getattr(one, field) <= high


DAMAGE = {
    "first": (-1, 10**9),
    "waiting": (-1, 10**9),
    "known": (-1, 4),
    "next": (-1, 3),
    "step": (20, 22),
    "frame": (-(2**60), 2**60),
    "true": (NAN,),
    "seen": (INF,),
    "scale": (0.0, NAN, 1.0),
    "reach": (NAN,),
    "camera_queue": (NAN, INF, 1e9),
    "camera_past": (-INF,),
}


@pytest.mark.parametrize(("field", "value"), [(name, value) for name in DAMAGE for value in DAMAGE[name]])
@pytest.mark.parametrize("seat", SEATS)
def test_a_damaged_state_is_refused_and_changes_nothing(seat: int, field: str, value: float) -> None:
    refuses_damage(HEAVY, seat, field, value)


@pytest.mark.parametrize(
    ("field", "value"),
    [("spec", NAN), ("spec", 1e3), ("control_hz", 51.0), ("delay", 9.0), ("frames", 10), ("noise", INF)],
)
def test_a_damaged_camera_that_was_drawn_is_refused(field: str, value: float) -> None:
    refuses_damage(DRAWN, LEFT, field, value, "camera_drawn")


def refuses_damage(camera: Camera, seat: int, field: str, value: float, record: str = "camera") -> None:
    """A state that is damaged on one of two tables is refused, and nothing changes."""
    game = Game(2, left=None, right=None, camera=camera)
    game.reset(1)
    for left, right in random_actions(1, 21, 4).reshape(21, 2, 2, 2):
        game.step(left, right)
    before, seen = game.get_state(), game.out.observation.copy()
    state = before.copy()
    side = ("left", "right")[seat]
    array = state[f"{side}_{field}"] if field.startswith("camera") else state[f"{side}_{record}"][field]
    array[1] = value
    with pytest.raises(ValueError, match=r"^state must "):
        game.set_state(state)
    assert same(game.get_state(), before) and same(game.out.observation, seen)


def test_frames_of_one_time_have_no_slope() -> None:
    """A state is made up, whose remembered positions are all of the time of the frame that arrives next."""
    env = ideal(Camera(velocity_frames=6, delay_ms=20))
    shot(env, velocity=(0.5, 0.2), steps=10)
    state = env.get_state()
    state["left_camera_past"][..., 0] = 10.0
    env.set_state(state)
    for _ in range(3):
        assert env.step(STILL)[0] in env.observation_space


def test_a_state_of_another_camera_is_refused() -> None:
    others = {"camera": None}, {"camera": Camera(delay_ms=500)}, {"camera": HEAVY, "table": "challenge"}
    states = [begin(AirHockeyEnv(**arguments)).get_state() for arguments in others]
    env = begin(AirHockeyEnv(camera=HEAVY))
    before = env.get_state()
    for state in states:
        with pytest.raises(ValueError, match=r"^state must "):
            env.set_state(state)
        assert same(env.get_state(), before)
    with pytest.raises(ValueError, match=r"^state must "):
        begin(AirHockeyEnv()).set_state(before)
