"""The scores that a data set's returns are compared with: those of a random player and of an expert.

A normalised score is 0 for the one and 1 for the other, as in D4RL (Fu et al., "D4RL: Datasets for deep data-driven
reinforcement learning", arXiv 2004.07219) and Minari.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from agents.datasets.episodes import play_episodes
from agents.datasets.settings import Setting
from agents.models import Player, load_player

EXPERT = "expert"
"""The player whose score counts as 1, in every task and under all conditions."""

EPISODES = 1000
"""Episodes that each of the two plays."""


class Scores(NamedTuple):
    """Mean returns in an environment."""

    random: float
    expert: float
    episodes: int = EPISODES
    """The number of episodes whose mean each reference score is."""

    def normalised(self, score: float) -> float:
        """A mean return on the scale of these; NaN if they are equal."""
        span = self.expert - self.random
        return (score - self.random) / span if span else float("nan")


def reference_scores(setting: Setting) -> Scores:
    """Play `EPISODES` episodes each, the same ones for every data set of the setting."""
    return Scores(_mean_return(None, setting), _mean_return(load_player(EXPERT), setting), EPISODES)


def _mean_return(player: Player | None, setting: Setting) -> float:
    episodes = itertools.islice(play_episodes(player, setting, 0, "reference"), EPISODES)
    return float(np.mean([episode.rewards.sum() for episode in episodes]))
