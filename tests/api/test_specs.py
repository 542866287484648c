"""A specification survives JSON, YAML and another process: arguments that are data make an equal environment."""

from __future__ import annotations

import dataclasses
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
import yaml
from gymnasium.envs.registration import EnvSpec

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.kernel.state import LEFT, RIGHT
from airhockey_env.opponents.players import NAMES
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.parallel_env import AirHockeyParallelEnv
from airhockey_env.replay import RecordReplay, play_back
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.tables import CHALLENGE, FULL_SIZE
from tests.helpers import HEAVY, IDS, ROOT, random_actions, same

DATA = {
    "nothing": {},
    "table": {"table": dataclasses.replace(FULL_SIZE, length=2.0)},
    "fields": {"table": {**dataclasses.asdict(CHALLENGE), "puck_mass": 0.02}},
    "preset": {"table": "ideal", "reward": "shaped", "control_hz": 60.5},
    "randomize": {"randomize": {"width": (1.0, 1.2), "puck_radius": (0.03, 0.045)}},
    "opponent": {"opponent": "goalie", "opponent_skill": 0.3, "continuous": False},
    "pictures": {"obs_type": "grayscale", "render_mode": "rgb_array", "render_size": (64, 48)},
    "camera": {"camera": HEAVY, "stack": 4},
    "delay": {"action_delay_ms": (10, 50.5)},
    "drawn camera": {"camera": {"delay_ms": (5, 30), "camera_hz": (60, 200), "velocity_frames": (2, 6)}},
    "limit": {"max_episode_steps": 7},
    "no limit": {"max_episode_steps": -1},
}
POOL = {"opponent": ["striker", "goalie", "adept"], "opponent_skill": [0.2, 0.5, 1.0], "autoreset_mode": "SameStep"}


def policy(seed: int = 0, squash: bool = False) -> MlpPolicy:
    """A policy of one layer that does something else for another seed."""
    rng = np.random.default_rng(seed)
    return MlpPolicy([rng.normal(size=(2, 13)).astype(np.float32)], [np.zeros(2, np.float32)], squash=squash)


@pytest.fixture
def run(tmp_path):
    """A run's folder."""
    policy().save(tmp_path / "policy.npz")
    return tmp_path


def by_json(spec: EnvSpec) -> EnvSpec:
    return EnvSpec.from_json(spec.to_json())


def by_yaml(spec: EnvSpec) -> EnvSpec:
    spec = EnvSpec.from_json(spec.to_json())  # as data
    kwargs = yaml.safe_load(yaml.safe_dump(spec.kwargs))
    return dataclasses.replace(spec, kwargs=kwargs)


def by_pickle(spec: EnvSpec) -> EnvSpec:
    return pickle.loads(pickle.dumps(spec))


def played(env, steps=40):
    """What a game on one or several tables gives for fixed seeds and actions."""
    continuous = "Discrete" not in type(env.action_space).__name__
    n = getattr(env.unwrapped, "num_envs", 1)
    drawn = random_actions(1, steps, n, continuous)
    found = [env.reset(seed=4)]
    for actions in drawn:
        result = env.step(actions if hasattr(env.unwrapped, "num_envs") else actions[0])
        found.append(result)
        if n == 1 and (result[2] or result[3]):
            found.append(env.reset())
    return found


@pytest.mark.parametrize("way", [by_json, by_yaml, by_pickle])
@pytest.mark.parametrize("arguments", DATA.values(), ids=DATA)
def test_one_table(arguments, way):
    env = gym.make("AirHockey-v0", **arguments)
    other = gym.make(way(env.spec))
    assert other.unwrapped.table == env.unwrapped.table
    assert other.render_mode == env.render_mode
    assert same(played(env), played(other))
    if env.render_mode:
        assert same(env.render(), other.render())


@pytest.mark.parametrize("way", [by_json, by_yaml, by_pickle])
@pytest.mark.parametrize("arguments", [*DATA.values(), POOL], ids=[*DATA, "pool"])
@pytest.mark.parametrize("mode", [None, "sync"])
def test_many_tables(arguments, mode, way):
    if mode == "sync" and arguments is POOL:
        return  # a single environment has one opponent
    envs = gym.make_vec("AirHockey-v0", 3, mode, **arguments)
    others = gym.make_vec(way(envs.spec))
    assert type(others) is type(envs) and others.num_envs == 3
    assert others.get_attr("table") == envs.get_attr("table")
    assert same(played(envs), played(others))


@pytest.mark.parametrize("name", IDS)
def test_specs_are_shown_and_equal(name, run):
    arguments = {"opponent": str(run), "table": dataclasses.asdict(CHALLENGE)}
    for spec in (gym.make(name, **arguments).spec, gym.make_vec(name, 2, **arguments).spec):
        assert by_json(spec) == spec
        assert name in spec.pprint(disable_print=True, print_all=True)
    assert name in gym.pprint_registry(disable_print=True)


def test_the_other_constructors_take_the_same_data():
    table = dataclasses.asdict(CHALLENGE)
    data = {"table": table, "randomize": {"width": [0.9, 1.1]}, "render_mode": "rgb_array", "render_size": [64, 48]}
    data |= {"stack": 2, "action_delay_ms": [5, 30]}
    data["camera"] = {**HEAVY.fields(), "noise_mm": [1, 3]}
    for make in (AirHockeyParallelEnv, lambda **given: AirHockeySB3VecEnv(2, **given)):
        env, other = make(**data), make(**yaml.safe_load(yaml.safe_dump(data)))
        assert env._game.spec == other._game.spec == CHALLENGE
        assert same(env._game.ranges, other._game.ranges)
        ours, theirs = (one._game.interfaces[LEFT].camera.arrays.camera for one in (env, other))
        assert same(ours, theirs)
        assert env._game.interfaces[LEFT].stack == other._game.interfaces[LEFT].stack == 2
        assert env._game.interfaces[LEFT].delay.arrays.range.tolist() == [0.25, 1.5]
        assert env._renderer.size == other._renderer.size == (64, 48)


# An opponent in a file


def test_a_file_plays_as_its_policy_does(run):
    expected = played(AirHockeyEnv(opponent=policy()), 200)
    for given in (run, str(run), run / "policy.npz", str(run / "policy.npz")):
        assert same(played(AirHockeyEnv(opponent=given), 200), expected)
    assert same(played(gym.make(by_json(gym.make("AirHockey-v0", opponent=str(run)).spec)), 200)[0], expected[0])


def test_every_api_takes_a_file(run):
    reference = AirHockeyVectorEnv(2, opponent=policy(), autoreset_mode="SameStep")
    envs = AirHockeyVectorEnv(2, opponent=str(run), autoreset_mode="SameStep")
    sb3 = AirHockeySB3VecEnv(2, opponent=str(run))
    sb3.seed(4)
    sb3.reset()
    expected = played(reference)
    assert same(played(envs), expected)
    for actions, wanted in zip(random_actions(1, 40, 2), expected[1:], strict=True):
        assert same(sb3.step(actions)[0], wanted[0])


def test_members_of_a_pool_may_be_files(run):
    policy(1).save(run / "other.npz")
    envs = AirHockeyVectorEnv(4, opponent=["idle", str(run), run / "other.npz", str(run / "policy.npz")])
    first, second, third = envs.opponents[1:]
    assert first is third and first is not second  # one file is one policy, which is asked once
    envs.set_opponent(0, str(run / "other.npz"))
    assert envs.opponents[0] is second
    assert envs.add_opponent(run) == 4 and envs.opponents[4] is first
    envs.set_opponents([4, 4, 0, 1])
    by_policy = AirHockeyVectorEnv(4, opponent=[policy(), policy(), policy(1), policy()])
    for each in (envs, by_policy):
        each.reset(seed=4)
    for actions in random_actions(1, 60, 4):
        assert same(envs.step(actions)[:4], by_policy.step(actions)[:4])


def test_a_file_that_was_written_anew_is_read_anew(run):
    old = AirHockeyEnv(opponent=str(run))._game.pools[RIGHT].members[0]
    policy(1, squash=True).save(run / "policy.npz")
    new = AirHockeyEnv(opponent=str(run))._game.pools[RIGHT].members[0]
    assert not old.squash and new.squash


def test_a_name_is_a_name_even_beside_a_file(run, monkeypatch):
    monkeypatch.chdir(run)
    for name in NAMES:
        policy().save(run / name)
        assert AirHockeyEnv(opponent=name)._game.pools[RIGHT].members == (name,)


@pytest.mark.parametrize("change", ["missing", "empty folder", "damaged", "another file", "\0", "x" * 5000, b"striker"])
def test_what_is_no_policys_file(change, run):
    path = run / "policy.npz"
    given = {"missing": str(run / "there.npz"), "empty folder": str(run)}.get(change, str(path))
    if change == "empty folder":
        path.unlink()
    elif change == "damaged":
        path.write_bytes(path.read_bytes()[:200])
    elif change == "another file":
        path.write_text("opponent")
    elif change != "missing":
        given = change
    envs = AirHockeyVectorEnv(2)
    shown = given if isinstance(given, str) and len(given) > 1 else ""
    for ask in (
        lambda: AirHockeyEnv(opponent=given),
        lambda: AirHockeyVectorEnv(2, opponent=["idle", given]),
        lambda: AirHockeySB3VecEnv(2, opponent=given),
        lambda: envs.set_opponent(0, given),
        lambda: envs.add_opponent(given),
    ):
        with pytest.raises(ValueError, match=r"^opponent must be ") as error:
            ask()
        assert shown in str(error.value)
    assert envs.opponents == ("striker",)


def test_a_game_goes_on_in_a_copy_without_the_file(run):
    env = AirHockeyEnv(opponent=str(run))
    env.reset(seed=1)
    (run / "policy.npz").unlink()
    other = pickle.loads(pickle.dumps(env))
    for actions in random_actions(1, 40, 1):
        assert same(env.step(actions[0]), other.step(actions[0]))


def test_a_replay_needs_no_file(run, tmp_path):
    env = RecordReplay(gym.make("AirHockey-v0", opponent=str(run), max_episode_steps=30), tmp_path / "game.npz")
    env.reset(seed=1)
    for actions in random_actions(1, 30, 1):
        env.step(actions[0])
    env.close()
    (run / "policy.npz").unlink()
    assert len(list(play_back(tmp_path / "game.npz"))) >= 30


def test_another_process_makes_the_same_environment(run):
    arguments = {"opponent": str(run), "table": dataclasses.asdict(CHALLENGE), "randomize": {"width": [1.0, 1.1]}}
    env = gym.make("AirHockey-v0", **arguments)
    code = (
        "import sys, gymnasium, numpy as np, airhockey_env\n"
        "from gymnasium.envs.registration import EnvSpec\n"
        "env = gymnasium.make(EnvSpec.from_json(sys.stdin.read()))\n"
        "env.reset(seed=2)\n"
        "for _ in range(30): observation = env.step(np.array([0.5, -0.25], np.float32))[0]\n"
        "print(observation.tobytes().hex())\n"
    )
    env.reset(seed=2)
    for _ in range(30):
        observation = env.step(np.array([0.5, -0.25], np.float32))[0]
    result = subprocess.run(
        [sys.executable, "-c", code],
        input=env.spec.to_json(),
        capture_output=True,
        text=True,
        check=True,
        cwd=ROOT,
    )
    assert result.stdout.strip() == observation.tobytes().hex()
