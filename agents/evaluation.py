"""How well a policy plays: points against an opponent, both sides of the table balanced; and tasks for one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.game import Game
from airhockey_env.records import AUTORESET_NEXT_STEP
from airhockey_env.tasks import TASKS

Policy = Callable[[NDArray[np.float32]], NDArray[np.float32]]

OPPONENTS = ("idle", "random", "goalie", "striker")
"""Those that every report plays against, weakest first."""

SOLO_TASKS = ("hit", "defend")
"""Tasks without an opponent, in which an episode succeeds or fails."""

MAX_EPISODE_STEPS = 1500
"""Of the registered environment."""

TABLES_AT_ONCE = 4096


@dataclass(frozen=True)
class Result:
    """Points of one player against an opponent."""

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
        """Wins in all points, draws included."""
        return self.wins / self.points if self.points else math.nan

    @property
    def decided(self) -> float:
        """Wins in the points that were decided."""
        return self.wins / (self.wins + self.losses) if self.wins + self.losses else math.nan

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        low, high = wilson_interval(self.wins, self.points)
        decided_low, decided_high = wilson_interval(self.wins, self.wins + self.losses)
        return {
            "opponent": self.opponent,
            "points": self.points,
            "wins": self.wins,
            "losses": self.losses,
            "draws": self.draws,
            "win_rate": self.win_rate,
            "win_rate_95": [low, high],
            "decided_win_rate": self.decided,
            "decided_win_rate_95": [decided_low, decided_high],
            "mean_seconds": self.seconds,
        }


@dataclass(frozen=True)
class TaskResult:
    """Episodes of one player in a task."""

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


def wilson_interval(successes: int, trials: int, z: float = 1.959963984540054) -> tuple[float, float]:
    """Wilson's score interval of a share (E. B. Wilson, JASA 22, 1927); 95 % by default. (0, 1) without trials."""
    if trials == 0:
        return 0.0, 1.0
    share = successes / trials
    centre = share + z**2 / (2 * trials)
    spread = z * math.sqrt(share * (1 - share) / trials + z**2 / (4 * trials**2))
    scale = 1 + z**2 / trials
    low = (centre - spread) / scale if successes > 0 else 0.0  # exactly, not but for rounding
    high = (centre + spread) / scale if successes < trials else 1.0
    return low, high


def play_points(
    policy: Policy | str,
    opponent: str,
    points: int,
    *,
    seed: int = 0,
    opponent_skill: float = 1.0,
    table: str = "full_size",
    control_hz: float = 50,
    max_episode_steps: int = MAX_EPISODE_STEPS,
) -> Result:
    """Play points against a scripted opponent: half of them on the left, half on the right side of the table.

    Every point is played to its end on a table of its own, so that short points are not counted more often. If it
    takes long, a progress bar shows.

    Args:
        policy: a callable from float32 observations (N, 13) to actions (N, 2), or a scripted opponent's name.
        opponent: a scripted opponent's name.
        points: how many; rounded up to an even number.
        seed: of the tables.

    Raises:
        ValueError: an argument is out of range.
    """
    from tqdm import tqdm

    if points < 1:
        raise ValueError(f"points must be 1 or more, got {points}")
    named = policy if isinstance(policy, str) else None
    asked = None if isinstance(policy, str) else policy
    half = (points + 1) // 2
    wins = losses = draws = steps = 0
    with tqdm(total=2 * half, unit="point", desc=f"against {opponent}", delay=2.0, leave=False, disable=None) as bar:
        for first in range(0, half, TABLES_AT_ONCE):
            rows = range(first, min(half, first + TABLES_AT_ONCE))
            common: dict[str, Any] = {
                "table": table,
                "control_hz": control_hz,
                "max_episode_steps": max_episode_steps,
                "autoreset": AUTORESET_NEXT_STEP,
            }
            left = Game(len(rows), player=named, opponent=opponent, opponent_skill=opponent_skill, **common)
            right = Game(len(rows), player=opponent, opponent=named, **common)
            right.tables["skill"][:, 0] = opponent_skill
            still = np.zeros((len(rows), 2), np.float32)
            for game, own in ((left, 0), (right, 1)):
                game.seed([seed * 1_000_003 + 2 * k + own for k in rows])
                game.reset()
                running = np.ones(len(rows), np.bool_)
                while running.any():
                    seen = game.out.observation if own == 0 else game.out.other_observation
                    actions = still if asked is None else game.check_actions(asked(seen))
                    game.step(actions if own == 0 else still, actions if own == 1 else still)
                    ended = running & (game.out.terminated | game.out.truncated)
                    won = game.out.terminated & ((game.out.reward > 0.0) == (own == 0))
                    steps += int(running.sum())
                    wins += int((ended & won).sum())
                    losses += int((ended & game.out.terminated & ~won).sum())
                    draws += int((ended & ~game.out.terminated).sum())
                    running &= ~ended
                    bar.update(int(ended.sum()))
    return Result(opponent, wins, losses, draws, steps / (2 * half) / control_hz)


def play_task(policy: Policy | str, task: str, episodes: int, *, seed: int = 0, table: str = "full_size") -> TaskResult:
    """Play episodes of a task without an opponent, as its registered environment has them (at 50 Hz).

    Args:
        policy: as in `play_points`.
        task: one of `SOLO_TASKS`.
        episodes: how many; each on a table of its own.
        seed: of the tables.

    Raises:
        ValueError: an argument is out of range.
    """
    from tqdm import tqdm

    if task not in SOLO_TASKS:
        raise ValueError(f"task must be one of {SOLO_TASKS}, got {task!r}")
    if episodes < 1:
        raise ValueError(f"episodes must be 1 or more, got {episodes}")
    control_hz = 50
    named = policy if isinstance(policy, str) else None
    asked = None if isinstance(policy, str) else policy
    successes = failures = timeouts = steps = 0
    with tqdm(total=episodes, unit="episode", desc=task, delay=2.0, leave=False, disable=None) as bar:
        for first in range(0, episodes, TABLES_AT_ONCE):
            rows = range(first, min(episodes, first + TABLES_AT_ONCE))
            game = Game(
                len(rows),
                task=task,
                player=named,
                opponent=TASKS[task].opponent,
                max_episode_steps=TASKS[task].max_episode_steps,
                table=table,
                control_hz=control_hz,
                autoreset=AUTORESET_NEXT_STEP,
            )
            game.seed([seed * 1_000_003 + k for k in rows])
            game.reset()
            out = game.out
            still = np.zeros((len(rows), 2), np.float32)
            running = np.ones(len(rows), np.bool_)
            while running.any():
                game.step(still if asked is None else game.check_actions(asked(out.observation)))
                ended = running & (out.terminated | out.truncated)
                steps += int(running.sum())
                successes += int((ended & out.success).sum())
                failures += int((ended & out.terminated & ~out.success).sum())
                timeouts += int((ended & ~out.terminated).sum())
                running &= ~ended
                bar.update(int(ended.sum()))
    return TaskResult(task, successes, failures, timeouts, steps / episodes / control_hz)
