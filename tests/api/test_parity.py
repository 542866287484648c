"""One game behind every face: the same seeds and actions give the same bits."""

from __future__ import annotations

import dataclasses
import hashlib
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
from tests.helpers import IDS, pursue, random_actions, same, shown

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

# Steps after which some episodes have ended by themselves and some have not.
LIMITS = {"AirHockeyHit-v0": 60, "AirHockeyDefend-v0": 20}

# A puck past the idle opponent's paddle that is in the goal in the second step at 50 Hz.
SHOT = {"puck_position": (1.0, 0.1), "puck_velocity": (5.0, 0.0)}
# One past the own paddle, on every table that is played here.
OWN_GOAL = {"puck_position": (-0.9, 0.085), "puck_velocity": (-5.0, 0.0)}


def actions_for(envs, observations, drawn):
    """Drawn actions, with the puck chased half of the time so that there are goals."""
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


@pytest.mark.parametrize("arguments", VARIANTS, ids=shown)
@pytest.mark.parametrize("mode", MODES, ids=str)
@pytest.mark.parametrize("name", IDS)
def test_native_batch_is_gymnasiums_batch_of_single_environments(name, mode, arguments):
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


@pytest.mark.parametrize("arguments", VARIANTS, ids=shown)
def test_gym_make_is_a_row_of_the_batch(arguments):
    n = 3
    envs = gym.make_vec("AirHockey-v0", num_envs=n, **arguments)
    singles = [gym.make("AirHockey-v0", **arguments) for _ in range(n)]
    drawn = random_actions(4, 500, n, arguments.get("continuous", True))
    observations, _ = envs.reset(seed=21)
    over = np.zeros(n, bool)
    assert same(observations, np.stack([env.reset(seed=21 + i)[0] for i, env in enumerate(singles)]))
    for step in range(500):
        actions = actions_for(envs, observations, drawn[step])
        observations, rewards, terminated, truncated, _ = envs.step(actions)
        for i, env in enumerate(singles):
            expected = (env.reset()[0], 0.0, False, False) if over[i] else env.step(actions[i])[:4]
            assert same((observations[i], *(float(x[i]) for x in (rewards, terminated, truncated))),
                        (expected[0], *map(float, expected[1:])))  # fmt: skip
        assert (envs.unwrapped.positions == np.stack([env.unwrapped.positions for env in singles])).all()
        assert (envs.unwrapped.velocities == np.stack([env.unwrapped.velocities for env in singles])).all()
        over = terminated | truncated
    envs.close()


@pytest.mark.parametrize("arguments", VARIANTS, ids=shown)
def test_stable_baselines_batch_is_the_same_step_batch(arguments):
    n, limit = 5, 120
    envs = gym.make_vec("AirHockey-v0", num_envs=n, autoreset_mode="SameStep", max_episode_steps=limit, **arguments)
    sb3 = AirHockeySB3VecEnv(n, max_episode_steps=limit, **arguments)
    sb3.seed(5)
    observations, _ = envs.reset(seed=5)
    assert same(sb3.reset(), observations)
    ended = 0
    for drawn in random_actions(6, 500, n, arguments.get("continuous", True)):
        actions = actions_for(envs, observations, drawn)
        observations, rewards, terminated, truncated, infos = envs.step(actions)
        seen, earned, dones, details = sb3.step(actions)
        assert same((seen, earned, dones), (observations, rewards.astype(np.float32), terminated | truncated))
        for i, detail in enumerate(details):
            if not dones[i]:
                assert detail == {}
                continue
            ended += 1
            final = infos["final_info"]
            assert same(detail.pop("terminal_observation"), infos["final_obs"][i])
            assert same(detail.pop("score"), final["score"][i])
            for name, value in detail.pop("table", {}).items():
                assert value == final["table"][name][i]
            told = {name: final[name][i] for name in ("foul", "is_success")}
            assert same(detail, {"TimeLimit.truncated": bool(truncated[i]), **told})
        assert same((sb3.contacts, sb3.n_contacts), (envs.unwrapped.contacts, envs.unwrapped.n_contacts))
    assert ended > n


SWIFT = dataclasses.replace(FULL_SIZE, paddle_speed=15.0, paddle_acceleration=500.0, puck_speed=20.0)
KINDS = {
    "plain": {},
    "another table": {"table": "challenge", "control_hz": 24, "reward": "shaped"},
    "a swift table": {"table": SWIFT, "control_hz": 120, "opponent_skill": 0.5},
    "randomized": {"randomize": {"width": (1.0, 1.2), "puck_radius": (0.03, 0.045), "paddle_speed": (3.0, 9.0)}},
    "a pool": {"opponent": ["striker", pursue, "random"], "reward": "shaped"},
}


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
@pytest.mark.parametrize("continuous", [True, False])
@pytest.mark.parametrize("obs_type", OBS_TYPES)
@pytest.mark.parametrize("name", IDS)
def test_every_face_gives_the_same_bits(name, obs_type, continuous, kind):
    """Single environments, both kinds of batches and Stable-Baselines3's; PettingZoo's is in test_parallel_env."""
    n = 3
    arguments = {"obs_type": obs_type, "continuous": continuous, "max_episode_steps": 30, **kind}
    pool = [{"opponent": member} for member in kind.get("opponent", ())] or [{}] * n
    singles = [gym.make(name, **{**arguments, **one}) for one in pool]
    batch = gym.make_vec(name, num_envs=n, autoreset_mode="SameStep", **arguments)
    by_hand = gym.make_vec(name, num_envs=n, autoreset_mode="Disabled", **arguments)
    sb3 = AirHockeySB3VecEnv(n, **{**gym.spec(name).kwargs, **arguments})
    sb3.seed(30)

    def for_sb3(pictures):
        return pictures[..., None] if obs_type == "grayscale" else pictures

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
        for i, (observation, reward, over, cut, info) in enumerate(results):
            assert (reward, over, cut and not over) == (rewards[i], terminated[i], truncated[i])
            assert same(observation, last[i])
            assert same(observation, infos["final_obs"][i] if done[i] else observations[i])
            table = info.pop("table", {})
            for theirs in (told, infos["final_info"] if done[i] else infos):
                assert same(info, {key: theirs[key][i] for key in info})
                assert all(theirs["table"][field][i] == value for field, value in table.items())
            if done[i]:
                assert same(for_sb3(observation), details[i]["terminal_observation"])
                assert same(info["score"], details[i]["score"]) and details[i].get("table", {}) == table
                assert details[i]["is_success"] == info["is_success"]
                assert same(singles[i].reset()[0], observations[i])
        if done.any():
            ends += done.sum()
            assert same(by_hand.reset(options={"reset_mask": done})[0], observations)
    assert ends >= 9 and contacts > 2


def fingerprint(n, threads, rows, **arguments):
    """A hash of all that the first `rows` of `n` tables return."""
    envs = AirHockeyVectorEnv(n, num_threads=threads, max_episode_steps=40, autoreset_mode="SameStep", **arguments)
    digest = hashlib.sha256(envs.reset(seed=99)[0][:rows].tobytes())
    for drawn in random_actions(7, 90, 5000, arguments.get("continuous", True)):
        observations, rewards, terminated, truncated, infos = envs.step(drawn[:n])
        final = infos.get("final_info", {"score": np.zeros((n, 2), np.int32)})
        for array in (observations, rewards, terminated, truncated, infos["score"], final["score"]):
            digest.update(array[:rows].tobytes())
    digest.update(envs.get_state()[:rows].tobytes())
    return digest.hexdigest()


@pytest.mark.parametrize("arguments", [{}, {"reward": "shaped", "continuous": False, "opponent": pursue}], ids=shown)
def test_neither_batch_size_nor_threads_matter(arguments):
    for rows, batches in ((1, (1, 7, 1500, 5000)), (7, (7, 1500, 5000)), (1500, (1500, 5000)), (5000, (5000,))):
        sizes = [(n, threads) for n in batches for threads in ((1, 2, 3) if n > 1000 else (1, 3))]
        assert len({fingerprint(n, threads, rows, **arguments) for n, threads in sizes}) == 1


def test_the_order_of_the_tables_does_not_matter():
    order = np.random.default_rng(0).permutation(50)
    straight, shuffled = AirHockeyVectorEnv(50), AirHockeyVectorEnv(50)
    first, _ = straight.reset(seed=list(range(50)))
    second, _ = shuffled.reset(seed=order.tolist())
    assert same(first[order], second)
    for actions in random_actions(1, 200, 50):
        ours, theirs = straight.step(actions), shuffled.step(actions[order])
        assert all(same(one[order], other) for one, other in zip(ours[:4], theirs[:4], strict=True))


# Ends of episodes


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize(("asked", "limit"), [({}, None), ({"max_episode_steps": 23}, 23)])
def test_make_vec_passes_the_time_limit(name, asked, limit):
    limit = limit or gym.spec(name).max_episode_steps
    envs = gym.make_vec(name, num_envs=20, opponent="idle", **asked)
    envs.reset(seed=0)
    still = np.zeros((20, 2), np.float32)
    age, over = np.zeros(20, int), np.zeros(20, bool)
    truncations = 0
    for _ in range(limit + 20):
        _, _, terminated, truncated, _ = envs.step(still)
        age = np.where(over, 0, age + 1)
        assert same(truncated, (age == limit) & ~terminated)
        over = terminated | truncated
        truncations += truncated.sum()
    # An idle player's shot or defence is over, one way or the other, before the limit of its task.
    assert truncations > 0 or (name in LIMITS and not asked)


def truncated_by(env):
    """The step that truncates an episode, or None: gymnasium.make's own limit, or that of the environment in it."""
    if hasattr(env, "get_wrapper_attr") and env.has_wrapper_attr("_max_episode_steps"):
        return env.get_wrapper_attr("_max_episode_steps")
    env = env.unwrapped
    single, two = isinstance(env, AirHockeyEnv), isinstance(env, AirHockeyParallelEnv)
    still = np.zeros(2) if single or two else np.zeros((env.num_envs, 2))
    for limit in sorted({7, 2**31 - 2, *(task.max_episode_steps for task in TASKS.values())}):
        env.reset()
        truncated = []
        for age in (limit - 2, limit - 1):
            state = env.get_state()
            state["steps"] = age
            env.set_state(state)
            result = env.step({"left": still, "right": still} if two else still)
            ends = result[2] if isinstance(env, AirHockeySB3VecEnv) else result[3]
            truncated.append(bool(np.all(list(ends.values()) if two else ends)))
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
    assert (reward, terminated, truncated, info["is_success"]) == (
        float(terminates),
        terminates,
        not terminates,
        terminates,
    )
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


def test_stable_baselines_options_are_for_each_table():
    sb3 = AirHockeySB3VecEnv(3)
    sb3.seed(4)
    sb3.set_options([{"serve": "left"}, {"serve": "right"}, {"puck_position": (0.0, 0.3)}])
    first = sb3.reset()
    assert first[0, 8] < 0.0 < first[1, 8] and first[2, 8] == 0.0
    single = AirHockeyEnv()
    assert same(first[1], single.reset(seed=5, options={"serve": "right"})[0])
    sb3.seed(4)
    sb3.reset()  # options were for one reset only
    assert (sb3.positions[2, 2] != (0.0, 0.3)).all()


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
