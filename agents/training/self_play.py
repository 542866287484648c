"""Self-play: PPO in a league of its own past selves and the scripted opponents."""

from __future__ import annotations

import math
from dataclasses import dataclass

from agents.options import Count, OptionalCount, check_ranges
from agents.training.league import League
from agents.training.ppo import TrainArgs


@dataclass(frozen=True)
class SelfPlayArgs(TrainArgs):
    """Train an agent with PPO by self-play. Everything goes into one folder, runs/NAME/."""

    start: str | None = None
    """Begin with the network of this run (its folder, or its name under runs/) in place of shooting practice."""
    steps: OptionalCount = None
    """Environment steps in all, as 30_000_000, 30M or 3e7. The default is 30 million, or with --resume what the run was
    to have."""
    opponents: tuple[str, ...] = ("striker", "goalie", "idle")
    """The scripted opponents in the league."""
    learning_rate: float = 4e-4
    """The learning rate during practice. After that it falls linearly to a fiftieth."""
    sde_sample_freq: Count = 0
    """The number of steps that a random disturbance of the actions lasts (gSDE). With 0 disturbances are independent in
    every step; here large ones of that kind make the better players."""
    log_std_init: float = -1.2
    """The logarithm of the disturbance at the start."""
    latest_share: float = 0.3
    """The share of episodes against the agent as it is now."""
    scripted_share: float = 0.25
    """The share of episodes against the scripted opponents. The others are against past selves. In both kinds, hard
    opponents come more often."""
    snapshot_every: Count = 2_000_000
    """The number of steps between the copies of the agent that join the league."""
    most_past_selves: Count = 12
    """The greatest number of copies in the league. The weakest leaves when there are more."""

    default_steps = 30_000_000
    command = "train_self_play"

    def check(self) -> None:
        super().check()
        check_ranges(
            self, latest_share=(0, 1), scripted_share=(0, 1 - self.latest_share), snapshot_every=(1, math.inf),
            most_past_selves=(1, 1000),
        )  # fmt: skip

    def begins_with(self) -> str | None:
        return self.start

    def league(self) -> League:
        return League(
            self.opponents,
            latest_share=self.latest_share,
            scripted_share=self.scripted_share,
            snapshot_every=self.snapshot_every,
            most_past_selves=self.most_past_selves,
            seed=self.seed,
        )
