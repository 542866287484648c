"""Bad input has its own clear error, in every face, and changes nothing."""

from __future__ import annotations

import dataclasses
import inspect
import math
import re

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.cameras import Camera
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.replay import RecordReplay, Replay, play_back, play_back_frames
from airhockey_env.saved_states import game_state
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.helpers import pursue, random_actions, same, shown

NAN, INF = math.nan, math.inf

FACES = {
    "env": lambda **arguments: AirHockeyEnv(**arguments),
    "make": lambda **arguments: gym.make("AirHockey-v0", disable_env_checker=True, **arguments).unwrapped,
    "vector": lambda **arguments: AirHockeyVectorEnv(2, **arguments),
    "make_vec": lambda **arguments: gym.make_vec("AirHockey-v0", num_envs=2, **arguments).unwrapped,
    "sb3": lambda **arguments: AirHockeySB3VecEnv(2, **arguments),
}


@pytest.fixture(params=FACES)
def make(request):
    return FACES[request.param]


def begin(env):
    """A game under way."""
    if isinstance(env, AirHockeySB3VecEnv):
        env.seed(1)
        env.reset()
    else:
        env.reset(seed=1)
    for actions in random_actions(1, 10, 2, env._game.continuous):
        env.step(actions[0] if isinstance(env, AirHockeyEnv) else actions)
    return env


def snapshot(env):
    """All that decides what follows, for every face."""
    other = env._actions if isinstance(env, AirHockeySB3VecEnv) else str(env.np_random.bit_generator.state)
    return env._game.get_state().tobytes(), other, env._game.out.observation.tobytes()


# Arguments

ARGUMENTS = [
    *(("opponent", value) for value in ("Striker", "", None, 3, ["idel"], [])),
    *(("opponent_skill", value) for value in (-0.01, 1.01, NAN, INF, "1", None, True, [0.5, [0.5]])),
    *(("task", value) for value in ("Point", None, 1, [], {}, np.zeros(2))),
    *(("table", value) for value in ("Full_size", None, 2, {})),
    *(("continuous", value) for value in (1, 0, "yes", None)),
    *(("reward", value) for value in ("Sparse", None, 1, [], np.zeros(2))),
    *(("randomize", value) for value in (1, NAN, True, "length", ["length"], {"length"}, np.zeros(2))),
    *(("control_hz", value) for value in (9.99, 240.01, 0, -50, NAN, INF, "50", None, True)),
    *(("max_episode_steps", value) for value in (0, -2, 1.5, -1.0, "9", NAN, True, 2**31)),
    *(("render_mode", value) for value in ("rgb", "ansi", 1, [], np.zeros(2))),
    *(("render_size", value) for value in ((64,), (64, 0), (64.5, 48), "big", 64)),
]


@pytest.mark.parametrize(("name", "value"), ARGUMENTS, ids=str)
def test_arguments(make, name, value):
    if name in ("max_episode_steps", "render_mode") and make is FACES["make"]:
        make = FACES["env"]  # gymnasium.make has its own errors for these
    arguments = {name: value} | ({"render_mode": "rgb_array"} if name == "render_size" else {})
    with pytest.raises(ValueError, match=rf"^{name} must be .*, got "):
        make(**arguments)


@pytest.mark.parametrize("value", [0, -1, 1.5, NAN, "2", None, True])
@pytest.mark.parametrize("face", [AirHockeyVectorEnv, AirHockeySB3VecEnv])
def test_number_of_tables(face, value):
    with pytest.raises(ValueError, match=r"^num_envs must be a whole number from 1 .*, got "):
        face(value)


@pytest.mark.parametrize("value", [0, -1, 1.5, "2", True])
@pytest.mark.parametrize("face", [AirHockeyVectorEnv, AirHockeySB3VecEnv])
def test_number_of_threads(face, value):
    with pytest.raises(ValueError, match=r"^num_threads must be a whole number from 1 .*, got "):
        face(2, num_threads=value)


@pytest.mark.parametrize("value", ["next", "NEXT_STEP", None, 1, True, []])
def test_autoreset_mode(value):
    with pytest.raises(
        ValueError, match=r"^autoreset_mode must be one of \['NextStep', 'SameStep', 'Disabled'\], got "
    ):
        AirHockeyVectorEnv(2, autoreset_mode=value)


@pytest.mark.parametrize("name", ["oponent", "player", "points", "autoreset"])  # the others are the game's own
def test_unknown_arguments(make, name):
    with pytest.raises(TypeError, match=name):
        make(**{name: 1})


def test_every_api_has_the_same_arguments():
    single, batch, sb3 = (
        inspect.signature(api).parameters for api in (AirHockeyEnv, AirHockeyVectorEnv, AirHockeySB3VecEnv)
    )
    assert set(batch) - set(single) == {"num_envs", "num_threads", "autoreset_mode"}
    assert set(batch) - set(sb3) == {"autoreset_mode"}
    for name in set(single) - {"max_episode_steps"}:  # gymnasium.make puts its own limit around a single environment
        assert single[name].default == batch[name].default == sb3[name].default, name
    assert batch["max_episode_steps"].default is sb3["max_episode_steps"].default is None


# Actions

CONTINUOUS = [
    [NAN, 0.0], [0.0, INF], [-INF, 0.0], np.array([0.0, NAN], np.float32), np.array([INF, 0.0], np.float64),
    0.5, [0.5], [0.1, 0.2, 0.3], [[[0.1, 0.2]]], [], [[0.1], [0.1, 0.2]],
    None, "left", {"x": 1.0}, [1j, 0.0], [None, 0.0],
]  # fmt: skip


def refuses(env, action, match):
    """Both ways of acting refuse an action, and nothing has changed afterwards."""
    before = snapshot(env)
    with pytest.raises(ValueError, match=match):
        env.step(action)
    assert snapshot(env) == before


@pytest.mark.parametrize("action", CONTINUOUS, ids=repr)
def test_continuous_actions(make, action):
    env = begin(make())
    if isinstance(env, AirHockeyEnv):
        refuses(env, action, "^action must be ")
        return
    refuses(env, action, "^actions must be ")
    if np.array(action, dtype=object).shape == (2,) and all(isinstance(x, float) for x in list(action)):
        refuses(env, np.stack([np.zeros(2), action]), "^actions must be finite, got (nan|inf|-inf)$")
    refuses(env, np.zeros((3, 2)), r"^actions must be an array of shape \(2, 2\), got shape \(3, 2\)")
    refuses(env, np.zeros(2), r"^actions must be an array of shape \(2, 2\), got shape \(2,\)")


@pytest.mark.parametrize("action", [-1, 9, 1.0, True, NAN, None, "1", [1, 2, 3], [[1]], [], [1, [2]], 2**70], ids=repr)
def test_discrete_actions(make, action):
    env = begin(make(continuous=False))
    if isinstance(env, AirHockeyEnv):
        refuses(env, action, "^action must be whole numbers from 0 to 8")
        return
    refuses(env, action, "^actions must be whole numbers from 0 to 8")
    if not isinstance(action, (list, bool)):
        refuses(env, [0, action], "^actions must be whole numbers from 0 to 8")
    refuses(env, [1, 2, 3], r"^actions must be whole numbers from 0 to 8, of shape \(2,\)")


def test_finite_actions_that_float32_cannot_hold_are_clipped():
    large, one = begin(AirHockeyEnv()), begin(AirHockeyEnv())
    assert same(large.step([1e300, -1e39])[0], one.step([1.0, -1.0])[0])
    large, one = begin(AirHockeyVectorEnv(2)), begin(AirHockeyVectorEnv(2))
    assert same(large.step(np.full((2, 2), -1e300))[0], one.step(np.full((2, 2), -1.0))[0])


def test_actions_of_any_real_kind_are_taken():
    given = [[1.0, -0.5], (1, -0.5), np.array([1.0, -0.5]), np.array([1.0, -0.5], ">f4"), np.array([1.0, 0, -0.5])[::2]]
    observations = [begin(AirHockeyEnv()).step(action)[0] for action in given]
    assert all(same(observation, observations[0]) for observation in observations)
    steered = [
        begin(AirHockeyEnv(continuous=False)).step(action)[0] for action in (3, np.int64(3), np.array(3), np.uint8(3))
    ]
    assert all(same(observation, steered[0]) for observation in steered)


# Resets

SEEDS = [-1, 1.5, NAN, "1", True, [], {}, -(2**70)]
OPTIONS = [
    (5, "options must be a mapping"),
    ("serve", "options must be a mapping"),
    (["serve"], "options must be a mapping"),
    ({"server": "left"}, r"options must be a mapping whose keys .*, got 'server'"),
    ({1: 2}, "options must be a mapping whose keys .*, got 1"),
    ({"serve": "Left"}, r"options\['serve'\] must be one of .*, got 'Left'"),
    ({"serve": None}, r"options\['serve'\] must be one of .*, got None"),
    ({"serve": ["left"]}, r"options\['serve'\] must be one of .*"),
    *(
        ({name: value}, rf"options\['{name}'\] must be two finite numbers, got ")
        for name in ("puck_position", "puck_velocity")
        for value in (1.0, [1.0], [0.0, 0.0, 0.0], [0.0, NAN], [INF, 0.0], "ab", [None, 0.0], {"x": 1}, [[0.0], 1.0])
    ),
    (
        {"puck_position": [1.15, 0.0]},
        r"options\['puck_position'\] must be at most .* m from the centre, got \(1.15, 0.0\)",
    ),
    ({"puck_position": [0.0, -0.54]}, r"options\['puck_position'\] must be at most .* m from the centre"),
    *(
        (
            {"puck_position": [x, 0.05]},
            rf"options\['puck_position'\] must be at least 0.0918 m from the paddle that starts at \({start}, 0\), got",
        )
        for x, start in ((-0.93, -0.9448), (0.93, 0.9448))
    ),
    ({"puck_velocity": [9.0, 9.0]}, r"options\['puck_velocity'\] must be at most 12 m/s, got \(9.0, 9.0\)"),
]


def reset(env, seed=None, options=None):
    """Reset a face with a seed and options; Stable-Baselines3 takes them before."""
    if isinstance(env, AirHockeySB3VecEnv):
        if seed is not None:
            env.seed(seed)
        if options is not None:
            env.set_options(options)
        return env.reset()
    return env.reset(seed=seed, options=options)


@pytest.mark.parametrize("seed", SEEDS, ids=repr)
def test_seeds(make, seed):
    env = begin(make())
    before = snapshot(env)
    with pytest.raises(ValueError, match=r"^seed must .*, got "):
        reset(env, seed=seed)
    assert snapshot(env) == before


@pytest.mark.parametrize(
    "seeds", [[1], [1, 2, 3], [1, -1], [1.0, 2.0], [None, "2"], [True, False], "12", [1, [2]], [1, []]], ids=repr
)
def test_seeds_of_a_batch(seeds):
    envs = begin(AirHockeyVectorEnv(2))
    before = snapshot(envs)
    with pytest.raises(ValueError, match=r"^seed must .*, got "):
        envs.reset(seed=seeds)
    assert snapshot(envs) == before


@pytest.mark.parametrize(("options", "message"), OPTIONS, ids=repr)
def test_options(make, options, message):
    env = begin(make())
    before = snapshot(env)
    if isinstance(env, AirHockeySB3VecEnv) and isinstance(options, list):
        message = "options must hold one dict for each of 2 tables, got 1"
    with pytest.raises(ValueError, match=f"^{message}"):
        reset(env, seed=5 if not isinstance(env, AirHockeySB3VecEnv) else None, options=options)
    assert snapshot(env) == before
    reset(env)  # what was refused is forgotten


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
    before = snapshot(envs)
    with pytest.raises(error, match=r"^options\['reset_mask'\] must "):
        envs.reset(seed=4, options={"reset_mask": mask})
    assert snapshot(envs) == before
    with pytest.raises((error, AssertionError)):  # the latter from Gymnasium 1.1
        theirs.reset(options={"reset_mask": mask})


# Steps before a reset and after an end


def test_step_before_reset(make):
    with pytest.raises(ResetNeeded):
        make().step(np.zeros((2, 2)) if make not in (FACES["env"], FACES["make"]) else np.zeros(2))


@pytest.mark.parametrize("face", ["env", "vector"])
def test_step_after_the_end(face):
    env = FACES[face](opponent="idle", max_episode_steps=3, **({} if face == "env" else {"autoreset_mode": "Disabled"}))
    env.reset(seed=1)
    still = np.zeros(2) if face == "env" else np.zeros((2, 2))
    for _ in range(3):
        env.step(still)
    before = snapshot(env)
    for _ in range(2):
        with pytest.raises(ResetNeeded, match="over"):
            env.step(still)
    assert snapshot(env) == before
    env.reset()
    env.step(still)


# States


def test_states():
    env, envs = begin(AirHockeyEnv()), begin(AirHockeyVectorEnv(2))
    good = envs.get_state()
    for one in (env, envs):
        before = snapshot(one)
        shape = (1 if one is env else 2,)
        for bad, got in (
            (None, "NoneType"),
            ({}, "dict"),
            (good[0], "void"),
            (good.tobytes(), "bytes"),
            (np.zeros(shape), "another kind of record"),
            (good[:0], "shape (0,)"),
            (np.concatenate([good, good]), "shape (4,)"),
            (np.zeros((2, 1)), "shape (2, 1) and another kind of record"),
        ):
            message = f"state must be what get_state returned, of shape {shape}; got {got}"
            with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
                one.set_state(bad)
        assert snapshot(one) == before
    with pytest.raises(ValueError, match=r"of shape \(1,\); got shape \(2,\)$"):
        envs.set_state(good, [0])


INDICES = [[2], [-1], [0.0], [True], [NAN], "position", ["position"], [[0]], [0, [1]], {}, [None], 2**70]


@pytest.mark.parametrize("randomize", [None, {"width": (1.0, 1.2)}], ids=["fixed", "randomized"])
@pytest.mark.parametrize("indices", INDICES, ids=repr)
def test_indices_of_states(indices, randomize):
    envs = begin(AirHockeyVectorEnv(2, randomize=randomize))
    before, state = snapshot(envs), envs.get_state()
    for refused in (lambda: envs.get_state(indices), lambda: envs.set_state(state[:1], indices)):
        with pytest.raises(ValueError, match=r"^indices must be "):
            refused()
    with pytest.raises(ValueError, match=r"^indices must be whole numbers from 0 to 1, each once, "):
        envs.set_state(state, [0, 0])
    assert snapshot(envs) == before


@pytest.mark.parametrize("randomize", [None, {"width": (1.0, 1.2)}], ids=["fixed", "randomized"])
@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        *((name, value, f"state must hold finite numbers, got another in '{name}'")
          for name in ("position", "velocity", "skill", "plan", "wander") for value in (NAN, INF)),
        ("position", 1.5, "state must have all discs on the table"),
        ("position", -1e300, "state must have all discs on the table"),
    ],
)  # fmt: skip
def test_states_that_no_table_could_be_in(name, value, message, randomize):
    """Regression: they were taken, and played on."""
    env = begin(AirHockeyEnv(randomize=randomize))
    before, state = snapshot(env), env.get_state()
    game_state(state)[name][..., -1] = value
    with pytest.raises(ValueError, match=f"^{message}"):
        env.set_state(state)
    assert snapshot(env) == before


def test_states_of_another_rate():
    """Regression: on randomized tables they brought their rate along."""
    ours, theirs = (begin(AirHockeyEnv(randomize={"width": (1.0, 1.2)}, control_hz=rate)) for rate in (50, 100))
    before = snapshot(ours)
    with pytest.raises(ValueError, match=r"^state must be of a game at control_hz 50"):
        ours.set_state(theirs.get_state())
    assert snapshot(ours) == before


# Cameras, policies and replays


@pytest.mark.parametrize("field", [field.name for field in dataclasses.fields(Camera)])
@pytest.mark.parametrize("value", ["1", [], {}, NAN, INF, -1, True, 1j, 10**400, -(10**400)], ids=shown)
def test_fields_of_a_camera(field, value):
    with pytest.raises(ValueError, match=rf"^{field} must be .*, got "):
        Camera(**{field: value})


@pytest.mark.parametrize(
    "value", [None, "ab", 3, [], [None], ["ab"], [{}], [[[1.0], [1.0, 2.0]]], [np.full((2, 13), NAN)]]
)
def test_layers_of_a_policy(value):
    good = {"weights": [np.zeros((2, 13))], "biases": [np.zeros(2)]}
    for name in good:
        with pytest.raises(ValueError, match=rf"^{name} must be "):
            MlpPolicy(**{**good, name: value})
    with pytest.raises(ValueError, match=r"^activation must be one of "):
        MlpPolicy(**good, activation=value)


@pytest.mark.parametrize("path", [None, 3.5, -1, 10**6, [], {}], ids=repr)
def test_paths(path):
    """Regression: a number was taken for that of an open file."""
    with pytest.raises(ValueError, match=re.escape(f"{path} does not hold a policy")):
        MlpPolicy.load(path)
    for read in (Replay.load, play_back):
        with pytest.raises(ValueError, match=re.escape(f"{path} does not hold a replay")):
            read(path)


@pytest.mark.parametrize("fps", ["30", [], {}, 1j, NAN, 0, -1, 51, np.zeros(2)], ids=repr)
def test_pictures_a_second_of_a_replay(fps, tmp_path):
    env = RecordReplay(AirHockeyEnv(), tmp_path / "game.npz")
    env.reset(seed=0)
    env.step(np.zeros(2))
    env.close()
    with pytest.raises(ValueError, match=r"^fps must be .* greater than 0 and at most 50.0, got "):
        play_back_frames(tmp_path / "game.npz", fps=fps)


# Opponents from outside


@pytest.mark.parametrize(
    "answer",
    [
        lambda seen: np.zeros((len(seen), 3)),
        lambda seen: np.zeros((len(seen) + 1, 2)),
        lambda seen: np.zeros(2),
        lambda seen: None,
        lambda seen: "left",
        lambda seen: np.full((len(seen), 2), NAN),
        lambda seen: np.full((len(seen), 2), -INF),
    ],
    ids=["three columns", "too many", "flat", "None", "text", "NaN", "infinite"],
)
def test_answers_of_a_callable_opponent(make, answer):
    turn = {"answer": pursue}
    env = begin(make(opponent=lambda seen: turn["answer"](seen)))
    before = snapshot(env)
    turn["answer"] = answer
    with pytest.raises(ValueError, match=r"^the opponent's actions must be "):
        env.step(np.zeros(2) if isinstance(env, AirHockeyEnv) else np.zeros((2, 2)))
    assert snapshot(env) == before


def test_errors_of_a_callable_opponent_change_nothing(make):
    def fail(seen):
        raise RuntimeError("no idea")

    turn = {"answer": pursue}
    env = begin(make(opponent=lambda seen: turn["answer"](seen)))
    before = snapshot(env)
    turn["answer"] = fail
    with pytest.raises(RuntimeError, match="no idea"):
        env.step(np.zeros(2) if isinstance(env, AirHockeyEnv) else np.zeros((2, 2)))
    assert snapshot(env) == before
