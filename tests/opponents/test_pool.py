"""A pool of opponents: who is asked for which tables, changes while playing, and what a state keeps of it."""

from __future__ import annotations

import math

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecMonitor

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.game import Game
from airhockey_env.kernel.observations import observe
from airhockey_env.kernel.scripted import EXTERNAL, SCRIPTED
from airhockey_env.kernel.state import RIGHT
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.pool import ROWS_PER_THREAD
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.helpers import COPIES, pursue, random_actions, same, shown, some_policy


def retreat(seen):
    """Another policy than `pursue`."""
    return -3.0 * seen[:, 0:2] - 0.5


class Noted:
    """A policy that notes what it is shown."""

    def __init__(self, policy=pursue):
        self.policy = policy
        self.seen = []

    def __call__(self, observations):
        assert observations.dtype == np.float32 and observations.ndim == 2 and observations.shape[1] == 13
        assert not observations.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            observations[0, 0] = 0.0
        self.seen.append(observations.copy())
        return self.policy(observations)


POOL = ["striker", pursue, "random", retreat]


def rows_of(envs, row, names):
    """What of a step's results belongs to a table."""
    return [envs[name][row] for name in names]


def steps(envs, count, seed=3, tables=None):
    """All that a number of steps with drawn actions return, observations first."""
    n = tables or envs.num_envs
    return [envs.step(actions[: envs.num_envs])[:4] for actions in random_actions(seed, count, n)]


# Assignment


@pytest.mark.parametrize("face", [AirHockeyVectorEnv, AirHockeySB3VecEnv])
def test_tables_are_assigned_evenly_and_in_order(face):
    envs = face(10, opponent=POOL)
    assert envs.opponents == tuple(POOL)
    assert envs.opponent_indices.tolist() == [0, 1, 2, 3, 0, 1, 2, 3, 0, 1]
    numbers = envs._game._drivers[RIGHT]
    assert numbers[:4].tolist() == [SCRIPTED["striker"], EXTERNAL, SCRIPTED["random"], EXTERNAL]
    envs.opponent_indices[0] = 3  # a copy
    assert envs.opponent_indices[0] == 0
    assert face(3).opponents == ("striker",)
    assert face(1, opponent=tuple(POOL)).opponent_indices.tolist() == [0]


@pytest.mark.parametrize("mode", list(AutoresetMode)[:2])
@pytest.mark.parametrize("arguments", [{}, {"reward": "shaped"}, {"randomize": {"width": (1.0, 1.2)}}], ids=shown)
def test_every_table_plays_as_one_with_its_opponent_alone(mode, arguments):
    n = 9
    common = {"autoreset_mode": mode, "max_episode_steps": 90, **arguments}
    envs = AirHockeyVectorEnv(n, opponent=POOL, **common)
    alone = [AirHockeyVectorEnv(1, opponent=POOL[i % 4], **common) for i in range(n)]
    first = envs.reset(seed=5)[0]
    assert same(first, np.concatenate([env.reset(seed=5 + i)[0] for i, env in enumerate(alone)]))
    ends = 0
    for actions in random_actions(1, 300, n):
        results = envs.step(actions)[:4]
        for i, env in enumerate(alone):
            assert same(tuple(part[i : i + 1] for part in results), env.step(actions[i : i + 1])[:4])
        ends += results[2].sum()
    assert ends > 3


def test_faces_agree():
    n = 6
    envs = gym.make_vec("AirHockey-v0", num_envs=n, opponent=POOL, autoreset_mode="SameStep", max_episode_steps=80)
    sb3 = AirHockeySB3VecEnv(n, opponent=POOL, max_episode_steps=80)
    sb3.seed(2)
    assert same(sb3.reset(), envs.reset(seed=2)[0])
    for step, actions in enumerate(random_actions(2, 200, n)):
        if step == 60:
            for face in (envs.unwrapped, sb3):
                face.set_opponents([3, 2, 1, 0, 3, 3])
                face.set_opponent_skill(0.4, [1, 3])
        observations, rewards, terminated, truncated, _ = envs.step(actions)
        seen, earned, dones, _ = sb3.step(actions)
        assert same((seen, earned, dones), (observations, rewards.astype(np.float32), terminated | truncated))


@pytest.mark.usefixtures("small_parts")
def test_neither_batch_size_nor_threads_nor_grouping_matter():
    """The pool in another order, the same policy in several places, tables in another arrangement."""
    n = 1500
    small = AirHockeyVectorEnv(12, opponent=POOL)
    large = AirHockeyVectorEnv(n, opponent=POOL, num_threads=1)
    shared = AirHockeyVectorEnv(2 * n, opponent=POOL, num_threads=3)
    other = AirHockeyVectorEnv(n, opponent=[retreat, "random", pursue, "striker", pursue, retreat], num_threads=1)
    places = np.array([3, 2, 1, 0, 3, 4, 1, 5])[np.arange(n) % 8]  # the same players as `large` has
    other.set_opponents(places)
    every = [small, large, shared, other]
    assert all(same(envs.reset(seed=8)[0][:12], small.reset(seed=8)[0]) for envs in every)
    for actions in random_actions(4, 60, 2 * n):
        results = [envs.step(actions[: envs.num_envs])[:4] for envs in every]
        for few, count in ((results[0], 12), (results[1], n), (results[3], n)):
            assert same(few, tuple(part[:count] for part in results[2]))


@pytest.mark.parametrize("obs", ["exact", "stacked"])
def test_threads_that_ask_networks_give_the_same_actions(obs):
    """Several networks, one that chooses directions and one that shares its tables with nobody, with odd numbers of
    tables, which threads divide within and across networks."""
    n = 2 * ROWS_PER_THREAD + 77
    stack = 1 if obs == "exact" else 3
    pool = ["striker", some_policy(stack=stack), some_policy(9, seed=1), pursue, some_policy(seed=2)]
    one, many = (AirHockeyVectorEnv(n, opponent=pool, num_threads=threads) for threads in (1, 5))
    places = np.random.default_rng(0).choice(len(pool), n, p=[0.2, 0.5, 0.1, 0.1, 0.1])
    for envs in (one, many):
        envs.reset(seed=3)
        envs.set_opponents(places)
    for actions in random_actions(5, 40, n):
        assert same(one.step(actions)[:4], many.step(actions)[:4])


def test_a_policy_derived_from_a_network_acts_in_its_own_way_in_large_batches_too():
    class Pursuer(MlpPolicy):
        def __call__(self, observations):
            return pursue(observations)

    network = some_policy()
    n = 2 * ROWS_PER_THREAD
    derived = Pursuer(network.weights, network.biases)
    one, other = (AirHockeyVectorEnv(n, opponent=player, num_threads=2) for player in (derived, pursue))
    assert same(one.reset(seed=1)[0], other.reset(seed=1)[0])
    for actions in random_actions(6, 20, n):
        assert same(one.step(actions)[:4], other.step(actions)[:4])


@pytest.mark.parametrize("places", [[0, 1, 2, 0, 1, 2, 0], [0, 0, 0, 1, 1, 2, 2], [1, 1, 1, 1, 1, 1, 1]], ids=shown)
def test_each_policy_is_asked_once_a_step_for_its_tables_alone(places):
    first, second = Noted(), Noted(retreat)
    envs = AirHockeyVectorEnv(7, opponent=[first, second, "goalie"])
    envs.set_opponents(places)
    envs.reset(seed=4)
    places = np.array(places)
    for step, actions in enumerate(random_actions(3, 80, 7)):
        before = envs.get_state()
        envs.step(actions)
        room = np.zeros((2, 7, 13), np.float32)
        for i in range(7):
            observe(before[i], envs._game.parameters[0], RIGHT, room, i)
        expected = room[RIGHT]
        for place, policy in enumerate((first, second)):
            rows = np.flatnonzero(places == place)
            assert len(policy.seen) == (step + 1 if len(rows) else 0)
            assert not len(rows) or same(policy.seen[-1], expected[rows])


def test_a_policy_with_several_places_is_asked_once():
    policy = Noted()
    envs = AirHockeyVectorEnv(5, opponent=[policy, "idle", policy])
    envs.reset(seed=1)
    envs.step(np.zeros((5, 2)))
    assert [seen.shape for seen in policy.seen] == [(3, 13)]


def test_tables_side_by_side_are_shown_without_copying():
    shown = []

    def policy(observations):
        shown.append(observations)
        return pursue(observations)

    envs = AirHockeyVectorEnv(6, opponent=["idle", policy])
    envs.set_opponents([0, 1, 1, 1, 0, 0])
    envs.reset(seed=1)
    envs.step(np.zeros((6, 2)))
    assert np.shares_memory(shown[0], envs._game.out.observation[RIGHT])
    envs.set_opponents([0, 1, 0, 1, 0, 1])
    envs.step(np.zeros((6, 2)))
    envs.step(np.zeros((6, 2)))
    assert np.shares_memory(shown[1], shown[2]) and shown[1].shape == (3, 13) and shown[1].flags.c_contiguous


# Changes while playing


@pytest.mark.parametrize("reward", ["sparse", "shaped"])
def test_opponents_change_in_the_midst_of_an_episode(reward):
    """After the change, the tables play on from where they are as if they had never had another opponent."""
    envs = AirHockeyVectorEnv(6, opponent=POOL, reward=reward)
    envs.reset(seed=3)
    steps(envs, 50)
    envs.set_opponents([1, 3], tables=[0, 5])
    envs.set_opponents(2, tables=np.array([False, True, False, False, False, False]))
    assert envs.opponent_indices.tolist() == [1, 2, 2, 3, 0, 3]
    others = [AirHockeyVectorEnv(1, opponent=POOL[place], reward=reward) for place in envs.opponent_indices]
    for i, other in enumerate(others):
        state = envs.get_state([i])
        state["member"] = 0
        other.set_state(state)
    for actions in random_actions(6, 200, 6):
        results = envs.step(actions)[:4]
        for i, other in enumerate(others):
            assert same(tuple(part[i : i + 1] for part in results), other.step(actions[i : i + 1])[:4])


@pytest.mark.parametrize("reward", ["sparse", "shaped"])
def test_a_callable_joins_a_scripted_game_and_leaves_it(reward):
    envs = AirHockeyVectorEnv(4, opponent="striker", reward=reward)
    plain = AirHockeyVectorEnv(4, opponent="striker", reward=reward)
    for each in (envs, plain):
        each.reset(seed=3)
    assert same(steps(envs, 30), steps(plain, 30))
    policy = Noted()
    assert envs.add_opponent(policy) == 1 and envs.opponents == ("striker", policy)
    assert same(steps(envs, 5), steps(plain, 5)) and not policy.seen
    envs.set_opponents(1, tables=[2])
    room = np.zeros((2, 1, 13), np.float32)
    observe(envs.get_state([2])[0], envs._game.parameters[0], RIGHT, room, 0)
    seen = room[RIGHT]
    mixed, alone = steps(envs, 40), steps(plain, 40)
    assert same(policy.seen[0], seen) and len(policy.seen) == 40
    rest = [0, 1, 3]
    assert all(same(one[0][rest], other[0][rest]) for one, other in zip(mixed, alone, strict=True))
    envs.set_opponents(0)
    envs.set_state(plain.get_state())
    assert same(steps(envs, 60), steps(plain, 60)) and len(policy.seen) == 40
    assert not envs._game.settings["observed"][0, RIGHT]


def test_a_place_takes_another_opponent():
    envs = AirHockeyVectorEnv(5, opponent=["idle", pursue])
    expected = AirHockeyVectorEnv(5, opponent=["goalie", retreat])
    envs.reset(seed=3)
    steps(envs, 30)
    expected.set_state(envs.get_state())
    envs.set_opponent(0, "goalie")
    envs.set_opponent(1, retreat)
    assert envs.opponents == expected.opponents
    assert same(steps(envs, 100), steps(expected, 100))
    assert envs.get_state().tobytes() == expected.get_state().tobytes()


def test_changes_before_the_first_reset():
    envs = AirHockeyVectorEnv(4, opponent="idle")
    envs.add_opponent(pursue)
    envs.set_opponents([0, 1, 0, 1])
    expected = AirHockeyVectorEnv(4, opponent=["idle", pursue])
    assert same(envs.reset(seed=1)[0], expected.reset(seed=1)[0])
    assert same(steps(envs, 40), steps(expected, 40))


def test_new_episodes_keep_opponents_and_skill():
    envs = AirHockeyVectorEnv(6, opponent=POOL, max_episode_steps=20)
    envs.reset(seed=1)
    envs.set_opponents([3, 3, 2, 1, 0, 0])
    envs.set_opponent_skill(np.linspace(0.0, 1.0, 6))
    steps(envs, 50)
    envs.reset(seed=2)
    assert envs.opponent_indices.tolist() == [3, 3, 2, 1, 0, 0]
    assert envs.opponent_skill.tolist() == np.linspace(0.0, 1.0, 6).tolist()


def test_skill_of_tables():
    envs = AirHockeyVectorEnv(4, opponent="striker", opponent_skill=[1.0, 0.5, 0.0, 1.0])
    assert envs.opponent_skill.tolist() == [1.0, 0.5, 0.0, 1.0]
    envs.reset(seed=1)
    envs.set_opponent_skill(0.0, tables=[0])
    envs.set_opponent_skill([0.25, 1], tables=[3, 1])
    assert envs.opponent_skill.tolist() == [0.0, 1.0, 0.0, 0.25]
    home = envs.positions[:, RIGHT]
    fastest = np.zeros(4)
    for actions in random_actions(1, 250, 4):
        envs.step(actions)
        fastest = np.maximum(fastest, np.linalg.norm(envs.velocities[:, RIGHT], axis=1))
    assert (envs.positions[[0, 2], RIGHT] == home[[0, 2]]).all()
    assert fastest[3] <= 0.25 * envs.table.paddle_speed * (1.0 + 1e-9) < fastest[1]


def test_by_the_ways_of_gymnasium_and_stable_baselines():
    envs = gym.make_vec("AirHockey-v0", num_envs=3, opponent=["idle", "goalie"])
    envs.unwrapped.set_opponents(1)
    assert envs.unwrapped.opponent_indices.tolist() == [1, 1, 1]
    sb3 = AirHockeySB3VecEnv(3, opponent=["idle", "goalie"])
    VecMonitor(sb3).set_opponents([1, 0, 1])  # of the whole batch, through wrappers too
    assert sb3.get_attr("opponent_index") == [1, 0, 1]
    sb3.env_method("set_opponents", 1, indices=[1])  # of a table
    assert sb3.get_attr("opponent_index") == [1, 1, 1]
    with pytest.raises(AttributeError, match="'add_opponent'"):
        sb3.env_method("add_opponent", "idle")


# States and copies


@pytest.mark.parametrize("randomize", [None, {"width": (1.0, 1.2)}])
def test_a_state_brings_back_who_played(randomize):
    envs = AirHockeyVectorEnv(5, opponent=POOL, randomize=randomize, reward="shaped")
    envs.reset(seed=7)
    steps(envs, 40)
    state, expected = envs.get_state(), steps(envs, 80, seed=9)
    envs.set_opponents([3, 3, 0, 0, 1])
    envs.set_opponent_skill(0.2)
    steps(envs, 20)
    envs.set_state(state)
    assert envs.get_state().tobytes() == state.tobytes()
    assert envs.opponent_indices.tolist() == [0, 1, 2, 3, 0]
    assert same(steps(envs, 80, seed=9), expected)


def test_a_state_goes_to_another_table_with_its_opponent():
    envs = AirHockeyVectorEnv(4, opponent=POOL)
    envs.reset(seed=7)
    steps(envs, 40)
    envs.set_state(envs.get_state([1, 1, 1, 1]))  # branches
    assert envs.opponent_indices.tolist() == [1, 1, 1, 1]
    for actions in random_actions(5, 60, 1):
        observations = envs.step(np.repeat(actions, 4, axis=0))[0]
        assert (observations == observations[0]).all()


def test_a_state_is_played_by_whoever_has_the_place_now():
    envs, idle = AirHockeyVectorEnv(2, opponent="striker"), AirHockeyVectorEnv(2, opponent="idle")
    policy = Noted()
    asked = AirHockeyVectorEnv(2, opponent=policy)
    envs.reset(seed=1)
    steps(envs, 20)
    idle.set_state(envs.get_state())
    assert (idle._game._drivers[RIGHT] == SCRIPTED["idle"]).all()
    asked.set_state(envs.get_state())
    steps(asked, 3)
    assert len(policy.seen) == 3
    envs.set_state(asked.get_state())
    assert (envs._game._drivers[RIGHT] == SCRIPTED["striker"]).all()


def test_a_state_of_a_larger_pool_is_refused():
    envs, small = AirHockeyVectorEnv(3, opponent=POOL), AirHockeyVectorEnv(3, opponent=POOL[:2])
    for each in (envs, small):
        each.reset(seed=1)
    before = small.get_state().tobytes()
    with pytest.raises(ValueError, match=r"^state must be of a game with no more opponents than this one's 2, got"):
        small.set_state(envs.get_state())
    assert small.get_state().tobytes() == before
    small.set_state(envs.get_state([0, 1]), [0, 1])


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_copies_go_on_the_same_and_by_themselves(copied):
    envs = AirHockeyVectorEnv(8, opponent=POOL)
    envs.reset(seed=2)
    steps(envs, 30)
    other = copied(envs)
    assert same(steps(other, 60), steps(envs, 60))
    other.set_opponents(0)
    other.set_opponent(2, "idle")
    other.add_opponent(pursue)
    assert envs.opponents == tuple(POOL) and envs.opponent_indices.tolist() == [0, 1, 2, 3] * 2


# Bad input

BAD_PLACES = [
    -1,
    4,
    1.0,
    True,
    None,
    "striker",
    [0],
    [0, 1, 2],
    [0, 1, 2, 4],
    [[0, 1, 2, 3]],
    [0.0, 1.0, 2.0, 3.0],
    [],
    [[0], 1],
]
BAD_TABLES = [-1, 4, 1.0, "0", [0, 0], [[0]], [True], [0, 4], [0, -1], [None], [[0], [0, 1]]]


@pytest.fixture(params=[AirHockeyVectorEnv, AirHockeySB3VecEnv])
def envs(request):
    made = request.param(4, opponent=POOL)
    made.reset()
    return made


def refuses(envs, match, method, *arguments):
    before, pool = envs._game.get_state().tobytes(), envs.opponents
    with pytest.raises(ValueError, match=match):
        getattr(envs, method)(*arguments)
    assert envs._game.get_state().tobytes() == before and envs.opponents == pool


@pytest.mark.parametrize("places", BAD_PLACES, ids=shown)
def test_bad_places(envs, places):
    refuses(envs, r"^indices must be .* whole numbers from 0 to 3.*, got ", "set_opponents", places)


@pytest.mark.parametrize("tables", BAD_TABLES, ids=shown)
def test_bad_tables(envs, tables):
    for method, value in (("set_opponents", 1), ("set_opponent_skill", 0.5)):
        refuses(envs, r"^tables must be ", method, value, tables)


@pytest.mark.parametrize("skill", [-0.1, 1.1, math.nan, "1", None, True, [0.5], [0.0, 0.0, 0.0, 2.0]], ids=shown)
def test_bad_skill(envs, skill):
    refuses(envs, r"^opponent_skill must be .*, got ", "set_opponent_skill", skill)


@pytest.mark.parametrize("opponent", [None, "Striker", 3, [], ["idle"], [pursue]], ids=shown)
def test_bad_members(envs, opponent):
    refuses(envs, r"^opponent must be one of .*, got ", "add_opponent", opponent)
    refuses(envs, r"^opponent must be one of .*, got ", "set_opponent", 1, opponent)
    with pytest.raises(ValueError, match=r"^opponent must be .*, got .* at place 1"):
        type(envs)(2, opponent=["idle", opponent])


@pytest.mark.parametrize("index", [-1, 4, 1.0, True, None, "0"], ids=shown)
def test_bad_places_for_a_member(envs, index):
    refuses(envs, r"^index must be a whole number from 0 to 3, got ", "set_opponent", index, "idle")


def test_a_single_environment_has_one_opponent():
    with pytest.raises(ValueError, match=r"^opponent must be one of .* or a callable, got \['idle'\]$"):
        AirHockeyEnv(opponent=["idle"])


def test_a_game_for_two_has_no_pool():
    pool = Game(2, right=None).pools[RIGHT]
    assert pool.members == ()
    for change in (lambda: pool.add("idle"), lambda: pool.replace(0, "idle"), lambda: pool.assign(0)):
        with pytest.raises(ValueError, match="the caller plays the right paddle"):
            change()


@pytest.mark.parametrize(
    "answer", [lambda seen: np.zeros((len(seen) + 1, 2)), lambda seen: np.full((len(seen), 2), math.nan)]
)
def test_bad_answers_name_the_opponent_and_change_nothing(answer):
    turn = {"answer": pursue}
    envs = AirHockeyVectorEnv(5, opponent=[retreat, "idle", lambda seen: turn["answer"](seen)])
    envs.reset(seed=1)
    steps(envs, 5)
    before = envs.get_state().tobytes()
    turn["answer"] = answer
    with pytest.raises(ValueError, match=r"^the actions of opponent 2 must be "):
        envs.step(np.zeros((5, 2)))
    assert envs.get_state().tobytes() == before
