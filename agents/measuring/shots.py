"""Shots, as the game reports them: who touched the puck, who sent it over the centre line, and what became of it.

Nothing here knows physics. Touches and walls are the engine's contacts; and where a shot would have gone is answered by
the engine, which plays it on without paddles.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT, SHOT_CLOCK, STATE
from airhockey_env.tables import TableSpec

SHOT = np.dtype(
    [
        ("shooter", np.int8),  # LEFT or RIGHT
        ("start", STATE),  # the table at the end of the step of the shooter's last touch
        ("banked", np.bool_),  # a wall was touched between that touch and that end
        ("touched", np.bool_),  # by the other player, before it was over
        ("scored", np.bool_),
    ]
)
"""A puck that came to the far half and was last touched by the player who shoots at that end. It is over when the puck
comes back over the centre line or to the shooter's paddle, with a goal, or with a foul."""

FORWARD = np.array([1, -1])
"""The end of the table at which each player shoots."""

NOBODY = -1

PIN = 1e-6
"""m. The radius of paddles that are out of the way."""


class Recorder:
    """Looks on while games are played, and counts for both players.

    Attributes: of LEFT and RIGHT each, but for the first three
        shots: (n,) of `SHOT`, in the order in which they were over. Those that time cut off are left out.
        steps: of play.
        goals: all of them.
        zone: (2,) steps that ended with the puck on the player's far half.
        possession: (2,) steps that ended with it on the near half, last touched by the player.
        fouls: (2,) times that the player's shot clock ran out.
        own_goals: (2,) goals against, last touched by the player itself.
    """

    def __init__(self, game: Game) -> None:
        n = game.num_tables
        self._game = game
        self._side = game.side
        self._speed = game.velocities[:, PUCK, 0]  # along the table
        self._last = np.full(n, NOBODY, np.int8)  # who touched the puck last, since the serve
        self._banked = np.zeros(n, np.bool_)  # a wall was touched after that
        self._live = np.zeros(n, SHOT)  # the shot under way
        self._live["shooter"] = NOBODY
        self._start = np.zeros(n, STATE)  # of a shot, if the last touch becomes one
        self._start_banked = np.zeros(n, np.bool_)
        self._over: list[NDArray[np.void]] = []
        self.steps = self.goals = 0
        self.zone, self.possession, self.fouls, self.own_goals = np.zeros((4, 2), np.int64)

    @property
    def shots(self) -> NDArray[np.void]:
        return np.concatenate(self._over) if self._over else np.zeros(0, SHOT)

    def note(self, running: NDArray[np.bool_]) -> None:
        """Note a step that the tables of the mask (N,) have played."""
        states, out = self._game.states, self._game.out
        goal = np.where(running, out.point, 0)  # +1: in the goal at +x
        changed = running & (goal == 0) & (states["side"] != self._side)
        foul = changed & out.foul  # and the other side has been served the puck
        crossed = changed & ~foul
        fresh = self._note_contacts(np.flatnonzero(running & (out.n_contacts > 0)), kept=~foul)

        live = self._live["shooter"]
        again = fresh & (live == self._last)  # the shooter reaches the puck over the line
        self._end(again & (self._speed * FORWARD[live] < 0.0))  # it had come back; otherwise it had not been shot yet
        again &= live == self._last
        self._begin(again)
        back = crossed & (live != NOBODY) & (states["side"] != FORWARD[live])
        self._end(back)
        # A paddle reaches a little over the line, too.
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
        self._last[foul] = NOBODY
        self._side[running] = states["side"][running]
        self._speed = states["velocity"][:, PUCK, 0].copy()

    def _note_contacts(self, rows: NDArray[np.int64], kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Go through the contacts of the step on some tables; `kept` (N,): what follows is not a new serve.

        Returns: (N,) whether a paddle touched the puck and play goes on.
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
        return fresh

    def _begin(self, mask: NDArray[np.bool_]) -> None:
        self._live["shooter"][mask] = self._last[mask]
        self._live["start"][mask] = self._start[mask]
        self._live["banked"][mask] = self._start_banked[mask]
        self._live["touched"][mask] = self._live["scored"][mask] = False

    def _end(self, mask: NDArray[np.bool_]) -> None:
        over = self._live[mask & (self._live["shooter"] != NOBODY)]
        if len(over):
            self._over.append(over)
        self._live["shooter"][mask] = NOBODY


def is_bank(contacts: NDArray[np.void], forward: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether contacts of the puck are with a wall other than the one at the end `forward`, or a post."""
    straight = (np.abs(contacts["nx"]) == 1.0) | (np.abs(contacts["ny"]) == 1.0)  # normals of walls are exact
    return (contacts["b"] < 0) & straight & ~is_far_end(contacts, forward)


def is_far_end(contacts: NDArray[np.void], forward: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether contacts of the puck are with the wall at the end `forward`."""
    return (contacts["b"] < 0) & (contacts["nx"] == -forward)


@dataclasses.dataclass(frozen=True)
class Courses:
    """Where shots go if nobody touches them; all (n,)."""

    on_target: NDArray[np.bool_]  # into the goal
    bank: NDArray[np.bool_]  # off a wall before they come to the far end
    arrives: NDArray[np.float64]  # m, y of the puck at the far end; NaN if it never comes there
    passes: NDArray[np.float64]  # m, y of the puck when it first passes a line across the table; NaN if it does not


def play_on(
    shots: NDArray[np.void], spec: TableSpec, control_hz: float, line: NDArray[np.float64] | None = None
) -> Courses:
    """Let the engine play shots on, without paddles, until they come to the far end or back, or seven seconds passed.

    Args:
        shots: (n,) of `SHOT`.
        spec, control_hz: of the game in which they were shot.
        line: (n,) m, x of the line for `passes`.
    """
    n = len(shots)
    courses = Courses(np.zeros(n, np.bool_), shots["banked"].copy(), np.full(n, np.nan), np.full(n, np.nan))
    if n == 0:
        return courses
    game = Game(
        n,
        table=dataclasses.replace(spec, paddle_radius=PIN),
        left="idle",
        right="idle",
        control_hz=control_hz,
    )
    state = shots["start"].copy()
    corner = np.array([0.5 * spec.length - PIN, 0.5 * spec.width - PIN])
    state["position"][:, LEFT], state["position"][:, RIGHT] = -corner, corner
    state["velocity"][:, :PUCK] = 0.0
    for name in ("member", "clock", "steps", "score", "done"):
        state[name] = 0
    game.set_state(state)

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
