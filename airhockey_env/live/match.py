"""A match against the wall clock. There is no window, sound or screen in here: those call `LiveMatch.advance`.

The game steps at its own rate whatever the rate of the pictures is, and a picture lies between its last two states.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from airhockey_env.checks import check_action_delay
from airhockey_env.game import CameraLike, Game
from airhockey_env.kernel.history import next_history
from airhockey_env.kernel.scripted import SCRIPTED
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT, SEATS
from airhockey_env.live.hand import Hand
from airhockey_env.live.pointer import Pointer
from airhockey_env.live.recording import Recording
from airhockey_env.opponents.players import Player, Policy, policy_of, resolve_player, stack_of
from airhockey_env.replay.file import Replay
from airhockey_env.tables import TableSpec

CONTROL_HZ = 200.0
"""Control steps a second. More than the 50 of the environments, because a picture shows the game one step late and a
paddle can only change its mind between steps: 5 ms pass a person by, 20 ms do not. The engine's contacts are exact at
any rate, so the game is the same. A whole multiple of `POLICY_HZ`."""

POLICY_HZ = 50.0
"""How often a trained policy chooses: the rate that it was trained at."""

MOST_BEHIND = 0.1
"""s that the game may have to catch up at once. After a longer hold-up (a window being dragged, a laptop asleep) it
goes on from where it was: it never has more to do than it can."""

TRUST = 0.6
"""Share of the pointer's velocity that the paddle counts on. With none of it a paddle that is always ready to stop at
the pointer stays behind one that moves, 30 ms at 2 m/s; with all of it, it shoots far past a hand that stops harder
than the paddle can. Hands that reach over 0.4 m in 0.35 s are followed within 5 ms and without overshoot; in 0.25 s,
which takes more than the paddle's acceleration, within 10 ms and 4 mm too far."""

START_PAUSE, POINT_PAUSE, FOUL_PAUSE = 1.0, 0.8, 0.8
"""s that the game rests before a match, after a point and after a foul."""


_NOTHING = np.zeros((1, 2), np.float32)


class Event(NamedTuple):
    """Something to be heard or read."""

    kind: str  # one of KINDS
    strength: float = 1.0  # of a hit, 0 to 1
    x: float = 0.0  # m, where along the table


class Contact(NamedTuple):
    """A contact, as the engine reports it, at its time in the match."""

    time: float  # s of play since the match began
    a: int  # disc: LEFT, RIGHT or PUCK
    b: int  # disc; -1 for a wall or post
    x: float  # m, where they touch
    y: float
    nx: float  # unit normal as seen from b: it points at a
    ny: float
    impulse: float  # N s along the normal, on a


KINDS = ("paddle", "wall", "goal", "conceded", "foul", "won", "lost")


class _Held:
    """A policy whose answer holds until it is asked again.

    Args:
        policy: from observations (1, 13), or stacks of them (1, K, 15), to actions (1, 2).
        seat: LEFT or RIGHT.
        skill: the share of its paddle's speed that it uses, 0 to 1.
        steps: control steps for which an answer holds.
    """

    def __init__(self, policy: Policy, seat: int, skill: float, steps: int) -> None:
        self.policy, self._seat, self._skill, self._steps = policy, seat, np.float32(skill), steps
        self.forget()

    def forget(self) -> None:
        """Begin a match."""
        self._left = 0
        self._answer = np.zeros((1, 2), np.float32)
        self._history: NDArray[np.float32] | None = None

    def act(self, game: Game) -> NDArray[np.float32]:
        """The action (1, 2) for the coming step."""
        if not self._left:
            seen = game.out.observation[self._seat]
            if (stack := stack_of(self.policy)) > 1:  # the last times that it was asked, as when it was trained
                seen = self._history = next_history(self._history, seen, self._answer, stack)
            answer = self.policy(seen)
            self._answer = game.check_actions(self._seat, answer) * self._skill
            self._left = self._steps
        self._left -= 1
        return self._answer


class LiveMatch:
    """A match against the wall clock: of a person on the left, or of two players, against each other.

    Call `advance` for every picture with the time and the pointer's place; then `positions`, `score` and `clock` are
    what to draw.

    Args:
        right: who plays on the right: a name, the path of a policy, or a policy, as `AirHockeyEnv` takes an opponent.
        left: who plays on the left, likewise; None: a person, whose paddle follows the pointer.
        skill: share of its paddle's speed that the right player uses, 0 to 1.
        table: a preset's name or a `TableSpec`.
        camera: what the right player sees the game through, as `AirHockeyEnv` takes it; None for exact states, which
            scripted players see in any case.
        action_delay_ms: ms by which the right player's paddle obeys late, likewise.
        points: that win the match.
        control_hz: control steps a second.
        seed: of the serves; None: drawn.
        recorded: keep what is played, for `replay`.

    Raises:
        ValueError: an argument is out of range.
    """

    spec: TableSpec
    game: Game
    """The game on one table that is played."""
    positions: NDArray[np.float64]
    """(3, 2) m: left paddle, right paddle, puck, as they are to be drawn."""
    contacts: list[Contact]
    """The contacts of the steps that the last `advance` has played, in order."""
    elapsed: float
    """s of play from the beginning of the match to what `positions` show."""
    resting: bool
    """Whether the game rests: before a serve, while it is paused, or because the match is over."""
    notice: str
    """What the game rests for: "start", "goal", "conceded", "foul", "paused", "won", "lost", or "" while it does not.
    The left player has won, scored or conceded."""

    def __init__(
        self,
        right: Player,
        *,
        left: Player | None = None,
        skill: float = 1.0,
        table: str | TableSpec = "full_size",
        camera: CameraLike | None = None,
        action_delay_ms: float | Sequence[float] = 0,
        points: int = 7,
        control_hz: float = CONTROL_HZ,
        seed: int | None = None,
        recorded: bool = False,
    ) -> None:
        players = {"left": left, "right": right}
        seats = [None if who is None else resolve_player(name, who) for name, who in players.items()]
        scripted = [seat if isinstance(seat, str) and seat in SCRIPTED else None for seat in seats]
        self.game = Game(
            1,
            table=table,
            camera=(None, camera),
            right_action_delay_ms=check_action_delay("action_delay_ms", action_delay_ms),
            left=scripted[LEFT],
            right=scripted[RIGHT],
            right_skill=skill,
            points=points,
            control_hz=control_hz,
            autoreset_mode=AutoresetMode.DISABLED,
            num_threads=1,
        )
        hold = max(1, round(control_hz / POLICY_HZ))
        self._policies = [
            None if seat is None or driver is not None else _Held(policy_of(seat), side, share, hold)
            for side, seat, driver, share in zip(SEATS, seats, scripted, (1.0, skill), strict=True)
        ]
        self._by_hand = left is None
        self._seed: int | None = int(np.random.SeedSequence(seed).generate_state(1)[0])
        self.spec, self.points = self.game.spec, points
        self._tick = 1.0 / control_hz
        self._state = self.game.states[0]
        radius, params = self.spec.paddle_radius, self.game.parameters[0]
        self.hand = Hand(
            speed=self.spec.paddle_speed,
            step=float(params["paddle_step"]),
            tick=self._tick,
            near=(radius - 0.5 * self.spec.length, radius - 0.5 * self.spec.width),
            far=(-radius, 0.5 * self.spec.width - radius),
        )
        self._recording = Recording(self.game) if recorded else None
        self.restart(0.0)

    def restart(self, now: float) -> None:
        """Begin a new match; it is on after a short rest. What was recorded of the last one is forgotten."""
        self.game.reset(self._seed)
        self._seed = None
        if self._recording is not None:
            self._recording.begin()
        for policy in self._policies:
            if policy is not None:
                policy.forget()
        self._pointer = Pointer()
        self._played = now  # the time on the wall up to which the game has been played
        self._before = self._places()
        self._bends: list[Contact] = []  # the puck's contacts in the last step: its way bends there
        self.positions, self.contacts, self.elapsed = self._before, [], 0.0
        self._shown_score, self._shown_clock = self._now_score(), self._now_clock()
        self._rest(now, START_PAUSE, "start")

    def pause(self) -> None:
        """Rest until `resume` is called. A match that is over stays so."""
        if not self.over:
            self._rest(0.0, math.inf, "paused")

    def resume(self, now: float) -> None:
        """Go on after `pause`, when a short rest is over."""
        if self.notice == "paused":
            self._rest(now, START_PAUSE, "paused")

    def replace(self, seat: int, policy: Policy) -> None:
        """Let another policy play at a seat from the next step on.

        Args:
            seat: LEFT or RIGHT, where a policy plays.
            policy: from observations (1, 13) to actions (1, 2).

        Raises:
            ValueError: no policy plays there.
        """
        held = self._policies[seat]
        if held is None:
            raise ValueError(f"seat must be one at which a policy plays, got {seat!r}")
        held.policy = policy

    # What to draw -----------------------------------------------------------------------------------------------

    @property
    def score(self) -> tuple[int, int]:
        """Points of the left and of the right player."""
        return self._shown_score

    @property
    def clock(self) -> float:
        """Share of the shot clock that is used up, negative while the puck is on the left side."""
        return self._shown_clock

    @property
    def over(self) -> bool:
        """Whether somebody has won."""
        return bool(self._state["done"])

    @property
    def target(self) -> tuple[float, float] | None:
        """Where the pointer is, m; None before it has been anywhere."""
        return self._pointer.place(math.inf) if self._pointer else None

    def replay(self) -> Replay:
        """What was played since the match began, or the first half hour of that.

        Raises:
            ValueError: nothing was recorded.
        """
        if self._recording is None:
            raise ValueError("recorded must be True to replay a match")
        return self._recording.replay()

    # What happens -----------------------------------------------------------------------------------------------

    def advance(self, now: float, pointer: tuple[float, float] | None = None) -> list[Event]:
        """Play up to a time on the wall.

        Args:
            now: s, of a clock that never goes back.
            pointer: where the person points, m; None: unknown, nothing has changed.

        Returns:
            What happened meanwhile, in order.
        """
        if pointer is not None:
            self._pointer.move(now, pointer)
        events: list[Event] = []
        self.contacts = []
        if self.resting and not self.over and now >= self._rest_until:
            self._played = max(self._played, self._rest_until)
            self._before, self._bends = self._places(), []
            self.resting, self.notice = False, ""
        self._played = max(self._played, now - MOST_BEHIND)
        while not self.resting and now - self._played >= self._tick:
            self._played += self._tick
            self._step(events)
        if not self.resting:
            share = (now - self._played) / self._tick
            self.positions = self._before + share * (self._places() - self._before)
            self.elapsed = max(0.0, (int(self._state["steps"]) - 1 + share) * self._tick)
            if self._bends:
                self.positions[PUCK] = self._puck_at(self.elapsed)
            self._shown_score, self._shown_clock = self._now_score(), self._now_clock()
        return events

    def _step(self, events: list[Event]) -> None:
        game = self.game
        self._before = self._places()
        velocity, score = self._state["velocity"].copy(), self._now_score()
        left, right = (self._actions_of(seat) for seat in SEATS)
        game.play(left, right)
        if self._recording is not None:
            self._recording.add(left[0], game.played_actions(RIGHT)[0])
        self._bends = self._contacts_of_the_step()
        self.contacts += self._bends
        for contact in self._bends:
            kind = "wall" if contact.b < 0 else "paddle"
            speed = abs(contact.impulse) / (self.spec.puck_mass * self.spec.puck_speed)
            events.append(Event(kind, min(speed, 1.0), contact.x))
        if self._now_score() != score:
            won = self._now_score()[0] > score[0]
            if self.over:
                self._stop(events, math.inf, "won" if won else "lost", velocity)
            else:
                self._stop(events, POINT_PAUSE, "goal" if won else "conceded", velocity)
        elif game.out.foul[0]:
            self._stop(events, FOUL_PAUSE, "foul", velocity)

    def _contacts_of_the_step(self) -> list[Contact]:
        """All of them are the puck's: paddles touch nothing else."""
        count = int(self.game.out.n_contacts[0])
        if not count:
            return []
        begin = (int(self._state["steps"]) - 1) * self._tick
        found = (Contact(*contact) for contact in self.game.out.contacts[0, :count].tolist())
        return [contact._replace(time=begin + contact.time) for contact in found]

    def _puck_at(self, time: float) -> tuple[float, float]:
        """Where the puck was in the last step, (2,) m: on straight lines from contact to contact."""
        begin = (int(self._state["steps"]) - 1) * self._tick
        corners = [(begin, *self._before[PUCK]), (begin + self._tick, *self._state["position"][PUCK])]
        for contact in self._bends:
            away = self.spec.puck_radius if contact.a == PUCK else -self.spec.puck_radius  # the normal points at a
            corners.insert(-1, (contact.time, contact.x + away * contact.nx, contact.y + away * contact.ny))
        times, *places = zip(*corners, strict=True)
        x, y = (float(np.interp(time, times, place)) for place in places)
        return x, y

    def _actions_of(self, seat: int) -> NDArray[np.float32]:
        """What the player at a seat does in the tick that ends at `_played`, (1, 2)."""
        policy = self._policies[seat]
        if policy is not None:
            return policy.act(self.game)
        if seat == LEFT and self._by_hand:
            return np.array([self._action()], np.float32)
        return _NOTHING  # a scripted player moves its own paddle

    def _action(self) -> tuple[float, float]:
        """What the person's paddle does in the tick that ends at `_played`."""
        place = self._state["position"][LEFT]
        if not self._pointer:
            return 0.0, 0.0
        there, velocity = self._pointer.place(self._played), self._pointer.velocity(self._played)
        target = self.hand.reachable(there)
        # A pointer that is out of reach moves the paddle along the edge of its half only.
        vx, vy = (TRUST * v if p == q else 0.0 for v, p, q in zip(velocity, there, target, strict=True))
        return self.hand.follow(place, self._state["velocity"][LEFT], target, (vx, vy))

    def _stop(self, events: list[Event], seconds: float, notice: str, velocity: NDArray[np.float64]) -> None:
        """Rest on a picture of what ended the rally; the table may have been laid for the serve already."""
        self._bends = []
        self.positions = self._before + velocity * self._tick
        line = 0.5 * self.spec.length
        self.positions[PUCK, 0] = min(max(self.positions[PUCK, 0], -line), line)
        for player in (LEFT, RIGHT):
            self.positions[player] = self._before[player]
        self._shown_score = self._now_score()
        events.append(Event(notice, x=float(self.positions[PUCK, 0])))
        self._rest(self._played, seconds, notice)

    def _rest(self, since: float, seconds: float, notice: str) -> None:
        self.resting, self.notice, self._rest_until = True, notice, since + seconds

    def _places(self) -> NDArray[np.float64]:
        return self._state["position"].copy()

    def _now_score(self) -> tuple[int, int]:
        left, right = self._state["score"].tolist()
        return left, right

    def _now_clock(self) -> float:
        return int(self._state["side"]) * float(self.game.shot_clock[0])
