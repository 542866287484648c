"""One game behind every API: the same seeds and actions give the same bits.

Every task meets every kind of table, player and observation at least once here; the trials in tests/torture, which
compare every API with plain games, draw the rest at random.
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import os

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.game import OBS_TYPES
from airhockey_env.kernel.state import LEFT
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.parallel_env import AirHockeyParallelEnv
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.tables import FULL_SIZE
from tests.helpers import DRAWN, IDS, SHOT, handed, pursue, random_actions, same, shown

MODES = list(AutoresetMode)
VARIANTS = [
    {},
    {"reward": "shaped"},
    {"continuous": False},
    {"table": "challenge", "control_hz": 24, "opponent": "goalie"},
    {"table": "ideal", "reward": "shaped", "continuous": False, "opponent": "random"},
    {"opponent": pursue, "table": dataclasses.replace(FULL_SIZE, puck_speed=20.0)},
    {"opponent_skill": 0.3, "control_hz": 120.5},
    {"randomize": {"width": (1.0, 1.2), "puck_radius": (0.03, 0.045), "drag_quadratic": (0.0, 0.1)}},
]
SEEN_BY_CAMERA = {
    "camera": DRAWN,
    "stack": 3,
    "action_delay_ms": (0, 70),
    "opponent": pursue,
    "randomize": {"length": (2.0, 2.6), "puck_radius": (0.03, 0.045)},
}

# Steps after which some episodes have ended by themselves and some have not.
LIMITS = {"AirHockeyHit-v0": 60, "AirHockeyDefend-v0": 20}

# A puck past the own paddle, on every table that is played here.
OWN_GOAL = {"puck_position": (-0.9, 0.085), "puck_velocity": (-5.0, 0.0)}


def actions_for(envs, observations, drawn):
    """Drawn actions, with the puck chased half of the time so that there are goals."""
    observations = observations.reshape(len(observations), -1)[:, -15:]  # the newest of a stack
    chase = np.arange(len(observations)) % 2 == 0
    if isinstance(envs.single_action_space, gym.spaces.Discrete):
        angle = np.arctan2(*(observations[:, 9:7:-1] - observations[:, 1::-1]).T)
        return np.where(chase, 1 + np.round(angle / (np.pi / 4)).astype(int) % 8, drawn)
    return np.where(chase[:, None], pursue(observations), drawn)


def play(envs, steps, seed):
    """Everything that a vector environment returns, step after step; resets by mask where it does not by itself."""
    randomized = "table" in envs.reset(seed=seed)[1]  # there the puck cannot be placed
    observations, infos = envs.reset(seed=seed, options={} if randomized else dict(OWN_GOAL))
    yield observations, infos
    discrete = isinstance(envs.single_action_space, gym.spaces.Discrete)
    for drawn in random_actions(seed, steps, envs.num_envs, continuous=not discrete):
        result = envs.step(actions_for(envs, observations, drawn))
        observations, rewards, terminated, truncated, infos = result
        # Gymnasium's TimeLimit calls a goal in the very last step a truncation too; the package does not.
        yield observations, rewards, terminated, truncated & ~terminated, infos
        done = terminated | truncated
        if envs.metadata["autoreset_mode"] == AutoresetMode.DISABLED and done.any():
            observations, infos = envs.reset(options={"reset_mask": done.copy()})
            yield observations, infos


def spread(*kinds):
    """Every id with every one of the last kind, and those of the others (whose numbers share no factor) in turn."""
    *others, last = kinds
    pairs = itertools.product(IDS, last)
    return [(name, *(values[k % len(values)] for values in others), one) for k, (name, one) in enumerate(pairs)]


@pytest.mark.parametrize(
    ("name", "arguments", "mode"),
    [*spread(VARIANTS, MODES), *(("AirHockey-v0", SEEN_BY_CAMERA, mode) for mode in MODES)],
    ids=shown,
)
def test_native_batch_is_gymnasiums_batch_of_single_environments(name, arguments, mode):
    n, steps, limit = 4, 700, LIMITS.get(name, 160)
    native = gym.make_vec(name, num_envs=n, autoreset_mode=mode, max_episode_steps=limit, **arguments)
    sync = gym.make_vec(
        name, num_envs=n, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode},
        max_episode_steps=limit, **arguments,
    )  # fmt: skip
    assert isinstance(native.unwrapped, AirHockeyVectorEnv) and isinstance(sync.unwrapped, gym.vector.SyncVectorEnv)
    ends = truncations = contacts = 0
    for ours, theirs in zip(play(native, steps, 11), play(sync, steps, 11), strict=True):
        assert same(ours, theirs)
        if len(ours) == 5:
            ends += ours[2].sum() + (ours[4]["score"].sum() if name == "AirHockeyMatch-v0" else 0)
            truncations += ours[3].sum()
        contacts += native.unwrapped.n_contacts.sum()
        if mode != AutoresetMode.SAME_STEP:  # there the single environments have been reset meanwhile
            assert same(native.get_attr("contacts"), sync.get_attr("contacts"))
    assert min(ends, truncations) > 0 and contacts > 25
    sync.close()


SWIFT = dataclasses.replace(FULL_SIZE, paddle_speed=15.0, paddle_acceleration=500.0, puck_speed=20.0)
KINDS = {
    "plain": {},
    "another table": {"table": "challenge", "control_hz": 24, "reward": "shaped"},
    "a swift table": {"table": SWIFT, "control_hz": 120, "opponent_skill": 0.5},
    "randomized": {"randomize": {"width": (1.0, 1.2), "puck_radius": (0.03, 0.045), "paddle_speed": (3.0, 9.0)}},
    "a camera": {"camera": DRAWN, "stack": 2, "action_delay_ms": [10, 50]},
    "a pool": {"opponent": ["striker", pursue, "random"], "reward": "shaped"},
}


SEEN = [*OBS_TYPES, "rgb", "state"]
CONTINUOUS = [True, False, True, False, False, True, True]


@pytest.mark.parametrize(("name", "obs_type", "continuous", "kind"), spread(SEEN, CONTINUOUS, KINDS), ids=shown)
def test_every_api_gives_the_same_bits(name, obs_type, continuous, kind):
    """Single environments, both kinds of batches and Stable-Baselines3's; PettingZoo's is in test_parallel_env."""
    n, kind = 3, KINDS[kind]
    arguments = {"obs_type": obs_type, "continuous": continuous, "max_episode_steps": 30, **kind}
    pool = [{"opponent": member} for member in kind.get("opponent", ())] or [{}] * n
    singles = [gym.make(name, **{**arguments, **one}) for one in pool]
    batch = gym.make_vec(name, num_envs=n, autoreset_mode="SameStep", **arguments)
    by_hand = gym.make_vec(name, num_envs=n, autoreset_mode="Disabled", **arguments)
    sb3 = AirHockeySB3VecEnv(n, **{**gym.spec(name).kwargs, **arguments})
    sb3.seed(30)

    def for_sb3(pictures):
        return pictures[..., None] if obs_type == "grayscale" and "stack" not in kind else pictures

    observations, _ = batch.reset(seed=30)
    assert same(observations, np.stack([env.reset(seed=30 + i)[0] for i, env in enumerate(singles)]))
    assert same(observations, by_hand.reset(seed=30)[0]) and same(for_sb3(observations), sb3.reset())
    ends = contacts = 0
    for drawn in random_actions(9, 90, n, continuous):
        actions = actions_for(batch, batch.unwrapped._game.out.observation[LEFT], drawn)
        results = [env.step(action) for env, action in zip(singles, actions, strict=True)]
        observations, rewards, terminated, truncated, infos = batch.step(actions)
        seen, earned, dones, details = sb3.step(actions)
        last, *signals, told = by_hand.step(actions)
        done = terminated | truncated
        assert same(signals, [rewards, terminated, truncated])
        assert same((seen, earned, dones), (for_sb3(observations), rewards.astype(np.float32), done))
        hits = [env.unwrapped.contacts for env in singles]
        contacts += sum(map(len, hits))
        for theirs in (batch.unwrapped, by_hand.unwrapped, sb3):
            assert same([row[:k] for row, k in zip(theirs.contacts, theirs.n_contacts, strict=True)], hits)
        for theirs in (by_hand.unwrapped, *([] if done.any() else [batch.unwrapped, sb3])):
            assert same(theirs.positions, np.stack([env.unwrapped.positions for env in singles]))
            assert same(theirs.velocities, np.stack([env.unwrapped.velocities for env in singles]))
        for i, (observation, reward, over, cut, info) in enumerate(results):
            assert (reward, over, cut and not over) == (rewards[i], terminated[i], truncated[i])
            assert same(observation, last[i])
            assert same(observation, infos["final_obs"][i] if done[i] else observations[i])
            table = info.get("table", {})
            final = {"terminal_observation": for_sb3(observation), "TimeLimit.truncated": bool(truncated[i]), **info}
            assert same(details[i], final if done[i] else {})
            info.pop("table", None)
            for theirs in (told, infos["final_info"] if done[i] else infos):
                assert same(info, {key: theirs[key][i] for key in info})
                assert all(theirs["table"][field][i] == value for field, value in table.items())
            if done[i]:
                assert same(singles[i].reset()[0], observations[i])
        if done.any():
            ends += done.sum()
            assert same(by_hand.reset(options={"reset_mask": done})[0], observations)
    assert ends >= 9 and contacts > 2


def fingerprints(n, threads, **arguments):
    """Hashes of all that the first 1, 7, 1500 and 5000 of `n` tables return."""
    envs = AirHockeyVectorEnv(n, num_threads=threads, max_episode_steps=40, autoreset_mode="SameStep", **arguments)
    first, _ = envs.reset(seed=99)
    digests = {rows: hashlib.sha256(first[:rows].tobytes()) for rows in (1, 7, 1500, 5000) if rows <= n}
    for drawn in random_actions(7, 90, 5000, arguments.get("continuous", True)):
        *arrays, infos = envs.step(drawn[:n])
        final = infos.get("final_info", {"score": np.zeros((n, 2), np.int32)})
        for rows, digest in digests.items():
            for array in (*arrays, infos["score"], final["score"]):
                digest.update(array[:rows].tobytes())
    for rows, digest in digests.items():
        digest.update(envs.get_state()[:rows].tobytes())
    return {(rows, digest.hexdigest()) for rows, digest in digests.items()}


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"reward": "shaped", "continuous": False, "opponent": pursue},
        {"camera": "robots", "stack": 3, "action_delay_ms": (0, 40)},
    ],
    ids=shown,
)
@pytest.mark.usefixtures("small_parts")
def test_neither_batch_size_nor_threads_matter(arguments):
    sizes = [(n, threads) for n in (5000, 1500, 7, 1) for threads in ((1, 2, 3) if n > 1000 else (1, 3))]
    found = {size: fingerprints(*size, **arguments) for size in sizes}
    assert [size for size in sizes if not found[size] <= found[5000, 1]] == []


# Ends of episodes


def truncated_by(env):
    """The step that truncates an episode, or None: gymnasium.make's own limit, or that of the environment in it."""
    if hasattr(env, "get_wrapper_attr") and env.has_wrapper_attr("_max_episode_steps"):
        return env.get_wrapper_attr("_max_episode_steps")
    env = env.unwrapped
    still = handed(env, np.zeros((2, 2)))
    for limit in sorted({7, 2**31 - 2, *(task.max_episode_steps for task in TASKS.values())}):
        env.reset()
        truncated = []
        for age in (limit - 2, limit - 1):
            state = env.get_state()
            state["steps"] = age
            env.set_state(state)
            result = env.step(still)
            ends = result[2] if isinstance(env, AirHockeySB3VecEnv) else result[3]
            truncated.append(bool(np.all(list(ends.values()) if isinstance(ends, dict) else ends)))
        if any(truncated):
            assert truncated == [False, True]
            return limit
    return None


WAYS = {
    "make": lambda name, **limit: gym.make(name, **limit),
    "native": lambda name, **limit: gym.make_vec(name, num_envs=2, **limit),
    "sync": lambda name, **limit: gym.make_vec(name, 2, "sync", **limit).envs[1],
    "single": lambda name, **limit: AirHockeyEnv(**gym.spec(name).kwargs, **limit),
    "batch": lambda name, **limit: AirHockeyVectorEnv(2, **gym.spec(name).kwargs, **limit),
    "sb3": lambda name, **limit: AirHockeySB3VecEnv(2, **gym.spec(name).kwargs, **limit),
    "parallel": lambda name, **limit: AirHockeyParallelEnv(task=gym.spec(name).kwargs.get("task", "point"), **limit),
}


FOR_TWO = ("AirHockey-v0", "AirHockeyMatch-v0")


@pytest.mark.parametrize(
    ("name", "way"), [(name, way) for name in IDS for way in WAYS if way != "parallel" or name in FOR_TWO]
)
def test_a_time_limit_means_the_same_in_every_api(name, way):
    """The limit means what it means in Gymnasium: None is what the id registers, and -1 is no limit."""
    registered = gym.spec(name).max_episode_steps
    make = WAYS[way]
    assert truncated_by(make(name, max_episode_steps=None)) == registered
    assert truncated_by(make(name, max_episode_steps=-1)) is None
    assert truncated_by(make(name, max_episode_steps=7)) == 7
    # gymnasium.make puts its own limit around the class, which therefore has none unless it is given.
    assert truncated_by(make(name)) == (None if way == "single" else registered)


@pytest.mark.parametrize(("limit", "terminates"), [(1, False), (2, True), (3, True), (None, True)])
def test_a_goal_in_the_last_step_terminates_and_is_no_truncation(limit, terminates):
    still = np.zeros(2, np.float32)
    single = AirHockeyEnv(opponent="idle", max_episode_steps=limit)
    batch = AirHockeyVectorEnv(2, opponent="idle", max_episode_steps=limit)
    same_step = AirHockeyVectorEnv(2, opponent="idle", max_episode_steps=limit, autoreset_mode="SameStep")
    sb3 = AirHockeySB3VecEnv(2, opponent="idle", max_episode_steps=limit)
    sb3.set_options(SHOT)
    sb3.reset()
    for env in (single, batch, same_step):
        env.reset(seed=0, options=SHOT)
    for _ in range(2 if terminates else 1):
        _, reward, terminated, truncated, info = single.step(still)
        _, rewards, terminations, truncations, infos = batch.step(np.zeros((2, 2)))
        *_, final = same_step.step(np.zeros((2, 2)))
        _, earned, dones, details = sb3.step(np.zeros((2, 2)))
    told = (reward, terminated, truncated, info["is_success"])
    assert told == (float(terminates), terminates, not terminates, terminates)
    assert rewards.tolist() == earned.tolist() == [reward] * 2
    assert terminations.tolist() == infos["is_success"].tolist() == [terminates] * 2
    assert truncations.tolist() == [not terminates] * 2
    assert dones.all()
    assert final["final_info"]["is_success"].tolist() == [terminates] * 2
    assert [detail["is_success"] for detail in details] == [terminates] * 2
    assert [detail["TimeLimit.truncated"] for detail in details] == [not terminates] * 2


def test_gym_makes_time_limit_keeps_a_goal_in_the_last_step():
    env = gym.make("AirHockey-v0", opponent="idle", max_episode_steps=2)
    env.reset(seed=0, options=SHOT)
    assert env.step(np.zeros(2, np.float32))[1:4] == (0.0, False, False)
    _, reward, terminated, _, info = env.step(np.zeros(2, np.float32))
    assert (reward, terminated, info["is_success"]) == (1.0, True, True)


# Resets of some tables


def test_reset_mask_touches_the_masked_tables_only():
    envs = AirHockeyVectorEnv(4, autoreset_mode="Disabled", opponent="idle")
    envs.reset(seed=1)
    for actions in random_actions(2, 60, 4):
        before, *_ = envs.step(actions)
    state = envs.get_state()
    mask = np.array([True, False, True, False])
    options = {"reset_mask": mask, "serve": "right"}
    after, infos = envs.reset(seed=[5, None, None, 7], options=options)
    assert set(options) == {"reset_mask", "serve"} and mask.tolist() == [True, False, True, False]
    assert (envs.get_state()[~mask] == state[~mask]).all()
    assert same(after[~mask], before[~mask])
    assert (after[mask, 8] > 0.0).all() and (after[mask][:, [2, 3, 10, 11]] == 0.0).all()
    for key in ("score", "foul", "is_success"):
        assert infos[f"_{key}"].tolist() == mask.tolist()
    fresh = AirHockeyEnv()
    assert same(after[0], fresh.reset(seed=5, options={"serve": "right"})[0])


def test_tables_that_never_began_are_not_played():
    envs = AirHockeyVectorEnv(3)
    actions = np.zeros((3, 2))
    for _ in range(2):
        envs.reset(seed=3, options={"reset_mask": np.array([True, False, False])})
        with pytest.raises(ResetNeeded):
            envs.step(actions)
    envs.reset(options={"reset_mask": np.array([False, True, True])})
    streams = envs.get_state()["stream"]
    assert len(set(streams.tolist())) == 3
    observations, *_ = envs.step(actions)
    assert (np.abs(observations[:, 0]) > 0.5).all()


def test_an_action_that_lies_spread_out_or_is_read_only_plays_as_its_values_do() -> None:
    """The compiled step is called without a look at how its arguments lie in memory."""
    rng = np.random.default_rng(0)
    spread, plain = gym.make("AirHockey-v0"), gym.make("AirHockey-v0")
    spread.reset(seed=0)
    plain.reset(seed=0)
    for _ in range(20):
        actions = rng.uniform(-1.0, 1.0, (2, 3)).astype(np.float32)
        actions.flags.writeable = False
        seen, expected = spread.step(actions[:, 1]), plain.step(actions[:, 1].copy())
        np.testing.assert_array_equal(seen[0], expected[0])


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="needs processor affinity")
def test_a_batch_takes_the_cores_that_its_process_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {3, 7, 9})
    monkeypatch.setattr(os, "cpu_count", lambda: 64)
    assert AirHockeyVectorEnv(2)._game._threads.num_threads == 3
