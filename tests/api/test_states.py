"""States that are put back and copies: what follows is the same to the bit, and what is seen of them.

An example of each in every API; the trials in tests/torture do the same in the middle of any game.
"""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.error import ResetNeeded

from airhockey_env import AirHockeyEnv, AirHockeyVectorEnv
from airhockey_env.kernel.state import STATE
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.api.apis import APIS
from tests.helpers import COPIES, DRAWN, SHOT, begin, handed, play, pursue, random_actions, same, shown

ROWS = 5
RANDOMIZE = {"randomize": {"width": (1.0, 1.2), "goal_width": (0.3, 0.5)}}
SEEN = {"camera": DRAWN, "stack": 3, "action_delay_ms": (0, 70), **RANDOMIZE}
PICTURES = {"obs_type": "rgb", "stack": 2, **RANDOMIZE}


@pytest.fixture(params=APIS.values(), ids=APIS)
def make(request):
    return request.param


@pytest.mark.parametrize("arguments", [{"reward": "shaped"}, PICTURES, SEEN], ids=shown)
def test_a_state_put_back_goes_on_the_same(make, arguments):
    env = begin(make(max_episode_steps=50, **arguments))
    play(env, 80)
    state, seen = env.get_state(), env.observe()
    kept = state.tobytes()
    expected = play(env, 120, seed=1)
    for target in (env, make(max_episode_steps=50, **arguments)):
        target.set_state(state)
        assert target.get_state().tobytes() == kept
        assert same(target.observe(), seen)
        assert same(play(target, 120, seed=1), expected)
    assert state.tobytes() == kept  # the state is a copy


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("arguments", [{"opponent": pursue}, {"obs_type": "rgb", **RANDOMIZE}, SEEN], ids=shown)
def test_what_is_observed_is_what_a_step_returned(arguments, mode):
    envs, other = (AirHockeyVectorEnv(ROWS, autoreset_mode=mode, max_episode_steps=33, **arguments) for _ in range(2))
    found = [(envs.reset(seed=3)[0], envs.get_state())]
    for actions in random_actions(1, 90, ROWS):
        found.append((envs.step(actions)[0], envs.get_state()))
        assert same(envs.observe(), found[-1][0])
    other.reset(seed=8)
    for observations, state in found[::-7]:
        other.set_state(state)
        assert same(other.observe(), observations)
    for chosen in ([3, 1], np.array([4]), 2, [0, 1, 2, 3, 4]):
        kept, (observations, state) = other.observe(), found[20]
        rows = np.atleast_1d(chosen)
        other.set_state(state[rows], chosen)
        assert same(other.observe(chosen), observations[rows])
        rest = np.setdiff1d(np.arange(ROWS), rows)
        assert same(other.observe()[rest], kept[rest])


def test_stable_baselines_tables_can_be_asked_one_by_one():
    envs = AirHockeySB3VecEnv(3)
    first = envs.reset()
    assert same(envs.observe([2]), first[2:])
    assert same(np.stack(envs.env_method("observe")), first)


@pytest.mark.parametrize("arguments", [{}, {"obs_type": "rgb"}])
def test_what_is_returned_is_the_callers(make, arguments):
    env = begin(make(**arguments))
    first, given = env.observe(), env.observe()
    for array in given.values() if isinstance(given, dict) else [given]:
        array[:] = 0
    assert same(env.observe(), first)


def test_there_is_nothing_to_see_before_an_episode(make):
    env = make()
    with pytest.raises(ResetNeeded, match="before observe"):
        env.observe()
    env.reset()
    env.observe()


@pytest.mark.parametrize("arguments", [{}, SEEN], ids=shown)
def test_a_state_of_before_the_first_episode_needs_a_reset(make, arguments):
    """Regression: the game went on from it, with all discs in one place."""
    env = make(**arguments)
    state = env.get_state()
    begin(env).set_state(state)
    for use in (env.observe, lambda: env.step(handed(env, np.zeros((2, 2), np.float32)))):
        with pytest.raises(ResetNeeded):
            use()
    begin(env)


def test_there_is_nothing_to_see_of_a_table_before_its_episode():
    envs = AirHockeyVectorEnv(2)
    envs.reset(seed=0, options={"reset_mask": np.array([True, False])})
    assert envs.observe([0]).shape == (1, 13)
    with pytest.raises(ResetNeeded, match="before observe"):
        envs.observe([1])


def test_chosen_rows_put_back_leave_the_others_alone():
    envs = AirHockeyVectorEnv(5, opponent="random")
    envs.reset(seed=2)
    for actions in random_actions(0, 40, 5):
        envs.step(actions)
    rows = np.array([3, 1])
    saved = envs.get_state(rows)
    assert saved.dtype == STATE and saved.shape == (2,)
    for actions in random_actions(1, 30, 5):
        envs.step(actions)
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


def test_a_state_goes_from_a_batch_to_a_new_single_environment_without_a_reset():
    envs, env = begin(APIS["batch"](opponent="random")), AirHockeyEnv(opponent="random")
    env.set_state(envs.get_state([1]))
    for actions in random_actions(8, 100, 2):
        assert same(envs.step(actions)[0][1], env.step(actions[1])[0])
    envs.set_state(env.get_state(), [1])
    mask = np.array([False, True])
    assert same(envs.reset(options={"reset_mask": mask})[0][1], env.reset()[0])  # the stream goes on too


def test_a_state_of_some_tables_does_not_begin_the_others():
    envs = AirHockeyVectorEnv(2)
    envs.set_state(begin(AirHockeyEnv()).get_state(), [1])
    with pytest.raises(ResetNeeded):
        envs.step(np.zeros((2, 2)))


def test_states_leave_no_gaps():
    """Bytes between fields would not always be copied, and equal states could have different bytes."""
    assert STATE.itemsize == sum(STATE[name].itemsize for name in STATE.names)


# Copies


@pytest.mark.parametrize("arguments", [{}, SEEN], ids=shown)
@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_copies_go_on_the_same_and_by_themselves(make, copied, arguments):
    env = begin(make(render_mode="rgb_array", render_size=(64, 48), max_episode_steps=40, **arguments))
    play(env, 60)
    env.render()
    other = copied(env)
    kept = other.get_state().tobytes()
    expected = play(env, 100, seed=1)
    assert other.get_state().tobytes() == kept
    assert same(play(other, 100, seed=1), expected)
    assert same(other.render(), env.render())
    assert same(other.reset(), env.reset())


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("num_envs", [3, 2100])
@pytest.mark.usefixtures("small_parts")
def test_copies_of_a_batch_with_a_policy_and_threads(copied, num_envs):
    envs = AirHockeyVectorEnv(num_envs, opponent=pursue, num_threads=2, max_episode_steps=3)
    envs.reset(seed=3)
    drawn = random_actions(2, 8, num_envs)
    envs.step(drawn[0])
    other = copied(envs)
    for actions in drawn:
        assert same(envs.step(actions)[:4], other.step(actions)[:4])


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_copies_keep_score_and_end(copied):
    env = AirHockeyEnv(opponent="idle")
    env.reset(seed=0, options=SHOT)
    other = copied(env)
    for one in (env, other):
        one.step([0.0, 0.0])
        _, reward, terminated, _, info = one.step([0.0, 0.0])
        assert (reward, terminated, info["is_success"], info["score"].tolist()) == (1.0, True, True, [1, 0])
    again = copied(env)
    with pytest.raises(ResetNeeded):
        again.step([0.0, 0.0])
    again.reset()
    again.step([0.0, 0.0])


def test_copies_share_a_callable_opponent():
    """A policy is its owner's: it may be large, or not copyable."""

    class Policy:
        def __deepcopy__(self, memo):
            raise AssertionError("copied")

        def __call__(self, seen):
            return pursue(seen)

    env = begin(AirHockeyEnv(opponent=Policy()))
    other = COPIES["deepcopy"](env)
    assert same(play(env, 50), play(other, 50))
