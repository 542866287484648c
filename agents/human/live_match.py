"""A match against the clock on the wall: a person's pointer moves the left paddle. No window, sound or screen in here.

The game steps at its own rate whatever the rate of the pictures is, and a picture lies between its last two states.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from agents.models import Player, in_one_game, join
from airhockey_env.game import Game
from airhockey_env.kernel.scripted import SCRIPTED
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.opponents.players import policy_of
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

GRASP = 0.016
"""s over which the pointer's velocity is measured, twice: about one picture, and a few reports of a mouse."""

TRUST = 0.6
"""Share of the pointer's velocity that the paddle counts on. With none of it a paddle that is always ready to stop at
the pointer stays behind one that moves, 30 ms at 2 m/s; with all of it, it shoots far past a hand that stops harder
than the paddle can. Hands that reach over 0.4 m in 0.35 s are followed within 5 ms and without overshoot; in 0.25 s,
which takes more than the paddle's acceleration, within 10 ms and 4 mm too far."""

START_PAUSE, POINT_PAUSE, FOUL_PAUSE = 1.0, 0.8, 0.8
"""s that the game rests before a match, after a point and after a foul."""


class Event(NamedTuple):
    """Something to be heard or read."""

    kind: str  # one of KINDS
    strength: float = 1.0  # of a hit, 0 to 1
    x: float = 0.0  # m, where along the table


KINDS = ("paddle", "wall", "goal", "conceded", "foul", "won", "lost")


def approach_speed(distance: float, step: float, tick: float) -> float:
    """The greatest speed for the coming tick from which one can still stop within `distance`.

    Exact for a velocity that is constant within a tick and falls by at most `step` from one to the next: with n ticks
    left, the speeds w, w - step, ..., w - (n - 1) * step cover the distance and leave nothing.
    """
    ticks = math.ceil(0.5 * (math.sqrt(1.0 + 8.0 * distance / (tick * step)) - 1.0) - 1e-9)
    return 0.0 if ticks < 1 else (distance / tick + 0.5 * step * ticks * (ticks - 1)) / ticks


class Hand(NamedTuple):
    """What a paddle can do; one tick's worth of it."""

    speed: float  # m/s, greatest
    step: float  # m/s, greatest change of velocity in a tick
    tick: float  # s
    near: tuple[float, float]  # m, least x and y
    far: tuple[float, float]  # m, greatest x and y

    def reachable(self, place: tuple[float, float]) -> tuple[float, float]:
        """The place nearest to the given one at which the paddle can be."""
        x, y = (min(max(p, low), high) for p, low, high in zip(place, self.near, self.far, strict=True))
        return x, y

    def follow(
        self,
        place: NDArray[np.float64],
        velocity: NDArray[np.float64],
        target: tuple[float, float],
        target_velocity: tuple[float, float] = (0.0, 0.0),
    ) -> tuple[float, float]:
        """The action that brings the paddle to a target as fast as its limits allow, and stops it there.

        Args:
            place, velocity: of the paddle, (2,) m and m/s.
            target: where the target will be at the end of the tick, m.
            target_velocity: its velocity, m/s: the paddle brakes down to this one, so that it keeps up with a target
                that moves.

        Returns:
            The target velocity as a share of the greatest speed.
        """
        # As seen by somebody who moves along with the target.
        ux, uy = target_velocity
        dx = target[0] - ux * self.tick - place[0]
        dy = target[1] - uy * self.tick - place[1]
        distance = math.hypot(dx, dy)
        if distance > 0.0:
            dx, dy = dx / distance, dy / distance
        # What turns the paddle's way towards the target is not there for braking.
        across = min(abs(dx * (velocity[1] - uy) - dy * (velocity[0] - ux)), 0.8 * self.step)
        step = math.sqrt(self.step * self.step - across * across)
        wanted = approach_speed(distance, step, self.tick)
        vx, vy = ux + wanted * dx, uy + wanted * dy
        share = 1.0 / max(self.speed, math.hypot(vx, vy))
        return vx * share, vy * share


class Pointer:
    """Where the pointer was in the last moments: a path through what was reported of it."""

    def __init__(self) -> None:
        self._path: deque[tuple[float, float, float]] = deque()  # s, m, m

    def __bool__(self) -> bool:
        return bool(self._path)

    def move(self, now: float, place: tuple[float, float]) -> None:
        """Note where the pointer is now."""
        self._path.append((now, *place))
        while len(self._path) > 2 and self._path[1][0] < now - MOST_BEHIND - 3.0 * GRASP:
            self._path.popleft()

    def place(self, time: float) -> tuple[float, float]:
        """Where it was; between two reports on the straight line between them."""
        after = self._path[-1]
        if time >= after[0]:
            return after[1], after[2]
        for before in reversed(self._path):
            if before[0] <= time:
                share = (time - before[0]) / (after[0] - before[0])
                return before[1] + share * (after[1] - before[1]), before[2] + share * (after[2] - before[2])
            after = before
        return after[1], after[2]

    def velocity(self, time: float) -> tuple[float, float]:
        """The velocity that it will keep as far as one can tell: that of the last two moments. One that gets slower is
        taken to go on doing so; one that has stopped, jumped or turned back has none.
        """
        now, before, earlier = (self.place(time - k * GRASP) for k in range(3))
        vx, vy = (_kept((a - b) / GRASP, (b - c) / GRASP) for a, b, c in zip(now, before, earlier, strict=True))
        return vx, vy


def _kept(latest: float, earlier: float) -> float:
    """What is left of a velocity along one axis."""
    if latest * earlier <= 0.0:
        return 0.0
    if abs(latest) > abs(earlier):
        return earlier
    slower = 2.0 * latest - earlier
    return slower if slower * latest > 0.0 else 0.0


class LiveMatch:
    """A match of a person, on the left, against an opponent.

    Call `advance` for every picture with the time and the pointer's place; then `positions`, `score` and `clock` are
    what to draw.

    Args:
        opponent: as `play_points` takes it.
        skill: share of its paddle's speed that the opponent uses, 0 to 1.
        table: a preset's name or a `TableSpec`.
        points: that win the match.
        seed: of the serves; None: drawn.

    Raises:
        ValueError: an argument is out of range.
    """

    spec: TableSpec
    positions: NDArray[np.float64]
    """(3, 2) m: left paddle, right paddle, puck, as they are to be drawn."""
    paused: bool
    """Whether the game rests: before a serve, or because the match is over."""
    notice: str
    """What the game rests for: "start", "goal", "conceded", "foul", "won", "lost", or "" while it does not."""

    def __init__(
        self,
        opponent: Player,
        *,
        skill: float = 1.0,
        table: str | TableSpec = "full_size",
        points: int = 7,
        control_hz: float = CONTROL_HZ,
        seed: int | None = None,
    ) -> None:
        player = in_one_game(opponent)
        scripted = isinstance(player, str) and player in SCRIPTED
        self._policy = None if scripted else policy_of(player)
        self._game = Game(
            1,
            table=table,
            right=player if scripted else None,
            right_skill=skill,
            points=points,
            control_hz=control_hz,
            autoreset_mode=AutoresetMode.DISABLED,
            num_threads=1,
        )
        join(self._game, player)
        self._skill = np.float32(skill)
        self._seed: int | None = int(np.random.SeedSequence(seed).generate_state(1)[0])
        self.spec, self.points = self._game.spec, points
        self._tick = 1.0 / control_hz
        self._hold = max(1, round(control_hz / POLICY_HZ))
        self._state = self._game.states[0]
        radius, params = self.spec.paddle_radius, self._game.parameters[0]
        self.hand = Hand(
            speed=self.spec.paddle_speed,
            step=float(params["paddle_step"]),
            tick=self._tick,
            near=(radius - 0.5 * self.spec.length, radius - 0.5 * self.spec.width),
            far=(-radius, 0.5 * self.spec.width - radius),
        )
        self.restart(0.0)

    def restart(self, now: float) -> None:
        """Begin a new match; it is on after a short rest."""
        self._game.reset(self._seed)
        self._seed = None
        self._answer = np.zeros((1, 2), np.float32)
        self._steps = 0
        self._pointer = Pointer()
        self._played = now  # the time on the wall up to which the game has been played
        self._before = self._places()
        self.positions = self._before
        self._shown_score, self._shown_clock = self._now_score(), self._now_clock()
        self._rest(now, START_PAUSE, "start")

    # What to draw -----------------------------------------------------------------------------------------------

    @property
    def score(self) -> tuple[int, int]:
        """Points of the person and of the opponent."""
        return self._shown_score

    @property
    def clock(self) -> float:
        """Share of the shot clock that is used up, negative while the puck is on the person's side."""
        return self._shown_clock

    @property
    def over(self) -> bool:
        """Whether somebody has won."""
        return bool(self._state["done"])

    @property
    def target(self) -> tuple[float, float] | None:
        """Where the pointer is, m; None before it has been anywhere."""
        return self._pointer.place(math.inf) if self._pointer else None

    # What happens -----------------------------------------------------------------------------------------------

    def advance(self, now: float, pointer: tuple[float, float] | None) -> list[Event]:
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
        if self.paused and not self.over and now >= self._rest_until:
            self._played = max(self._played, self._rest_until)
            self._before = self._places()
            self.paused, self.notice = False, ""
        self._played = max(self._played, now - MOST_BEHIND)
        while not self.paused and now - self._played >= self._tick:
            self._played += self._tick
            self._step(events)
        if not self.paused:
            share = (now - self._played) / self._tick
            self.positions = self._before + share * (self._places() - self._before)
            self._shown_score, self._shown_clock = self._now_score(), self._now_clock()
        return events

    def _step(self, events: list[Event]) -> None:
        game = self._game
        self._before = self._places()
        velocity, score = self._state["velocity"].copy(), self._now_score()
        if self._policy is not None and self._steps % self._hold == 0:
            self._answer = game.check_actions(RIGHT, self._policy(game.out.observation[RIGHT])) * self._skill
        self._steps += 1
        game.play(np.array([self._action()], np.float32), self._answer)
        for contact in game.contacts_of(0):
            kind = "wall" if contact["b"] < 0 else "paddle"
            speed = abs(float(contact["impulse"])) / (self.spec.puck_mass * self.spec.puck_speed)
            events.append(Event(kind, min(speed, 1.0), float(contact["x"])))
        if self._now_score() != score:
            won = self._now_score()[0] > score[0]
            if self.over:
                self._stop(events, math.inf, "won" if won else "lost", velocity)
            else:
                self._stop(events, POINT_PAUSE, "goal" if won else "conceded", velocity)
        elif game.out.foul[0]:
            self._stop(events, FOUL_PAUSE, "foul", velocity)

    def _action(self) -> tuple[float, float]:
        """What the left paddle does in the tick that ends at `_played`."""
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
        self.positions = self._before + velocity * self._tick
        line = 0.5 * self.spec.length
        self.positions[PUCK, 0] = min(max(self.positions[PUCK, 0], -line), line)
        for player in (LEFT, RIGHT):
            self.positions[player] = self._before[player]
        self._shown_score = self._now_score()
        events.append(Event(notice, x=float(self.positions[PUCK, 0])))
        self._rest(self._played, seconds, notice)

    def _rest(self, since: float, seconds: float, notice: str) -> None:
        self.paused, self.notice, self._rest_until = True, notice, since + seconds

    def _places(self) -> NDArray[np.float64]:
        return self._state["position"].copy()

    def _now_score(self) -> tuple[int, int]:
        left, right = self._state["score"].tolist()
        return left, right

    def _now_clock(self) -> float:
        return int(self._state["side"]) * float(self._game.shot_clock[0])
