"""Detect shots from what the game reports: who touched the puck, who sent it over the centre line, and the result.

There is no physics here. Touches of paddles and walls are the engine's contacts, and the engine also computes where a
shot would have gone, by simulating it without paddles.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from airhockey_env.game import Game
from airhockey_env.kernel.parameters import with_specs
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT, SHOT_CLOCK, STATE
from airhockey_env.tables import FIELDS

SHOT = np.dtype(
    [
        ("shooter", np.int8),  # LEFT or RIGHT
        ("spec", np.float64, (len(FIELDS),)),  # of the table, which may be drawn for every episode
        ("start", STATE),  # state at the end of the step of the shooter's last touch
        ("banked", np.bool_),  # a wall was touched between that touch and the end of the step
        ("origin", np.int8),  # how the shooter got the puck: SERVE, FOUL, REPLY or REBOUND
        ("held", np.float64),  # s from then to that touch
        ("touched", np.bool_),  # the other player touched the puck before the shot was over
        ("scored", np.bool_),
    ]
)
"""A shot starts when the puck enters the far half, last touched by the player that shoots at that end. It ends when the
puck returns over the centre line or to the shooter's paddle, with a goal, or with a foul."""

SERVE, FOUL, REPLY, REBOUND = range(4)
"""How a side gets the puck: by the first serve, by a serve after the other side's shot clock has run out, over the
centre line from the other player, or back from its own shot."""

FORWARD = np.array([1, -1])
"""The end of the table at which each player shoots."""

NOBODY = -1

PIN = 1e-6
"""m. Radius of the paddles when shots are simulated without them."""


class Recorder:
    """Observes a game and counts for both players. Arrays of shape (2,) are indexed by LEFT and RIGHT.

    Attributes:
        shots: (n,) of `SHOT`, in the order in which they ended. Shots cut off by the time limit are not included.
        steps: number of steps of play.
        goals: number of goals of both players.
        zone: (2,) steps that ended with the puck on the player's far half.
        possession: (2,) steps that ended with the puck on the near half, last touched by the player.
        fouls: (2,) how often the player's shot clock ran out.
        own_goals: (2,) goals against the player, last touched by the player itself.
        served: (2, 2) goals of each player, by who had the first serve of the point.
    """

    def __init__(self, game: Game) -> None:
        n = game.num_tables
        self._game = game
        self._side = game.side
        self._first = np.where(self._side < 0, LEFT, RIGHT)  # who had the first serve
        self._speed = game.velocities[:, PUCK, 0]  # along the table
        self._last = np.full(n, NOBODY, np.int8)  # the player that touched the puck last since the serve
        self._banked = np.zeros(n, np.bool_)  # a wall was touched after that
        self._live = np.zeros(n, SHOT)  # the current shot
        self._live["shooter"] = NOBODY
        self._start = np.zeros(n, STATE)  # start of the shot, if the last touch becomes one
        self._start_banked = np.zeros(n, np.bool_)
        self._start_origin = np.zeros(n, np.int8)
        self._start_held = np.zeros(n)
        self._origin = np.full(n, SERVE, np.int8)  # how the side that the puck is on got it
        self._held = np.zeros(n, np.int64)  # and steps since then
        self._over: list[NDArray[np.void]] = []
        self.steps = self.goals = 0
        self.zone, self.possession, self.fouls, self.own_goals = np.zeros((4, 2), np.int64)
        self.served = np.zeros((2, 2), np.int64)

    @property
    def shots(self) -> NDArray[np.void]:
        return np.concatenate(self._over) if self._over else np.zeros(0, SHOT)

    def note(self, running: NDArray[np.bool_]) -> None:
        """Record a step that the tables of the mask (N,) have played."""
        states, out = self._game.states, self._game.out
        goal = np.where(running, out.point, 0)  # +1: in the goal at +x
        changed = running & (goal == 0) & (states["side"] != self._side)
        foul = changed & out.foul  # the puck was given to the other side
        crossed = changed & ~foul
        self._held[running] += 1
        fresh = self._note_contacts(np.flatnonzero(running & (out.n_contacts > 0)), kept=~foul)

        live = self._live["shooter"]
        again = fresh & (live == self._last)  # the shooter touches the puck beyond the centre line
        self._end(again & (self._speed * FORWARD[live] < 0.0))  # it was coming back; otherwise the shot starts only now
        again &= live == self._last
        self._begin(again)
        back = crossed & (live != NOBODY) & (states["side"] != FORWARD[live])
        self._end(back)
        # A paddle can also reach a little over the line.
        sent = (crossed | (fresh & (goal == 0))) & (states["side"] == FORWARD[self._last]) & (live != self._last)
        sent &= self._last != NOBODY
        self._begin(sent)

        self._live["scored"] = (goal != 0) & (goal == FORWARD[live])
        self._end((goal != 0) | foul)
        live[running & (out.truncated | out.terminated)] = NOBODY

        self.steps += int(running.sum())
        self.goals += int((goal != 0).sum())
        half = np.sign(states["position"][:, PUCK, 0])
        for player in (LEFT, RIGHT):
            far = half == FORWARD[player]
            self.zone[player] += (running & far).sum()
            self.possession[player] += (running & ~far & (self._last == player)).sum()
            self.fouls[player] += (foul & (self._side != FORWARD[player])).sum()
            self.own_goals[player] += ((goal == -FORWARD[player]) & (self._last == player)).sum()
            self.served[player] += np.bincount(self._first[goal == FORWARD[player]], minlength=2)
        self._origin[foul] = FOUL
        own = self._last == np.where(states["side"] < 0, LEFT, RIGHT)
        self._origin[crossed] = np.where(own, REBOUND, REPLY)[crossed]
        self._held[changed] = 0
        self._last[foul] = NOBODY
        self._side[running] = states["side"][running]
        self._speed = states["velocity"][:, PUCK, 0].copy()

    def _note_contacts(self, rows: NDArray[np.int64], kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Process the contacts of the step on the given tables.

        Args:
            rows: numbers of the tables that had contacts.
            kept: (N,) whether play continues without a new serve.

        Returns:
            (N,) whether a paddle touched the puck and play continues.
        """
        contacts = self._game.out.contacts
        fresh = np.zeros(len(self._last), np.bool_)
        counts = self._game.out.n_contacts[rows]
        for k in range(int(counts.max(initial=0))):
            having = rows[counts > k]
            contact = contacts[having, k]
            paddle = contact["b"] == PUCK
            touched, player = having[paddle], contact["a"][paddle].astype(np.int8)
            self._last[touched] = player
            self._banked[touched] = False
            fresh[touched] = True
            self._live["touched"][touched] |= self._live["shooter"][touched] != player
            self._banked[having[~paddle]] |= is_bank(contact[~paddle], FORWARD[self._last[having[~paddle]]])
        fresh &= kept
        self._start[fresh] = self._game.states[fresh]
        self._start_banked[fresh] = self._banked[fresh]
        own = fresh & (self._side != FORWARD[self._last])  # beyond the centre line, the earlier touch counts
        self._start_origin[own] = self._origin[own]
        self._start_held[own] = self._held[own] / self._game.control_hz
        return fresh

    def _begin(self, mask: NDArray[np.bool_]) -> None:
        self._live["shooter"][mask] = self._last[mask]
        self._live["spec"][mask] = specs_in_play(self._game)[mask]
        self._live["start"][mask] = self._start[mask]
        for name, values in (
            ("banked", self._start_banked),
            ("origin", self._start_origin),
            ("held", self._start_held),
        ):
            self._live[name][mask] = values[mask]
        self._live["touched"][mask] = self._live["scored"][mask] = False

    def _end(self, mask: NDArray[np.bool_]) -> None:
        over = self._live[mask & (self._live["shooter"] != NOBODY)]
        if len(over):
            self._over.append(over)
        self._live["shooter"][mask] = NOBODY


class Watch:
    """Observes every game of an evaluation with a `Recorder`. This is an observer for `play_points` and `play_task`.

    Attributes:
        games: each game, its recorder, and the seat of the evaluated player.
    """

    def __init__(self) -> None:
        self.games: list[tuple[Game, Recorder, int]] = []

    def __call__(self, game: Game, own: int) -> Callable[[NDArray[np.bool_]], None]:
        recorder = Recorder(game)
        self.games.append((game, recorder, own))
        return recorder.note

    def total(self, name: str) -> int:
        """The sum of one of the recorders' counts for the evaluated player."""
        return sum(int(getattr(recorder, name)[own]) for _, recorder, own in self.games)


def is_bank(contacts: NDArray[np.void], forward: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether contacts of the puck are with a wall, except the end wall at `forward`; posts do not count."""
    straight = (np.abs(contacts["nx"]) == 1.0) | (np.abs(contacts["ny"]) == 1.0)  # normals of walls are exact
    return (contacts["b"] < 0) & straight & ~is_far_end(contacts, forward)


def is_far_end(contacts: NDArray[np.void], forward: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether contacts of the puck are with the end wall at `forward`."""
    return (contacts["b"] < 0) & (contacts["nx"] == -forward)


def speed_of(shots: NDArray[np.void]) -> NDArray[np.float64]:
    """(n,) speed of the puck at the end of the step of the last touch, m/s."""
    return np.linalg.norm(shots["start"]["velocity"][:, PUCK], axis=-1)


@dataclasses.dataclass(frozen=True)
class Courses:
    """Where shots go if nobody touches them; all arrays are (n,)."""

    on_target: NDArray[np.bool_]  # whether they enter the goal
    bank: NDArray[np.bool_]  # whether they touch a wall before they reach the far end
    arrives: NDArray[np.float64]  # m, y of the puck at the far end; NaN if it never gets there
    passes: NDArray[np.float64]  # m, y of the puck when it first crosses a line across the table; NaN if it does not


def specs_in_play(game: Game) -> NDArray[np.float64]:
    """(N, len(FIELDS)) the fields of the tables in play."""
    return np.broadcast_to(game.parameters["spec"], (game.num_tables, len(FIELDS)))


def play_on(shots: NDArray[np.void], control_hz: float, line: NDArray[np.float64] | None = None) -> Courses:
    """Simulate shots without paddles until they reach the far end, come back, or seven seconds have passed.

    Args:
        shots: (n,) of `SHOT`.
        control_hz: of the game in which the shots were made.
        line: (n,) m, x of the line for `passes`.
    """
    n = len(shots)
    courses = Courses(np.zeros(n, np.bool_), shots["banked"].copy(), np.full(n, np.nan), np.full(n, np.nan))
    if n == 0:
        return courses
    specs = shots["spec"].copy()
    specs[:, FIELDS.index("paddle_radius")] = PIN
    # All of the tables are given below; that they are drawn only makes room for one table for each shot.
    game = Game(n, randomize={"puck_mass": (1.0, 1.0)}, left="idle", right="idle", control_hz=control_hz)
    saved = game.get_state()
    saved["parameters"] = with_specs(game.parameters, specs)
    saved["state"] = shots["start"]
    state = saved["state"]
    corner = 0.5 * specs[:, [FIELDS.index("length"), FIELDS.index("width")]] - PIN
    state["position"][:, LEFT], state["position"][:, RIGHT] = -corner, corner
    state["velocity"][:, :PUCK] = 0.0
    for name in ("member", "clock", "steps", "score", "done"):
        state[name] = 0
    game.set_state(saved)

    forward = FORWARD[shots["shooter"]]
    running = np.ones(n, np.bool_)
    side = state["side"].copy()
    for _ in range(round(SHOT_CLOCK * control_hz)):
        before = game.positions[:, PUCK]
        game.step()
        puck = game.positions[:, PUCK]
        goal = running & game.out.terminated
        courses.on_target[goal] = game.out.point[goal] == forward[goal]
        courses.arrives[courses.on_target & goal] = puck[courses.on_target & goal, 1]
        if line is not None:
            passed = running & np.isnan(courses.passes) & ((before[:, 0] - line) * (puck[:, 0] - line) <= 0.0)
            ahead = puck[passed, 0] - before[passed, 0]
            share = np.divide(line[passed] - before[passed, 0], ahead, out=np.zeros_like(ahead), where=ahead != 0.0)
            courses.passes[passed] = before[passed, 1] + share * (puck[passed, 1] - before[passed, 1])
        counts = game.out.n_contacts
        for k in range(int(counts[running].max(initial=0))):
            rows = np.flatnonzero(running & (counts > k))
            contact = game.out.contacts[rows, k]
            end = is_far_end(contact, forward[rows])
            courses.arrives[rows[end]] = contact["y"][end]
            running[rows[end]] = False
            courses.bank[rows[~end]] |= is_bank(contact[~end], forward[rows[~end]])
        now = game.side
        running &= ~goal & ~((now != side) & (now != forward))
        side = now
        if not running.any():
            break
    return courses
