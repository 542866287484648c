"""What a recipe tells the trainer: its options, its model, whom or what it learns from, and how it is evaluated."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from agents.options import Count, OptionalCount
from agents.training.league import League
from agents.training.runs import RunFolder
from agents.training.stopping import Stop

History = dict[str, Any]
"""The records of a run, as evaluations.json has them (see `checkpoints.HISTORY`)."""


@dataclass(frozen=True)
class TrainArgs:
    """The options that all training commands have."""

    name: str | None = None
    """Write the run into the folder runs/NAME/. The default name is that of the algorithm and the time."""
    resume: str | None = None
    """Continue this run (its folder, or its name under runs/) with its own options, up to --steps in all."""
    steps: OptionalCount = None
    """Train for this many environment steps in all, given as 20_000_000, 20M or 2e7. With --resume, the default is what
    the run was to have. Else it is 20 million for PPO, 30 million for self-play, or what the hyperparameters say."""
    seed: int = 0
    """Seed the network, the exploration and the tables. Runs with different seeds share no random numbers."""
    eval_every: OptionalCount = None
    """Evaluate the agent and save a checkpoint each time so many steps have passed. The default is a tenth of
    --steps."""
    eval_episodes: Count = 400
    """Play this many episodes in an evaluation; a point is an episode."""
    report_episodes: Count = 2000
    """Play this many episodes for the report at the end, against each named opponent if the agent has opponents."""
    video_seconds: float = 20.0
    """Record a video of the trained agent that is this many seconds long. 0 records none."""
    threads: int = 1
    """Let PyTorch use this many threads. The networks are small: a second thread gains nothing."""


class Phase(NamedTuple):
    """A part of training, on tables of its own."""

    title: str  # a sentence, printed when the phase begins
    purpose: str  # of the tables' random streams: one of `agents.seeding.PURPOSES`
    env: VecEnv
    callbacks: Sequence[BaseCallback] = ()


class Setup(NamedTuple):
    """A model, and what the trainer does with it."""

    model: BaseAlgorithm
    title: str  # what is learned, for the picture
    phases: Callable[[History], Iterator[Phase]]  # what follows a `yield` runs when that phase is over
    evaluate: Callable[[Stop], dict[str, Any]]  # plays, and returns a row for the records
    report: Callable[[History, Stop], list[dict[str, Any]]]  # plays, prints the results, and returns them as rows
    frames: Callable[[RunFolder], Iterator[NDArray[np.uint8]]]  # pictures (height, width, 3) for the video
    league: League | None = None  # saved and loaded with the model


class Recipe(NamedTuple):
    """How a command trains."""

    command: str  # its name under scripts/, which a run's config.json keeps
    args: type[TrainArgs]
    resolve: Callable[[Any], Any]  # checks the options, and puts numbers in place of None: `steps` among them
    build: Callable[[Any, bool], Setup]  # from resolved options, and whether the run is new
    evaluation: dict[str, Any]  # what a row of `Setup.evaluate` has at least, as a pattern of `read_json`
