"""Evaluate a policy: points against an opponent, balanced over both sides of the table, and tasks for one player."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.conditions import EXACT, Conditions
from agents.models import ModelPolicy, Player, in_one_game, join
from agents.seeding import table_seeds
from airhockey_env.checks import check_choice, check_number, check_whole
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, RIGHT, SEATS
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.players import NAMES, resolve_player

Observer = Callable[[Game, int], Callable[[NDArray[np.bool_]], None]]
"""Observer factory: receives the game, before its first step, and the seat (LEFT or RIGHT) of the evaluated player, and
returns a callback that runs after every step with the mask (N,) of the tables that played it."""

OPPONENTS = NAMES
"""The opponents in every report, weakest first."""

SOLO_TASKS = tuple(name for name, task in TASKS.items() if task.opponent == "idle")
"""Tasks without an active opponent, in which an episode succeeds or fails."""

CONTROL_HZ, MAX_EPISODE_STEPS = 50, 1500
"""The control rate and the time limit of the registered environment."""

TABLES_AT_ONCE = 4096
PICTURE_TABLES_AT_ONCE = 512
"""The same for players that see pictures: three stacked pictures of a table take 64 kB and are copied."""


@dataclass(frozen=True)
class Result:
    """Result of the points of one player against an opponent."""

    opponent: str
    wins: int
    losses: int
    draws: int  # by time
    seconds: float  # of play, mean of a point

    @property
    def points(self) -> int:
        return self.wins + self.losses + self.draws

    @property
    def win_rate(self) -> float:
        """Share of wins in all points, including draws."""
        return self.wins / self.points if self.points else math.nan

    @property
    def decided(self) -> float:
        """Share of wins in the decided points."""
        return self.wins / (self.wins + self.losses) if self.wins + self.losses else math.nan

    @property
    def decided_interval(self) -> tuple[float, float]:
        """95 % Wilson interval of that share."""
        return wilson_interval(self.wins, self.wins + self.losses)

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        low, high = wilson_interval(self.wins, self.points)
        return {
            "opponent": self.opponent,
            "points": self.points,
            "wins": self.wins,
            "losses": self.losses,
            "draws": self.draws,
            "win_rate": self.win_rate,
            "win_rate_95": [low, high],
            "decided_win_rate": self.decided,
            "decided_win_rate_95": list(self.decided_interval),
            "mean_seconds": self.seconds,
        }


@dataclass(frozen=True)
class TaskResult:
    """Result of the episodes of one player in a task."""

    task: str
    successes: int
    failures: int
    timeouts: int  # neither
    seconds: float  # of play, mean of an episode

    @property
    def episodes(self) -> int:
        return self.successes + self.failures + self.timeouts

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return {
            "task": self.task,
            "episodes": self.episodes,
            "successes": self.successes,
            "failures": self.failures,
            "timeouts": self.timeouts,
            "success_rate": self.successes / self.episodes if self.episodes else math.nan,
            "success_rate_95": list(wilson_interval(self.successes, self.episodes)),
            "mean_seconds": self.seconds,
        }


Z_95 = 1.959963984540054
"""Standard deviations of the normal distribution on each side of its mean between which 95 % of it lie."""


def wilson_interval(successes: int, trials: int, z: float = Z_95) -> tuple[float, float]:
    """Wilson's score interval of a proportion (E. B. Wilson, JASA 22, 1927), 95 % by default; (0, 1) without trials."""
    if trials == 0:
        return 0.0, 1.0
    share = successes / trials
    centre = share + z**2 / (2 * trials)
    spread = z * math.sqrt(share * (1 - share) / trials + z**2 / (4 * trials**2))
    scale = 1 + z**2 / trials
    low = (centre - spread) / scale if successes > 0 else 0.0  # exactly 0, without rounding errors
    high = (centre + spread) / scale if successes < trials else 1.0
    return low, high


def _at_once(*players: Any) -> int:
    pictures = any(isinstance(player, ModelPolicy) and player.pictures for player in players)
    return min(TABLES_AT_ONCE, PICTURE_TABLES_AT_ONCE) if pictures else TABLES_AT_ONCE


def play_points(
    policy: Player,
    opponent: Player,
    points: int,
    *,
    name: str | None = None,
    seed: int = 0,
    purpose: str = "evaluation",
    opponent_skill: float = 1.0,
    conditions: Conditions = EXACT,
    shared: bool = False,
    control_hz: float = CONTROL_HZ,
    max_episode_steps: int = MAX_EPISODE_STEPS,
    observer: Observer | None = None,
) -> Result:
    """Play points against an opponent, half of them on the left and half on the right side of the table.

    Each point is played to its end on its own table, so that short points are not over-represented. A progress bar
    appears if it takes long.

    Args:
        policy: a callable from float32 observations (N, 13) to actions (N, 2), a `ModelPlayer`, or a named opponent's
            name.
        opponent: the same kinds of player.
        points: number of points, rounded up to an even number.
        name: the opponent's name in the result; by default that of a named opponent.
        seed: determines the tables' random streams.
        purpose: one of `agents.seeding.PURPOSES`; each has its own random streams.
        opponent_skill: skill of a scripted opponent, 0 to 1.
        conditions: the table, and how the evaluated player sees it. The opponent sees exact states.
        shared: whether the opponent plays under the same conditions too. Scripted players see exact states anyway.
        control_hz: control steps per second.
        max_episode_steps: steps after which a point is drawn.
        observer: see `Observer`.

    Raises:
        ValueError: an argument is out of range.
    """
    from tqdm import tqdm

    points = check_whole("points", points, 1)
    if name is None:
        name = opponent if isinstance(opponent, str) else "a policy"
    opponent_skill = check_number("opponent_skill", opponent_skill, 0.0, 1.0)
    players = (
        resolve_player("policy", in_one_game(policy)),
        resolve_player("opponent", in_one_game(opponent)),
    )
    half, at_once = (points + 1) // 2, _at_once(*players)
    seeds = table_seeds(purpose, seed, 2 * half, TASKS["point"].number)
    wins = losses = draws = steps = 0
    with tqdm(total=2 * half, unit="point", desc=f"against {name}", delay=2.0, leave=False, disable=None) as bar:
        for first, own in itertools.product(range(0, half, at_once), SEATS):
            rows = range(first, min(half, first + at_once))
            game = Game(
                len(rows),
                left=players[own],
                right=players[1 - own],
                left_skill=1.0 if own == LEFT else opponent_skill,
                right_skill=1.0 if own == RIGHT else opponent_skill,
                **conditions.game_arguments(*(SEATS if shared else (own,))),
                control_hz=control_hz,
                max_episode_steps=max_episode_steps,
            )
            join(game, *players)
            game.reset([seeds[2 * k + own] for k in rows])
            for running, ended in _to_the_ends(game, own, observer, bar):
                won = game.out.terminated & ((game.out.point > 0) == (own == LEFT))
                steps += int(running.sum())
                wins += int((ended & won).sum())
                losses += int((ended & game.out.terminated & ~won).sum())
                draws += int((ended & ~game.out.terminated).sum())
    return Result(name, wins, losses, draws, steps / (2 * half) / control_hz)


def _to_the_ends(
    game: Game, own: int, observer: Observer | None, bar: Any
) -> Iterator[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
    """Step a game until an episode has ended on every table.

    Yields after every step the masks (N,) of the tables that played it, and of those whose episodes it ended.
    """
    note = observer(game, own) if observer is not None else None
    running = np.ones(game.num_tables, np.bool_)
    while running.any():
        game.step()
        if note is not None:
            note(running)
        ended = running & (game.out.terminated | game.out.truncated)
        yield running, ended
        running &= ~ended
        bar.update(int(ended.sum()))


def play_task(
    policy: Player,
    task: str,
    episodes: int,
    *,
    seed: int = 0,
    purpose: str = "evaluation",
    conditions: Conditions = EXACT,
    observer: Observer | None = None,
) -> TaskResult:
    """Play episodes of a task without an opponent, as in its registered environment (at 50 Hz).

    Args:
        policy: as in `play_points`.
        task: one of `SOLO_TASKS`.
        episodes: number of episodes, each on its own table.
        seed, purpose, conditions, observer: as in `play_points`.

    Raises:
        ValueError: an argument is out of range.
    """
    from tqdm import tqdm

    check_choice("task", task, SOLO_TASKS)
    episodes = check_whole("episodes", episodes, 1)
    seeds = table_seeds(purpose, seed, episodes, TASKS[task].number)
    player = resolve_player("policy", in_one_game(policy))
    at_once = _at_once(player)
    successes = failures = timeouts = steps = 0
    with tqdm(total=episodes, unit="episode", desc=task, delay=2.0, leave=False, disable=None) as bar:
        for first in range(0, episodes, at_once):
            rows = range(first, min(episodes, first + at_once))
            game = Game(
                len(rows),
                task=task,
                left=player,
                right=TASKS[task].opponent,
                max_episode_steps=TASKS[task].max_episode_steps,
                **conditions.game_arguments(LEFT),
                control_hz=CONTROL_HZ,
            )
            join(game, player)
            game.reset(seeds[rows.start : rows.stop])
            for running, ended in _to_the_ends(game, LEFT, observer, bar):
                out = game.out
                steps += int(running.sum())
                successes += int((ended & out.success).sum())
                failures += int((ended & out.terminated & ~out.success).sum())
                timeouts += int((ended & ~out.terminated).sum())
    return TaskResult(task, successes, failures, timeouts, steps / episodes / CONTROL_HZ)
