"""A delay of actions: what reaches the paddle, and when.

That every API does the same is a matter of tests/api/test_parity.py.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from airhockey_env import LEFT, RIGHT, AirHockeyEnv, AirHockeyVectorEnv, Game
from airhockey_env.actions import DIRECTIONS
from airhockey_env.kernel.state import SEATS
from airhockey_env.parallel_env import AirHockeyParallelEnv
from airhockey_env.replay import RecordReplay, RecordVectorReplay, play_back
from airhockey_env.replay.parallel import RecordParallelReplay
from airhockey_env.saved_states import game_state
from tests.helpers import COPIES, NAN, begin, pursue, random_actions, same

STILL = np.zeros(2, np.float32)


def late(actions: NDArray[np.float32], delay_ms: float, control_hz: float) -> NDArray[np.float32]:
    """What reaches a paddle of actions (steps, ..., 2) from the start of an episode on."""
    steps = delay_ms * control_hz / 1000.0
    whole = math.floor(steps)
    share, length = steps - whole, len(actions)
    waiting = np.concatenate([np.zeros((whole + 1, *actions.shape[1:])), actions.clip(-1.0, 1.0).astype(np.float64)])
    return (share * waiting[:length] + (1.0 - share) * waiting[1 : length + 1]).astype(np.float32)


def delays_of(game: Game, seat: int = LEFT) -> NDArray[np.float64]:
    """(N,) ms, the delay of every table in this episode."""
    return game.interfaces[seat].delay.arrays.states["steps"] * 1000.0 / game.control_hz


@pytest.mark.parametrize("control_hz", [50, 33.3])
@pytest.mark.parametrize("delay_ms", [0.1, 7, 20, 20.5, 60, 333, 1000])
@pytest.mark.parametrize("continuous", [True, False])
def test_a_paddle_obeys_what_was_sent_a_while_ago(continuous: bool, delay_ms: float, control_hz: float) -> None:
    """The game is that of a player without a delay, who sends what arrives."""
    arguments = {"opponent": "idle", "control_hz": control_hz}
    ours = AirHockeyVectorEnv(2, action_delay_ms=delay_ms, continuous=continuous, **arguments)
    theirs = AirHockeyVectorEnv(2, **arguments)
    drawn = random_actions(0, 80, 2, continuous)
    arrivals = late(drawn if continuous else DIRECTIONS[drawn], delay_ms, control_hz)
    out_of_reach = {"puck_position": (0.9, 0.4)}
    for seed in (0, 1):
        assert same(*(envs.reset(seed=seed, options=out_of_reach) for envs in (ours, theirs)))
        for actions, arriving in zip(drawn, arrivals, strict=True):
            assert same(ours.step(actions), theirs.step(arriving))
            assert same(ours._game.played_actions(LEFT), arriving)


def test_no_delay_is_nothing() -> None:
    game = Game(1, left_action_delay_ms=0, right_action_delay_ms=[0.0, 0.0])
    assert not game.interfaces.parts
    assert game.get_state().dtype == Game(1).get_state().dtype


def test_a_delay_is_drawn_evenly_for_every_table_and_episode() -> None:
    envs, alone = AirHockeyVectorEnv(2000, action_delay_ms=(10, 50)), AirHockeyVectorEnv(2000)
    drawn = []
    for seed in (0, None):
        envs.reset(seed=seed), alone.reset(seed=seed)
        drawn.append(delays_of(envs._game))
        assert drawn[-1].min() >= 10 and drawn[-1].max() <= 50
        assert np.histogram(drawn[-1], bins=8, range=(10, 50))[0] == pytest.approx(250, abs=75)
        assert same(game_state(envs.get_state()), alone.get_state())  # from a stream of its own
    assert abs(np.corrcoef(drawn)[0, 1]) < 0.1
    both = Game(2000, left=None, right=None, left_action_delay_ms=(10, 50), right_action_delay_ms=(10, 50))
    both.reset(seed=0)
    assert same(delays_of(both), drawn[0]) and abs(np.corrcoef(drawn[0], delays_of(both, RIGHT))[0, 1]) < 0.1


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_an_episode_begins_without_actions_and_with_a_delay_of_its_own(mode: str) -> None:
    arguments = {"autoreset_mode": mode, "max_episode_steps": 6, "opponent": "idle"}
    envs, alone = AirHockeyVectorEnv(2, action_delay_ms=(30, 100), **arguments), AirHockeyVectorEnv(2, **arguments)
    envs.reset(seed=0), alone.reset(seed=0)
    delays = []
    drawn = random_actions(0, 7 if mode == "NextStep" else 6, 2)
    for _ in range(4):
        delays.append(delays_of(envs._game))
        arriving = np.stack([late(drawn[:, i], delays[-1][i], 50) for i in range(2)], axis=1)
        for actions, ones in zip(drawn, arriving, strict=True):
            assert same(envs.step(actions)[:4], alone.step(ones)[:4])
    assert len(np.unique(delays)) == 8


def test_policies_are_late_and_scripted_players_are_not() -> None:
    pool = [pursue, "striker"]
    late_game = Game(2, left="striker", right=pool, left_action_delay_ms=40, right_action_delay_ms=40)
    by_caller = Game(2, left="striker", right=None, right_action_delay_ms=40)
    alone = Game(2, left="striker", right="striker")
    for game in (late_game, by_caller, alone):
        game.reset(seed=0)
    for _ in range(60):
        late_game.step()
        by_caller.step(right=pursue(by_caller.out.observation[RIGHT]))
        alone.step()
        assert same(late_game.positions[0], by_caller.positions[0]) and same(late_game.positions[1], alone.positions[1])
    late_game.pools[RIGHT].assign(0)
    late_game.step()
    assert late_game.played_actions(RIGHT)[0].any() and not late_game.played_actions(RIGHT)[1].any()


def test_a_stack_has_what_was_sent() -> None:
    env = AirHockeyEnv(stack=3, action_delay_ms=1000)
    env.reset(seed=0)
    for action in random_actions(0, 10, 1)[:, 0]:
        seen = env.step(action)[0]
        assert same(seen[-1, 13:], action.clip(-1.0, 1.0)) and seen[-1, 2:4].tolist() == [0.0, 0.0]


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("wrong", [-1, 1000.5, NAN, None, "5", [5], [3, 2], (1, NAN), (0, 1, 2)])
def test_the_delay_of_a_seat_is_named(side: str, wrong: object) -> None:
    with pytest.raises(ValueError, match=rf"^{side}_action_delay_ms must be .*got "):
        Game(1, **{f"{side}_action_delay_ms": wrong})


# States, copies and replays


@pytest.mark.parametrize("way", ["set_state", *COPIES])
def test_a_game_goes_on_the_same_from_a_state_and_in_a_copy(way: str) -> None:
    arguments: dict[str, Any] = {"left_action_delay_ms": (0, 100), "right_action_delay_ms": 33}
    game, other = (Game(2, left=None, right=pursue, **arguments) for _ in range(2))
    for one, seed in ((game, 1), (other, 2)):
        one.reset(seed)
        for actions in random_actions(seed, 21, 2):
            one.step(actions)
    if way == "set_state":
        other.set_state(game.get_state())
    else:
        other = COPIES[way](game)
    for actions in random_actions(3, 60, 2):
        game.step(actions)
    assert not same(other.get_state(), game.get_state())
    for actions in random_actions(3, 60, 2):
        other.step(actions)
    assert same(other.get_state(), game.get_state())


@pytest.mark.parametrize(
    ("field", "value"),
    [("steps", -0.1), ("steps", 5.1), ("steps", NAN), ("next", -1), ("next", 7), ("sent", NAN), ("sent", 1.5)],
)
@pytest.mark.parametrize("seat", SEATS)
def test_a_damaged_state_is_refused_and_changes_nothing(seat: int, field: str, value: float) -> None:
    game = Game(2, left=None, right=None, left_action_delay_ms=(0, 100), right_action_delay_ms=(0, 100))
    game.reset(1)
    for left, right in random_actions(1, 21, 4).reshape(21, 2, 2, 2):
        game.step(left, right)
    before = game.get_state()
    state, side = before.copy(), ("left", "right")[seat]
    (state[f"{side}_sent_actions"] if field == "sent" else state[f"{side}_action_delay"][field])[1] = value
    with pytest.raises(ValueError, match=r"^state must hold .* delay of actions"):
        game.set_state(state)
    assert same(game.get_state(), before)


def test_a_state_of_another_delay_is_refused() -> None:
    env = begin(AirHockeyEnv(action_delay_ms=30))
    for other in (0, 500, 31):
        with pytest.raises(ValueError, match=r"^state must "):
            env.set_state(begin(AirHockeyEnv(action_delay_ms=other)).get_state())


@pytest.mark.parametrize("continuous", [True, False])
@pytest.mark.parametrize("api", ["single", "batch", "parallel"])
def test_a_replay_needs_no_delay(api: str, continuous: bool, tmp_path: Path) -> None:
    """It holds what reached the paddles."""
    path, drawn = tmp_path / "game.npz", random_actions(0, 60, 2, continuous)
    arguments: dict[str, Any] = {"action_delay_ms": (5, 90), "continuous": continuous, "max_episode_steps": 25}
    states: list[NDArray[np.void]] = []
    if api == "single":
        env = RecordReplay(AirHockeyEnv(opponent=pursue, **arguments), path)
    elif api == "batch":
        env = RecordVectorReplay(AirHockeyVectorEnv(2, opponent=pursue, autoreset_mode="SameStep", **arguments), path)
    else:
        env = RecordParallelReplay(AirHockeyParallelEnv(**arguments), path)
    env.reset(seed=3)
    for actions in drawn:
        if api == "parallel":
            over = not env.env.agents or any(env.step({"left": actions[0], "right": actions[1]})[3].values())
        else:
            _, _, terminated, truncated, _ = env.step(actions if api == "batch" else actions[0])
            over = bool(np.any(terminated | truncated))
        states.append(game_state(env.unwrapped._game.get_state())[:1])
        if over and api != "batch":
            env.reset()
    env.close()
    back = list(play_back(path))
    shown = {state["position"].tobytes() for state in back}
    assert len(back) > 60 and all(state["position"].tobytes() in shown for state in states)
