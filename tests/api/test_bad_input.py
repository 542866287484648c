"""Bad input has an error that names the argument, in every API, and changes nothing.

What an argument may be is checked with one class; what counts as a number is in test_checks; that bad input in the
middle of any game changes nothing is what the trials in tests/torture check too. Of every API there are examples here.
"""

from __future__ import annotations

import inspect

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.parallel_env import AirHockeyParallelEnv
from airhockey_env.replay import RecordReplay, Replay, play_back, play_back_frames
from airhockey_env.saved_states import game_state
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.api.apis import APIS
from tests.helpers import INF, NAN, begin, handed, pursue, same, shown, snapshot

RANDOMIZE = {"randomize": {"width": (1.0, 1.2)}}
STILL = np.zeros((2, 2), np.float32)


@pytest.fixture(params=APIS.values(), ids=APIS)
def make(request):
    return request.param


def refuses(env, work, match, error=ValueError):
    """Some work with an environment is refused, and nothing has changed afterwards."""
    before = snapshot(env)
    with pytest.raises(error, match=match):
        work()
    assert snapshot(env) == before


# Arguments

ARGUMENTS = {
    "num_envs": (0, 1.5, None),
    "num_threads": (0, 1.5, "2"),
    "autoreset_mode": ("next", "NEXT_STEP", None, 1, []),
    "opponent": ("Striker", "", None, 3, ["idel"], []),
    "opponent_skill": (-0.01, 1.01, "1", [0.5, [0.5]], [0.5, 0.5, 0.5]),
    "task": ("Point", None, 1, [], {}, np.zeros(2)),
    "table": ("Full_size", None, 2, {}),
    "obs_type": ("RGB", "pixels", None, ["rgb"], np.array(["rgb", "state"])),
    "continuous": (1, "yes", None),
    "reward": ("Sparse", None, [], np.zeros(2)),
    "randomize": (1, "length", ["length"], {"length"}, np.zeros(2)),
    "camera": ("phone", 3, {"blur": 1}, [None], "robots "),
    "stack": (0, 65, 2.0, "2", None),
    "action_delay_ms": (-1, 1001, "5", None, [5], [3, 2], (0, 1001), (1, None), NAN),
    "control_hz": (9.99, 240.01, "50", None),
    "max_episode_steps": (0, -2, -1.0, 2**31),
    "render_mode": ("ansi", "rgb", 1, [], np.zeros(2)),
    "render_size": ((64,), (64, 0), (64.5, 48), "big", 64),
}


@pytest.mark.parametrize(
    ("name", "value"), [(name, value) for name, values in ARGUMENTS.items() for value in values], ids=str
)
def test_arguments(name, value):
    with pytest.raises(ValueError, match=rf"^{name} .*got "):
        AirHockeyVectorEnv(**{"num_envs": 2, "render_mode": "rgb_array", name: value})


@pytest.mark.parametrize("api", [AirHockeyEnv, AirHockeyVectorEnv, AirHockeySB3VecEnv, AirHockeyParallelEnv])
def test_every_argument_of_every_api_is_checked(api):
    names = inspect.signature(api).parameters
    assert set(names) <= set(ARGUMENTS)
    good = {"render_mode": "rgb_array"} | ({"num_envs": 2} if "num_envs" in names else {})
    for name in names:
        with pytest.raises(ValueError, match=rf"^{name} .*got "):
            api(**{**good, name: ARGUMENTS[name][0]})


def test_every_api_has_the_same_arguments():
    single, batch, sb3, parallel = (
        inspect.signature(api).parameters
        for api in (AirHockeyEnv, AirHockeyVectorEnv, AirHockeySB3VecEnv, AirHockeyParallelEnv)
    )
    assert set(batch) - set(single) == {"num_envs", "num_threads", "autoreset_mode"}
    assert set(batch) - set(sb3) == {"autoreset_mode"}
    assert set(single) - set(parallel) == {"opponent", "opponent_skill"}
    for name in set(single) - {"max_episode_steps"}:  # gymnasium.make puts its own limit around a single environment
        assert single[name].default == batch[name].default == sb3[name].default, name
    assert batch["max_episode_steps"].default is sb3["max_episode_steps"].default is None


# Actions

VELOCITIES = [
    [NAN, 0.0], [0.0, -INF], np.array([0.0, NAN], np.float32), 0.5, [0.1, 0.2, 0.3], [[0.1, 0.2]], [], [[0.1], [1, 2]],
    None, "left", {"x": 1.0}, [1j, 0.0], [None, 0.0],
]  # fmt: skip
DIRECTIONS = [-1, 9, 1.0, NAN, None, "1", [1], [1, [2]], 2**70]


@pytest.mark.parametrize("continuous", [True, False])
def test_actions(make, continuous):
    env = begin(make(continuous=continuous))
    good = STILL[0] if continuous else 0
    for bad in VELOCITIES if continuous else DIRECTIONS:
        refuses(env, lambda bad=bad: env.step(handed(env, [bad, good])), r"^actions?\b.*got ")
    env.step(handed(env, [good, good]))


@pytest.mark.parametrize("api", ["batch", "sb3"])
@pytest.mark.parametrize("actions", [np.zeros((3, 2)), np.zeros(2), None])
def test_actions_of_a_batch(api, actions):
    env = begin(APIS[api]())
    refuses(env, lambda: env.step(actions), r"^actions .*\(2, 2\), got ")


@pytest.mark.parametrize("actions", [None, 3, [], STILL, {}, {"left": STILL[0]}, {"left": STILL[0], "Right": STILL[0]}])
def test_actions_of_two_players(actions):
    env = begin(AirHockeyParallelEnv())
    refuses(env, lambda: env.step(actions), r"^actions .*'left', 'right'.*got ")


@pytest.mark.parametrize("given", [[1e300, -1e39], [1.5, -7.0]])
def test_finite_actions_out_of_range_are_clipped(make, given):
    wild, tame = begin(make()), begin(make())
    assert same(wild.step(handed(wild, [given] * 2)), tame.step(handed(tame, [[1.0, -1.0]] * 2)))


def test_actions_of_any_real_kind_are_taken():
    velocities = [[1.0, -0.5], (1, -0.5), np.array([1, -0.5], ">f4"), np.array([1.0, 0, -0.5])[::2]]
    for continuous, actions in ((True, velocities), (False, [3, np.int64(3), np.array(3), np.uint8(3)])):
        observations = [begin(AirHockeyEnv(continuous=continuous)).step(action)[0] for action in actions]
        assert all(same(observation, observations[0]) for observation in observations)


# Resets

SEEDS = [-1, 1.5, "1", True, [], {}]
PUCKS = [1.0, [1.0], [0.0, 0.0, 0.0], [0.0, NAN], [INF, 0.0], "ab", [None, 0.0], {"x": 1}, [[0.0], 1.0]]
OPTIONS = [
    *((options, "options") for options in (5, "serve", ["serve"], {1: 2}, {"server": "left"})),
    *(({"serve": value}, r"options\['serve'\]") for value in ("Left", None, ["left"])),
    *(({name: value}, rf"options\['{name}'\]") for name in ("puck_position", "puck_velocity") for value in PUCKS),
    *(({"puck_position": place}, r"options\['puck_position'\]") for place in ([1.15, 0.0], [0.0, -0.54])),
    ({"puck_velocity": [9.0, 9.0]}, r"options\['puck_velocity'\].* 12 "),
    # In a paddle: it starts at 0.8 of the way to its end wall.
    *(({"puck_position": [x, 0.05]}, rf"options\['puck_position'\].*\({x:.1f}") for x in (-0.9, 0.9)),
]


def reset(env, seed=None, options=None):
    """Reset an environment with a seed and options; Stable-Baselines3 takes them before."""
    if isinstance(env, AirHockeySB3VecEnv):
        if seed is not None:
            env.seed(seed)
        if options is not None:
            env.set_options(options)
        return env.reset()
    return env.reset(seed=seed, options=options)


def test_seeds_and_options(make):
    env = begin(make())
    for seed in SEEDS:
        refuses(env, lambda seed=seed: reset(env, seed=seed), r"^seed .*got ")
    for options, name in OPTIONS:
        if not (isinstance(env, AirHockeySB3VecEnv) and isinstance(options, list)):  # one for each table, there
            seed = None if isinstance(env, AirHockeySB3VecEnv) else 5
            refuses(env, lambda o=options, s=seed: reset(env, s, o), f"^{name}.*got ")
    reset(env)  # what was refused is forgotten


@pytest.mark.parametrize("seeds", [[1], [1, 2, 3], [1, -1], [1.0, 2.0], [None, "2"], "12", [1, [2]]], ids=repr)
def test_seeds_of_a_batch(seeds):
    envs = begin(AirHockeyVectorEnv(2))
    refuses(envs, lambda: envs.reset(seed=seeds), r"^seed .*got ")


def test_options_of_a_batch_for_stable_baselines():
    envs = begin(AirHockeySB3VecEnv(2))
    refuses(envs, lambda: envs.set_options([{"serve": "left"}]), r"^options .* 2 .*got 1$")


@pytest.mark.parametrize(
    ("mask", "error"),
    [
        ([True, False], TypeError),
        (np.array([1, 0]), TypeError),
        ("10", TypeError),
        (np.array([True]), ValueError),
        (np.array([[True, False]]), ValueError),
        (np.array([False, False]), ValueError),
    ],
    ids=repr,
)
def test_reset_masks_as_gymnasium_has_it(mask, error):
    envs, theirs = begin(AirHockeyVectorEnv(2)), gym.make_vec("AirHockey-v0", 2, "sync")
    refuses(envs, lambda: envs.reset(seed=4, options={"reset_mask": mask}), r"^options\['reset_mask'\] ", error)
    with pytest.raises((error, AssertionError)):  # the latter from Gymnasium 1.1
        theirs.reset(options={"reset_mask": mask})


def test_step_before_reset_and_after_the_end(make):
    disabled = {"autoreset_mode": "Disabled"} if make is APIS["batch"] else {}
    env = make(max_episode_steps=3, **disabled)
    still = handed(env, STILL)
    with pytest.raises(ResetNeeded):
        env.step(still)
    env.reset()
    for _ in range(3):
        env.step(still)
    if make is not APIS["sb3"]:  # begins the next episode by itself
        for _ in range(2):
            refuses(env, lambda: env.step(still), "over", ResetNeeded)
    env.reset()
    env.step(still)


# States


@pytest.mark.parametrize("arguments", [{}, RANDOMIZE, {"camera": "robot"}], ids=str)
def test_states(make, arguments):
    env = begin(make(**arguments))
    good = env.get_state()
    for bad, got in (
        (None, "NoneType"),
        ({}, "dict"),
        (good[0], "void"),
        (good.tobytes(), "bytes"),
        (np.zeros(good.shape), "another kind of record"),
        (good[:0], r"shape \(0,\)"),
        (np.concatenate([good, good]), rf"shape \({2 * len(good)},\)"),
        (begin(make()).get_state() if arguments else begin(make(**RANDOMIZE)).get_state(), "another kind of record"),
    ):
        refuses(env, lambda bad=bad: env.set_state(bad), rf"^state .*got {got}")


@pytest.mark.parametrize("randomize", [{}, RANDOMIZE], ids=["fixed", "randomized"])
@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, value) for name in ("position", "velocity", "skill", "plan", "wander") for value in (NAN, INF)),
        ("position", 1.5),
        ("position", -1e300),
    ],
)
def test_states_that_no_table_could_be_in(name, value, randomize):
    """Regression: they were taken, and played on."""
    env = begin(AirHockeyEnv(**randomize))
    state = env.get_state()
    game_state(state)[name][..., -1] = value
    refuses(env, lambda: env.set_state(state), rf"^state .*'{name}'")


def test_states_of_another_rate():
    """Regression: on randomized tables they brought their rate along."""
    ours, theirs = (begin(AirHockeyEnv(**RANDOMIZE, control_hz=rate)) for rate in (50, 100))
    refuses(ours, lambda: ours.set_state(theirs.get_state()), "^state .*control_hz 50")


@pytest.mark.parametrize("randomize", [{}, RANDOMIZE], ids=["fixed", "randomized"])
@pytest.mark.parametrize(
    "indices", [[2], [-1], [0.0], [True], "position", ["position"], [[0]], [0, [1]], {}, [None], 2**70], ids=repr
)
def test_indices_of_states(indices, randomize):
    envs = begin(AirHockeyVectorEnv(2, **randomize))
    state = envs.get_state()
    refuses(envs, lambda: envs.get_state(indices), "^indices ")
    refuses(envs, lambda: envs.set_state(state[:1], indices), "^indices ")
    refuses(envs, lambda: envs.set_state(state, [0, 0]), "^indices ")


# Policies, replays, and opponents from outside


@pytest.mark.parametrize(
    "value", [None, "ab", 3, [], [None], ["ab"], [{}], [[[1.0], [1.0, 2.0]]], [np.full((2, 13), NAN)]], ids=shown
)
def test_layers_of_a_policy(value):
    good = {"weights": [np.zeros((2, 13))], "biases": [np.zeros(2)]}
    for name in (*good, "activation"):
        with pytest.raises(ValueError, match=rf"^{name} must be "):
            MlpPolicy(**{**good, name: value})


@pytest.mark.parametrize("path", [None, 3.5, -1, 10**6, [], {}], ids=repr)
@pytest.mark.parametrize("read", [MlpPolicy.load, Replay.load, play_back])
def test_paths(read, path):
    """Regression: a number was taken for that of an open file."""
    with pytest.raises(ValueError) as error:  # noqa: PT011  which starts with what was given
        read(path)
    assert str(error.value).startswith(f"{path} ")


@pytest.mark.parametrize("fps", ["30", 0, -1, 51], ids=repr)
def test_pictures_a_second_of_a_replay(fps, tmp_path):
    env = RecordReplay(AirHockeyEnv(), tmp_path / "game.npz")
    env.reset(seed=0)
    env.step(np.zeros(2))
    env.close()
    with pytest.raises(ValueError, match=r"^fps .*50.*got "):
        play_back_frames(tmp_path / "game.npz", fps=fps)


def fails(seen):
    raise RuntimeError("no idea")


@pytest.mark.parametrize("api", ["single", "batch", "sb3"])
def test_answers_of_a_callable_opponent(api):
    answers = [pursue]
    env = begin(APIS[api](opponent=lambda seen: answers[-1](seen)))
    for answer in (np.zeros((3, 2)), np.zeros(2), None, "left", np.full((env._game.num_tables, 2), NAN)):
        answers.append(lambda seen, answer=answer: answer)
        refuses(env, lambda: env.step(handed(env, STILL)), "opponent's actions .*got ")
    answers.append(fails)
    refuses(env, lambda: env.step(handed(env, STILL)), "no idea", RuntimeError)
