"""Sessions without sockets: what each message does, and what is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from airhockey_env.kernel.state import LEFT, PUCK
from airhockey_env.live.match import CONTROL_HZ, START_PAUSE
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.trained import trained_policy
from airhockey_env.replay import Replay, play_back
from airhockey_env.web.catalogue import Catalogue
from airhockey_env.web.limits import Limits
from airhockey_env.web.messages import Refused
from airhockey_env.web.sessions import SESSIONS
from tests.helpers import still_policy

Ask = Callable[..., Any]
"""From a type, a time and fields to the answer."""


def session(kind: str, catalogue: Catalogue | None = None, **limits: Any) -> Ask:
    """A session; what it answers has gone through JSON, as over a socket."""
    made = SESSIONS[kind](catalogue or Catalogue(), Limits(**limits))

    def ask(message: str, now: float, **fields: Any) -> Any:
        answer = made.answer(json.dumps({"type": message, **fields}), now)
        if callable(answer):
            answer = answer()
        return json.loads(json.dumps(answer)) if isinstance(answer, dict) else answer

    return ask


@pytest.mark.parametrize("kind", ["play", "watch"])
def test_nothing_can_be_done_before_the_start(kind: str) -> None:
    with pytest.raises(Refused, match="start one first"):
        session(kind)("turn", 0.0)


@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("play", {"opponent": "/etc/passwd"}),
        ("play", {"opponent": "runs/baseline"}),
        ("play", {"opponent": ["striker"]}),
        ("play", {"table": {"length": 1}}),
        ("play", {"skill": 2.0}),
        ("play", {"points": 0}),
        ("play", {"points": 1.5}),
        ("play", {"seed": 1}),
        ("watch", {"left": "my.npz"}),
        ("watch", {"run": "."}),
        ("watch", {"speed": 1000}),
    ],
)
def test_what_visitors_may_not_choose(kind: str, fields: dict[str, Any]) -> None:
    with pytest.raises(Refused, match=next(iter(fields))):
        session(kind)("start", 0.0, **fields)


# Play


def play(**fields: Any) -> Ask:
    """A match that begins at 0 s and is on from `START_PAUSE`."""
    ask = session("play")
    ask("start", 0.0, **fields)
    ask("turn", START_PAUSE)
    return ask


def test_the_paddle_follows_the_pointer_and_the_state_says_so() -> None:
    ask = play(opponent="idle", table="challenge", points=3)
    state = {}
    for k in range(60):
        state = ask("turn", START_PAUSE + k / 60, pointer=[-0.6, 0.3])
    assert state["type"] == "state" and state["time"] == pytest.approx(START_PAUSE + 59 / 60, abs=1e-4)
    assert state["positions"][LEFT] == pytest.approx([-0.6, 0.3], abs=1e-3)
    assert state["score"] == [0, 0] and state["notice"] == "" and -1.0 <= state["clock"] <= 1.0


@pytest.mark.parametrize("pointer", [[1], [1, 2, 3], ["a", 0], [11, 0], [True, 0], 5, "here", {}, [None, None]])
def test_pointers_that_are_none(pointer: Any) -> None:
    with pytest.raises(Refused, match="pointer must be"):
        play()("turn", 2.0, pointer=pointer)


def test_a_pause_and_a_restart() -> None:
    ask = play(opponent="striker")
    ask("turn", START_PAUSE + 0.1)
    assert ask("pause", START_PAUSE + 0.1) is None
    assert ask("turn", START_PAUSE + 0.2)["notice"] == "paused"
    assert ask("resume", 100.0) is None
    assert ask("turn", 100.0 + START_PAUSE + 0.01)["notice"] == ""
    assert ask("restart", 200.0) is None
    assert ask("turn", 200.0)["notice"] == "start"


@pytest.mark.parametrize("opponent", ["striker", "expert"])
def test_a_match_is_downloaded_and_plays_back_to_the_bit(opponent: str, tmp_path: Path) -> None:
    ask = play(opponent=opponent, points=1, skill=0.9)
    now, state = START_PAUSE, {"notice": ""}
    while state["notice"] not in ("won", "lost"):
        now += 1 / 60
        assert now < 200.0
        state = ask("turn", now, pointer=[-0.8, 0.2 * np.sin(5.0 * now)])
    (tmp_path / "match.npz").write_bytes(ask("replay", now))
    states = list(play_back(Replay.load(tmp_path / "match.npz")))
    assert states[-1]["done"].all() and states[-1]["score"][0].tolist() == state["score"]


def test_players_of_the_servers_owner_play_under_their_names() -> None:
    asked = []

    def mine(observations: np.ndarray) -> np.ndarray:
        asked.append(observations.copy())
        return np.zeros((1, 2))

    ask = session("play", Catalogue({"mine": mine}))
    assert ask("start", 0.0, opponent="mine")["opponent"] == "mine"
    ask("turn", START_PAUSE)
    ask("turn", START_PAUSE + 0.1)
    assert asked


# Watch


def watch(catalogue: Catalogue | None = None, **fields: Any) -> Ask:
    """A match of two players that begins at 0 s and has been on for a moment."""
    ask = session("watch", catalogue, answer_seconds=10.0)
    ask("start", 0.0, **fields)
    for k in range(20):
        ask("turn", k / 10)
    return ask


@pytest.mark.parametrize("speed", [0.1, 1.0, 20.0])
def test_matches_are_watched_at_any_speed(speed: float) -> None:
    ask = watch(left="idle", right="idle")
    ask("speed", 2.0, speed=speed)
    before = ask("turn", 2.0)["elapsed"]
    after = ask("turn", 2.05)
    assert after["elapsed"] - before == pytest.approx(0.05 * speed, abs=1e-6)
    assert after["time"] == 2.05


def test_a_page_that_has_not_asked_for_long_goes_on_from_where_it_was() -> None:
    ask = watch(left="idle", right="idle")
    before = ask("turn", 2.0)["elapsed"]
    assert ask("turn", 500.0)["elapsed"] - before == pytest.approx(0.1, abs=1e-6)


def test_an_answer_takes_so_long_at_most() -> None:
    ask = session("watch", answer_seconds=0.0)
    ask("start", 0.0, left="striker", right="striker", speed=100.0)
    elapsed = [ask("turn", k / 60)["elapsed"] for k in range(30)]
    assert elapsed[-1] > 0.0 and np.diff(elapsed).max() <= 0.05 + 1e-9  # and not 100 / 60 s


def test_single_steps() -> None:
    ask = watch(left="striker", right="striker", speed=0.0)
    ask("turn", 2.0)
    shown = [ask("step", 2.0 + k)["elapsed"] for k in range(300)]
    assert shown[-1] - shown[-2] == pytest.approx(1.0 / CONTROL_HZ)
    assert ask("turn", 400.0)["elapsed"] == shown[-1]


def test_contacts_are_told_when_they_are_asked_for() -> None:
    ask = watch(left="striker", right="striker", points=99)
    now, found = 2.0, []
    assert "contacts" not in ask("turn", now)
    while len(found) < 20:
        now += 1 / 60
        state = ask("turn", now, contacts=True)
        found += [(contact, state["elapsed"]) for contact in state["contacts"]]
    for (time, a, b, x, y, nx, ny, impulse), elapsed in found:
        assert elapsed - 0.1 < time < elapsed + 1.0 / CONTROL_HZ
        assert PUCK in (a, b) and (b == -1 or a < b)
        assert np.hypot(nx, ny) == pytest.approx(1.0) and abs(x) < 1.2 and abs(y) < 0.6
        assert impulse >= 0.0


def test_a_run_is_watched_while_its_policy_changes(tmp_path: Path) -> None:
    ask = session("watch", Catalogue(runs={"mine": tmp_path}))
    assert ask("start", 0.0, run="mine") == {"type": "waiting", "run": "mine"}
    with pytest.raises(Refused, match="start"):
        ask("turn", 0.1)
    still_policy().save(tmp_path / "policy.npz")
    assert ask("start", 1.0, run="mine")["left"] == "mine"
    state = {}
    for k in range(30):
        state = ask("turn", 1.0 + k / 10)
    home = state["positions"][LEFT]
    first = state["written"]
    trained_policy("adept").save(tmp_path / "policy.npz")
    moved = 0.0
    for k in range(60):
        state = ask("turn", 4.0 + k / 10)
        moved = max(moved, float(np.abs(np.subtract(state["positions"][LEFT], home)).max()))
    assert state["written"] > first and moved > 0.02
    (tmp_path / "policy.npz").write_bytes(b"PK half of it")
    for k in range(30):
        assert ask("turn", 10.0 + k / 10)["written"] == state["written"]  # the last one that can be read goes on


def test_answers_are_short_at_high_speed() -> None:
    ask = watch(left="striker", right="striker", points=99, speed=100.0)
    for k in range(20):
        state = ask("turn", 2.0 + k / 10, contacts=True)
        assert len(state["events"]) <= 20 and len(state["contacts"]) <= 200


def test_a_policy_is_replaced_only_where_one_plays() -> None:
    from airhockey_env.live import LiveMatch

    policy = MlpPolicy([np.zeros((2, 13), np.float32)], [np.zeros(2, np.float32)])
    with pytest.raises(ValueError, match="seat must be"):
        LiveMatch("striker").replace(LEFT, policy)
