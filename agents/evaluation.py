"""How well a policy plays: points against an opponent, both sides of the table balanced."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.game import Game
from airhockey_env.records import AUTORESET_NEXT_STEP

Policy = Callable[[NDArray[np.float32]], NDArray[np.float32]]

OPPONENTS = ("idle", "random", "goalie", "striker")
"""Those that every report plays against, weakest first."""

MAX_EPISODE_STEPS = 1500
"""Of the registered environment."""


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


def wilson_interval(successes: int, trials: int, z: float = 1.959963984540054) -> tuple[float, float]:
    """Wilson's score interval of a share (E. B. Wilson, JASA 22, 1927); 95 % by default. (0, 1) without trials."""
    if trials == 0:
        return 0.0, 1.0
    share = successes / trials
    centre = share + z**2 / (2 * trials)
    spread = z * math.sqrt(share * (1 - share) / trials + z**2 / (4 * trials**2))
    scale = 1 + z**2 / trials
    return max(0.0, (centre - spread) / scale), min(1.0, (centre + spread) / scale)


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

    Every point is played to its end on a table of its own, so that short points are not counted more often.

    Args:
        policy: a callable from float32 observations (N, 13) to actions (N, 2), or a scripted opponent's name.
        opponent: a scripted opponent's name.
        points: how many; rounded up to an even number.
        seed: of the tables.
    """
    half = (points + 1) // 2
    common = {"table": table, "control_hz": control_hz, "max_episode_steps": max_episode_steps}
    scripted = isinstance(policy, str)
    left = Game(
        half, player=policy if scripted else None, opponent=opponent, opponent_skill=opponent_skill,
        autoreset=AUTORESET_NEXT_STEP, **common,
    )  # fmt: skip
    right = Game(
        half, player=opponent, opponent=policy if scripted else None, autoreset=AUTORESET_NEXT_STEP, **common
    )
    right.tables["skill"][:, 0] = opponent_skill
    wins = losses = draws = steps = 0
    for game, own in ((left, 0), (right, 1)):
        game.seed([seed * 1_000_003 + 2 * k + own for k in range(half)])
        game.reset()
        still = np.zeros((half, 2), np.float32)
        running = np.ones(half, np.bool_)
        while running.any():
            if scripted:
                actions = still
            else:
                seen = game.out.observation if own == 0 else game.out.other_observation
                actions = game.check_actions(policy(seen))
            game.step(actions if own == 0 else still, actions if own == 1 else still)
            ended = running & (game.out.terminated | game.out.truncated)
            won = game.out.terminated & ((game.out.reward > 0.0) == (own == 0))
            steps += int(running.sum())
            wins += int((ended & won).sum())
            losses += int((ended & game.out.terminated & ~won).sum())
            draws += int((ended & ~game.out.terminated).sum())
            running &= ~ended
    return Result(opponent, wins, losses, draws, steps / (2 * half) / control_hz)
