"""Stacks: the last observations of a player, and the actions that led to them.

That every API does the same, autoreset modes and final observations included, is a matter of tests/api/test_parity.py.
"""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import FrameStackObservation
from numpy.typing import NDArray

from airhockey_env import LEFT, RIGHT, AirHockeyEnv, AirHockeyVectorEnv, Game
from airhockey_env.actions import DIRECTIONS
from airhockey_env.game import OBS_TYPES
from airhockey_env.kernel.history import next_history
from airhockey_env.kernel.state import SEATS
from airhockey_env.live.match import LiveMatch
from airhockey_env.parallel_env import AirHockeyParallelEnv
from tests.helpers import COPIES, HEAVY, NAN, begin, pursue, random_actions, same, some_policy

LIMIT = 12


class Watcher:
    """A policy that chases the puck and notes what it is shown."""

    def __init__(self, stack: int) -> None:
        self.stack = stack
        self.seen: list[NDArray[np.float32]] = []

    def __call__(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        assert observations.shape[1:] == ((13,) if self.stack == 1 else (self.stack, 15))
        self.seen.append(observations.copy())
        return pursue(observations.reshape(len(observations), -1)[:, -15:])


# What a stack is


@pytest.mark.parametrize("obs_type", OBS_TYPES)
@pytest.mark.parametrize("camera", [None, HEAVY], ids=["exact", "camera"])
def test_observations_are_those_of_gymnasiums_wrapper(camera: Any, obs_type: str) -> None:
    arguments = {"camera": camera, "obs_type": obs_type, "max_episode_steps": LIMIT}
    ours = gym.make("AirHockey-v0", stack=4, **arguments)
    theirs = FrameStackObservation(gym.make("AirHockey-v0", **arguments), 4)
    assert ours.observation_space.shape[-len(theirs.observation_space.shape) + 1 :] != theirs.observation_space.shape
    for seed in (0, 1):
        stacks = [(ours.reset(seed=seed)[0], theirs.reset(seed=seed)[0])]
        for action in random_actions(seed, LIMIT, 1):
            stacks.append((ours.step(action[0])[0], theirs.step(action[0])[0]))
        for seen, expected in stacks:
            assert seen in ours.observation_space
            assert same(seen[..., :13] if obs_type == "state" else seen, expected)


@pytest.mark.parametrize("continuous", [True, False])
def test_a_row_ends_with_the_action_that_led_to_it(continuous: bool) -> None:
    env = AirHockeyEnv(stack=3, continuous=continuous)
    first = env.reset(seed=0)[0]
    assert not first[:, 13:].any()
    rows = [first[0, 13:]] * 3
    for action in random_actions(0, 30, 1, continuous)[:, 0]:
        seen = env.step(action)[0]
        rows.append(np.clip(action, -1.0, 1.0) if continuous else DIRECTIONS[action])
        assert same(seen[:, 13:], np.array(rows[-3:], np.float32))
    assert np.abs(rows).max() == 1.0
    assert not env.reset()[0][:, 13:].any()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_stack_is_of_one_episode(mode: str) -> None:
    """It follows from the observations without a stack, which are of the same game."""
    envs, alone = (
        AirHockeyVectorEnv(3, autoreset_mode=mode, max_episode_steps=LIMIT, stack=stack, opponent="random")
        for stack in (4, 1)
    )
    still = np.zeros((3, 2), np.float32)
    history = next_history(None, alone.reset(seed=0)[0], still, 4)
    assert same(envs.reset(seed=0)[0], history)
    ends = 0
    begun = np.zeros(3, bool)
    for actions in random_actions(1, 4 * LIMIT, 3):
        seen, _, terminated, truncated, infos = envs.step(actions)
        observations, *_, expected = alone.step(actions)
        done = terminated | truncated
        if mode == "SameStep" and done.any():
            last = np.stack([np.zeros(13) if one is None else one for one in expected["final_obs"]])
            finals = next_history(history, last, actions, 4)
            assert all(same(infos["final_obs"][i], finals[i]) for i in np.flatnonzero(done))
            ends += done.sum()
        history = next_history(history, observations, actions, 4)
        fresh = done if mode == "SameStep" else begun
        history[fresh] = next_history(None, observations[fresh], still[fresh], 4)
        begun = done
        assert same(seen, history)
    assert ends > 5 or mode == "NextStep"


@pytest.mark.parametrize("obs_type", ["rgb", "grayscale"])
@pytest.mark.parametrize("randomize", [None, {"goal_width": (0.2, 0.6), "puck_radius": (0.02, 0.05)}])
def test_pictures_are_of_the_rows(obs_type: str, randomize: Any) -> None:
    arguments = {"autoreset_mode": "SameStep", "max_episode_steps": LIMIT, "randomize": randomize}
    envs, alone = (AirHockeyVectorEnv(2, obs_type=obs_type, stack=stack, **arguments) for stack in (3, 1))
    first = alone.reset(seed=0)[0]
    assert same(envs.reset(seed=0)[0], np.repeat(first[:, np.newaxis], 3, axis=1))
    pictures, ends = [first] * 3, 0
    for actions in random_actions(0, LIMIT, 2):
        seen, *_, infos = envs.step(actions)
        one, *_, expected = alone.step(actions)
        done = expected.get("_final_obs", np.zeros(2, bool))
        pictures.append(np.where(done.reshape(2, *[1] * (one.ndim - 1)), 0, one))
        for i in range(2):
            if done[i]:
                last = [*(picture[i] for picture in pictures[-3:-1]), expected["final_obs"][i]]
                assert same(infos["final_obs"][i], np.stack(last))
                assert same(seen[i], np.stack([one[i]] * 3))
                ends += 1
            else:
                assert same(seen[i], np.stack([picture[i] for picture in pictures[-3:]]))
    assert ends == 2


def test_both_players_have_a_stack_of_their_own() -> None:
    game = Game(2, left=None, right=None, left_stack=2, right_stack=5)
    env = AirHockeyParallelEnv(stack=3)
    game.reset(seed=0)
    env.reset(seed=0)
    for left, right in random_actions(0, 20, 4).reshape(20, 2, 2, 2):
        game.step(left, right)
        seen = env.step({"left": left[0], "right": right[0]})[0]
    for seat, side, stack, actions in ((LEFT, "left", 2, left), (RIGHT, "right", 5, right)):
        observations = game.observations(seat)
        assert observations.shape == (2, stack, 15)
        assert same(observations[:, -1, :13], game.out.observation[seat])
        assert same(observations[:, -1, 13:], actions.clip(-1.0, 1.0))
        assert same(observations[0, -2:], seen[side][-2:])
        assert same(game.observations(seat, np.array([1])), observations[1:])


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("wrong", [0, 65, 1.5, None, "4"])
def test_the_stack_of_a_seat_is_named(side: str, wrong: object) -> None:
    with pytest.raises(ValueError, match=rf"^{side}_stack must be .*got "):
        Game(1, **{f"{side}_stack": wrong})


# Policies


@pytest.mark.parametrize("places", [[0, 1, 2, 3, 0, 1, 2, 3], [0, 0, 1, 1, 2, 2, 3, 3]])
def test_each_policy_is_shown_the_stack_that_it_asks_for(places: list[int]) -> None:
    """Every table plays as a game that its policy has to itself."""
    stacks = 1, 4, 2
    pool = [*map(Watcher, stacks), "striker"]
    envs = AirHockeyVectorEnv(8, opponent=pool, max_episode_steps=LIMIT)
    envs.set_opponents(places)
    alone = [Watcher(stack) for stack in stacks]
    others = [AirHockeyVectorEnv(8, opponent=one, max_episode_steps=LIMIT) for one in [*alone, "striker"]]
    for one in (envs, *others):
        one.reset(seed=0)
    for actions in random_actions(0, 5 * LIMIT, 8):
        seen = envs.step(actions)[0]
        for place, other in enumerate(others):
            rows = np.array(places) == place
            assert same(seen[rows], other.step(actions)[0][rows])
    for place, policy in enumerate(alone):
        rows = np.array(places) == place
        assert same(pool[place].seen, [shown[rows] for shown in policy.seen])


def test_a_policy_sees_what_a_caller_in_its_place_sees() -> None:
    policy = some_policy(stack=3)
    by_policy = Game(3, left=None, right=policy, camera=(None, HEAVY), max_episode_steps=LIMIT)
    by_caller = Game(3, left=None, right=None, right_stack=3, camera=(None, HEAVY), max_episode_steps=LIMIT)
    for game in (by_policy, by_caller):
        game.reset(seed=0)
    for actions in random_actions(0, 40, 3):
        by_policy.step(actions)
        by_caller.step(actions, policy(by_caller.observations(RIGHT)))
        assert same(by_policy.get_state(), by_caller.get_state())


def test_what_a_scripted_player_did_is_not_known_to_its_successor() -> None:
    policy = Watcher(3)
    envs = AirHockeyVectorEnv(2, opponent=["striker", policy])
    envs.reset(seed=0)
    for actions in random_actions(0, 10, 2):
        envs.step(actions)
    envs.set_opponents(1)
    for actions in random_actions(1, 3, 2):
        envs.step(actions)
    known, unknown = (np.stack([shown[i] for shown in policy.seen[-3:]]) for i in (1, 0))
    assert known[0, :, 13:].any(axis=1).all() and not unknown[0, :, 13:].any()
    assert unknown[0, 0, :13].any() and not same(unknown[0, 0], unknown[0, 1])  # what it saw is known
    assert unknown[2, 1:, 13:].any(axis=1).all()


@pytest.mark.parametrize("before", [1, 2])
def test_a_history_grows_with_what_the_newest_policy_needs(before: int) -> None:
    """What is not known yet is like the oldest that is."""
    first, second = Watcher(before), Watcher(4)
    envs = AirHockeyVectorEnv(2, opponent=first)
    envs.reset(seed=0)
    for actions in random_actions(0, 10, 2):
        envs.step(actions)
    place, kept = envs.pool.add(second), envs.get_state()
    envs.pool.assign(place, [1])
    for actions in random_actions(1, 2, 2):
        envs.step(actions)
    assert kept["right_history"].shape == (2, 4, 15)
    assert same(kept["right_history"][:, 0], kept["right_history"][:, 4 - before])
    assert same(second.seen[0], kept["right_history"][1:])
    assert same(second.seen[1][:, :-1], second.seen[0][:, 1:])
    if before > 1:
        assert same(first.seen[10], kept["right_history"][:1, -before:])
    envs.pool.replace(place, pursue)  # what is kept stays
    assert envs.get_state()["right_history"].shape == (2, 4, 15)
    envs.reset(seed=1)


@pytest.mark.parametrize("stack", [0, 65, 2.0, "2"])
def test_a_policy_with_an_impossible_stack_is_refused(stack: Any) -> None:
    envs = AirHockeyVectorEnv(2)
    for refused in (
        lambda: AirHockeyVectorEnv(2, opponent=["idle", Watcher(stack)]),
        lambda: envs.pool.add(Watcher(stack)),
        lambda: envs.pool.replace(0, Watcher(stack)),
    ):
        with pytest.raises(ValueError, match=r"^opponent\.stack.* must be .*got "):
            refused()
    assert envs.opponents == ("striker",)


def test_a_live_match_shows_a_policy_the_times_that_it_was_asked() -> None:
    policy = Watcher(3)
    match = LiveMatch("idle", left=policy, control_hz=100, seed=0)
    for k in range(200):
        match.advance(k / 100)
    seen = np.concatenate(policy.seen)
    assert same(seen[0], np.repeat(seen[0][:1], 3, axis=0)) and not seen[0, :, 13:].any()
    assert same(seen[1:, :-1], seen[:-1, 1:])
    answers = pursue(seen[:, -1]).clip(-1.0, 1.0)
    assert same(seen[1:, -1, 13:], answers[:-1])


# States and copies


@pytest.mark.parametrize("way", ["set_state", *COPIES])
@pytest.mark.parametrize("seat", SEATS)
def test_a_game_goes_on_the_same_from_a_state_and_in_a_copy(seat: int, way: str) -> None:
    seats = (None, some_policy(stack=5)) if seat == LEFT else (some_policy(stack=5), None)
    game, other = (Game(2, left=seats[0], right=seats[1], left_stack=3, camera=HEAVY) for _ in range(2))

    def play(one: Game, seed: int, steps: int) -> None:
        for actions in random_actions(seed, steps, 2):
            one.step(*((actions, None) if seat == LEFT else (None, actions)))

    for one, seed in ((game, 1), (other, 2)):
        one.reset(seed)
        play(one, seed, 10)
    if way == "set_state":
        other.set_state(game.get_state())
    else:
        other = COPIES[way](game)
    play(game, 3, 20)
    before = other.get_state()
    play(other, 3, 20)
    assert same(other.get_state(), game.get_state()) and not same(before, game.get_state())
    assert same(other.observations(seat), game.observations(seat))


@pytest.mark.parametrize("value", [NAN, 1.5])
def test_a_damaged_history_is_refused_and_changes_nothing(value: float) -> None:
    env = begin(AirHockeyEnv(stack=4))
    before, seen = env.get_state(), env.observe()
    state = before.copy()
    state["left_history"][0, 2, 5] = value
    with pytest.raises(ValueError, match=r"^state must hold .* history"):
        env.set_state(state)
    assert same(env.get_state(), before) and same(env.observe(), seen)


def test_what_was_moved_by_hand_is_seen() -> None:
    env = begin(AirHockeyEnv(stack=3))
    seen, state = env.observe(), env.get_state()
    state["state"]["position"][0, 2] = 0.3, 0.1
    env.set_state(state)
    moved = env.observe()
    assert same(moved[:-1], seen[:-1]) and same(moved[-1, 13:], seen[-1, 13:])
    assert moved[-1, 8] == np.float32(0.3 / (0.5 * env.table.length))


def test_a_state_of_another_stack_is_refused() -> None:
    env, states = begin(AirHockeyEnv(stack=3)), [begin(AirHockeyEnv(stack=stack)).get_state() for stack in (1, 2)]
    for state in states:
        with pytest.raises(ValueError, match=r"^state must "):
            env.set_state(state)
