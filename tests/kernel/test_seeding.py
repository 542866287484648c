"""Seeds, random streams, and states that can be put back or copied: what follows is the same to the bit."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.kernel.state import STATE
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.helpers import COPIES, pursue, random_actions, same, shown

# A puck past the idle opponent's paddle that is in the goal in the second step at 50 Hz.
SHOT = {"puck_position": (1.0, 0.1), "puck_velocity": (5.0, 0.0)}
BIG = [2**31, 2**32 + 1, 2**63, 2**64, 2**64 + 1, 10**40]


def play_single(env, steps=300, seed=0):
    """Everything that one environment returns, with resets without a seed where an episode ends."""
    results = []
    for action in random_actions(seed, steps, 1)[:, 0]:
        result = env.step(action)
        results.append(result)
        if result[2] or result[3]:
            results.append(env.reset())
    return results


def play_batch(envs, steps=300, seed=0):
    """Everything that a batch returns, contacts copied in time."""
    results = []
    for actions in random_actions(seed, steps, envs.num_envs):
        *arrays, infos = envs.step(actions)
        if isinstance(infos, dict):
            infos = {key: np.asarray(value) for key, value in infos.items() if key not in ("final_info", "final_obs")}
        results.append((*arrays, infos))
    return results


# Seeds


@pytest.mark.parametrize("seed", [0, 1, 12345, *BIG])
def test_a_seed_decides_everything(seed):
    first, second = AirHockeyEnv(opponent="random"), AirHockeyEnv(opponent="random")
    assert same(first.reset(seed=seed), second.reset(seed=seed))
    assert same(play_single(first), play_single(second))
    # and starts everything anew, whatever was played before
    again = first.reset(seed=seed)
    assert same(again, AirHockeyEnv(opponent="random").reset(seed=seed))


def test_large_seeds_are_told_apart():
    starts = {AirHockeyEnv().reset(seed=seed)[0].tobytes() for seed in [0, 1, *BIG]}
    assert len(starts) == len(BIG) + 2


def test_different_seeds_differ_and_resets_without_a_seed_go_on():
    env = AirHockeyEnv()
    episodes = [env.reset(seed=3)[0]] + [env.reset()[0] for _ in range(20)]
    assert len({episode.tobytes() for episode in episodes}) == 21
    assert same(episodes, [env.reset(seed=3)[0]] + [env.reset()[0] for _ in range(20)])
    assert len({env.reset(seed=seed)[0].tobytes() for seed in range(200)}) == 200


def test_without_any_seed_runs_differ():
    assert not same(AirHockeyEnv().reset()[0], AirHockeyEnv().reset()[0])
    assert not same(AirHockeyVectorEnv(2).reset()[0], AirHockeyVectorEnv(2).reset()[0])
    batch = AirHockeyVectorEnv(100).reset()[0]
    assert len({row.tobytes() for row in batch}) == 100
    first, second = AirHockeySB3VecEnv(3).reset(), AirHockeySB3VecEnv(3).reset()
    assert not same(first, second) and len({row.tobytes() for row in first}) == 3


def test_numpy_integers_are_seeds_too():
    env, envs = AirHockeyEnv(), AirHockeyVectorEnv(2)
    assert same(env.reset(seed=np.int64(7)), env.reset(seed=7))
    assert same(envs.reset(seed=np.uint8(7))[0], envs.reset(seed=7)[0])
    assert same(envs.reset(seed=np.array([7, 8]))[0], envs.reset(seed=[7, 8])[0])


def test_gymnasiums_generator_is_seeded():
    env, envs = AirHockeyEnv(), AirHockeyVectorEnv(2)
    for one in (env, envs):
        one.reset(seed=11)
        assert one.np_random_seed == 11
        assert one.np_random.bit_generator.state == gym.utils.seeding.np_random(11)[0].bit_generator.state


@pytest.mark.parametrize("seed", [0, 2**64 - 1])
def test_batch_seeds_count_up(seed):
    envs = AirHockeyVectorEnv(3)
    singles = np.stack([AirHockeyEnv().reset(seed=seed + i)[0] for i in range(3)])
    assert same(envs.reset(seed=seed)[0], singles)
    assert same(envs.reset(seed=[seed, seed + 1, seed + 2])[0], singles)


def test_none_in_a_list_lets_the_stream_go_on():
    envs = AirHockeyVectorEnv(3)
    envs.reset(seed=1)
    mixed = envs.reset(seed=[50, None, 2**70])[0]
    single = AirHockeyEnv()
    single.reset(seed=2)
    assert same(mixed[1], single.reset()[0])
    assert same(mixed[0], AirHockeyEnv().reset(seed=50)[0])
    assert same(mixed[2], AirHockeyEnv().reset(seed=2**70)[0])


def test_none_in_the_first_list_is_drawn():
    first, second = AirHockeyVectorEnv(2).reset(seed=[4, None])[0], AirHockeyVectorEnv(2).reset(seed=[4, None])[0]
    assert same(first[0], second[0]) and not same(first[1], second[1])


def test_stable_baselines_seed_is_for_the_next_reset():
    sb3 = AirHockeySB3VecEnv(3)
    assert list(sb3.seed(8)) == [8, 9, 10]
    first, second = sb3.reset(), sb3.reset()
    assert not same(first, second)
    sb3.seed(8)
    assert same(sb3.reset(), first) and same(sb3.reset(), second)
    assert same(first, AirHockeyVectorEnv(3).reset(seed=8)[0])


def test_the_opponents_draws_belong_to_the_table():
    """What one table draws does not depend on what the others play."""
    envs, alone = AirHockeyVectorEnv(3, opponent="random"), AirHockeyVectorEnv(1, opponent="random")
    envs.reset(seed=[1, 2, 3])
    alone.reset(seed=[2])
    for actions in random_actions(3, 300, 3):
        assert same(envs.step(actions)[0][1], alone.step(actions[1:2])[0][0])


# States


@pytest.mark.parametrize("arguments", [{}, {"reward": "shaped", "opponent": "random"}, {"opponent": pursue}], ids=shown)
def test_a_state_put_back_goes_on_the_same(arguments):
    env = AirHockeyEnv(max_episode_steps=100, **arguments)
    env.reset(seed=5)
    play_single(env, 150)
    state = env.get_state()
    kept = state.tobytes()
    expected = play_single(env, 300, seed=1)
    for target in (env, AirHockeyEnv(max_episode_steps=100, **arguments)):
        target.set_state(state)
        assert target.get_state().tobytes() == kept
        assert same(play_single(target, 300, seed=1), expected)
    assert state.tobytes() == kept  # the state is a copy


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("opponent", ["striker", "random", pursue])
def test_states_of_a_batch_put_back_go_on_the_same(mode, opponent):
    envs = AirHockeyVectorEnv(6, autoreset_mode=mode, max_episode_steps=50, opponent=opponent, reward="shaped")
    envs.reset(seed=2)
    play_batch(envs, 99)
    states = [envs.get_state()]
    play_batch(envs, 1)  # with NextStep, the episodes are over now
    states.append(envs.get_state())
    expected = play_batch(envs, 200, seed=4)
    envs.set_state(states[1])
    assert envs.get_state().tobytes() == states[1].tobytes()
    assert same(play_batch(envs, 200, seed=4), expected)
    envs.set_state(states[0])
    assert envs.get_state().tobytes() == states[0].tobytes()


def test_chosen_rows_put_back_leave_the_others_alone():
    envs = AirHockeyVectorEnv(5, opponent="random")
    envs.reset(seed=2)
    play_batch(envs, 40)
    rows = np.array([3, 1])
    saved = envs.get_state(rows)
    assert saved.dtype == STATE and saved.shape == (2,)
    play_batch(envs, 30, seed=1)
    others = envs.get_state([0, 2, 4])
    envs.set_state(saved, rows)
    assert envs.get_state(rows).tobytes() == saved.tobytes()
    assert envs.get_state([0, 2, 4]).tobytes() == others.tobytes()
    envs.set_state(saved[::-1], [0, 4])  # onto other tables
    assert envs.get_state([4, 0]).tobytes() == saved.tobytes()
    for actions in random_actions(9, 100, 2):
        spread = np.zeros((5, 2), np.float32)
        spread[rows], spread[[4, 0]] = actions, actions
        observations = envs.step(spread)[0]
        assert same(observations[rows], observations[[4, 0]])


def test_rows_by_number_and_by_mask():
    envs = AirHockeyVectorEnv(3)
    envs.reset(seed=2)
    everything = envs.get_state()
    mask = np.array([False, True, True])
    assert envs.get_state(mask).tobytes() == everything[1:].tobytes()
    one = envs.get_state(2)
    assert one.tobytes() == everything[2:].tobytes()
    envs.set_state(one, 0)
    assert envs.get_state(0).tobytes() == one.tobytes()


def test_a_state_goes_from_a_batch_to_a_single_environment():
    envs, env = AirHockeyVectorEnv(3, opponent="random"), AirHockeyEnv(opponent="random")
    envs.reset(seed=6)
    play_batch(envs, 50)
    env.set_state(envs.get_state([1]))
    for actions in random_actions(8, 100, 3):
        assert same(envs.step(actions)[0][1], env.step(actions[1])[0])


def test_a_new_environment_with_a_state_needs_no_reset_and_keeps_its_stream():
    env = AirHockeyEnv()
    env.reset(seed=1)
    state = env.get_state()
    fresh, batch = AirHockeyEnv(), AirHockeyVectorEnv(1)
    fresh.set_state(state)
    batch.set_state(state)
    expected = env.reset()[0]
    assert same(fresh.reset()[0], expected)
    assert same(batch.reset()[0][0], expected)


def test_a_state_of_some_tables_does_not_begin_the_others():
    envs = AirHockeyVectorEnv(2)
    single = AirHockeyEnv()
    single.reset(seed=1)
    envs.set_state(single.get_state(), [1])
    with pytest.raises(ResetNeeded):
        envs.step(np.zeros((2, 2)))


def test_states_leave_no_gaps():
    """Bytes between fields would not always be copied, and equal states could have different bytes."""
    assert STATE.itemsize == sum(STATE[name].itemsize for name in STATE.names)


# Copies


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("opponent", ["random", pursue], ids=["random", "callable"])
@pytest.mark.parametrize("wrapped", [False, True])
def test_copies_of_an_environment_go_on_the_same(copied, opponent, wrapped):
    arguments = {"opponent": opponent, "render_mode": "rgb_array", "render_size": (64, 48)}
    env = gym.make("AirHockey-v0", **arguments) if wrapped else AirHockeyEnv(**arguments)
    env.reset(seed=3)
    play_single(env, 100)
    env.render()
    other = copied(env)
    assert (other.render() == env.render()).all()
    kept = other.unwrapped.get_state().tobytes()
    expected = play_single(env, 400, seed=1)
    assert other.unwrapped.get_state().tobytes() == kept  # the copy shares nothing
    assert same(play_single(other, 400, seed=1), expected)
    assert (other.render() == env.render()).all()
    assert other.unwrapped.get_state().tobytes() == env.unwrapped.get_state().tobytes()


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_copies_of_an_environment_keep_score_and_end(copied):
    env = AirHockeyEnv(opponent="idle")
    env.reset(seed=0, options=SHOT)
    other = copied(env)
    for one in (env, other):
        one.step([0.0, 0.0])
        _, reward, terminated, _, info = one.step([0.0, 0.0])
        assert (reward, terminated, info["is_success"], info["score"].tolist()) == (1.0, True, True, [1, 0])
        with pytest.raises(ResetNeeded):
            one.step([0.0, 0.0])
    again = copied(env)
    with pytest.raises(ResetNeeded):
        again.step([0.0, 0.0])
    again.reset()
    again.step([0.0, 0.0])


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("opponent", ["random", pursue], ids=["random", "callable"])
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("num_envs", [3, 2100])
def test_copies_of_a_batch_go_on_the_same(copied, opponent, mode, num_envs):
    arguments = {"opponent": opponent, "autoreset_mode": mode, "max_episode_steps": 30, "num_threads": 2}
    if num_envs < 10:
        arguments |= {"render_mode": "rgb_array", "render_size": (64, 48)}
    envs = AirHockeyVectorEnv(num_envs, **arguments)
    envs.reset(seed=3)
    steps = 60 if num_envs < 10 else 4
    play_batch(envs, steps)
    if envs.render_mode:
        envs.render()
    other = copied(envs)
    kept = other.get_state().tobytes()
    expected = play_batch(envs, steps, seed=1)
    assert other.get_state().tobytes() == kept
    assert same(play_batch(other, steps, seed=1), expected)
    assert same(other.reset()[0], envs.reset()[0])
    if envs.render_mode:
        assert all((ours == theirs).all() for ours, theirs in zip(other.render(), envs.render(), strict=True))


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("opponent", ["striker", pursue], ids=["striker", "callable"])
def test_copies_of_a_stable_baselines_batch_go_on_the_same(copied, opponent):
    sb3 = AirHockeySB3VecEnv(3, opponent=opponent, max_episode_steps=40, render_mode="rgb_array", render_size=(64, 48))
    sb3.seed(3)
    sb3.reset()
    play_batch(sb3, 60)
    sb3.get_images()
    other = copied(sb3)
    expected = play_batch(sb3, 100, seed=1)
    assert same(play_batch(other, 100, seed=1), expected)
    assert same(other.reset(), sb3.reset())
    assert same(list(other.get_images()), list(sb3.get_images()))


def test_copies_share_a_callable_opponent():
    """A policy is its owner's: it may be large, or not copyable."""

    class Policy:
        def __deepcopy__(self, memo):
            raise AssertionError("copied")

        def __call__(self, seen):
            return pursue(seen)

    env = AirHockeyEnv(opponent=Policy())
    env.reset(seed=0)
    other = COPIES["deepcopy"](env)
    assert same(play_single(env, 50), play_single(other, 50))
