"""The interface between the trainer and its recipes: options, model, phases of training and evaluation."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TypeVar

import numpy as np
import tyro
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from agents.conditions import Conditions
from agents.files import NUMBER, POSITIVE, SHARE
from agents.options import CameraOption, Count, DelayOption, OptionalCount, RandomizeOption, TableOption
from agents.training.runs import RunFolder
from agents.training.stopping import Stop

if TYPE_CHECKING:
    from agents.training.league import League

Args = TypeVar("Args", bound="TrainArgs")

TASK_EVALUATION = {
    "episodes": POSITIVE,
    "success_rate": SHARE,
    "success_rate_95": (SHARE, SHARE),
    "mean_seconds": NUMBER,
}
"""A row of an evaluation in episodes that succeed or fail, as a pattern of `read_json`."""

History = dict[str, Any]
"""The records of a run in evaluations.json, see `checkpoints.HISTORY`."""


@dataclass(frozen=True)
class TrainArgs:
    """The options of all training commands."""

    name: str | None = None
    """Write the run into runs/NAME/. The default name consists of the algorithm and the time."""
    resume: str | None = None
    """Continue this run (its folder, or its name under runs/) with its own options. Only --steps can be changed."""
    steps: OptionalCount = None
    """Train for this many environment steps in all, such as 20_000_000, 20M or 2e7. The default is 10 million for the
    baseline, 20 million for distillation, 30 million for self-play, the hyperparameters' n_timesteps, or with --resume
    the number of the run."""
    seed: int = 0
    """Seed the network, the exploration and the tables. Runs with different seeds share no random numbers."""
    eval_every: OptionalCount = None
    """Evaluate the agent and save a checkpoint every this many steps. The default is a tenth of --steps."""
    eval_episodes: Count = 400
    """Play this many episodes in an evaluation. A point is an episode."""
    report_episodes: Count = 2000
    """Play this many episodes for the report at the end; where there are opponents, against each named one."""
    video_seconds: float = 20.0
    """Record a video of this many seconds of the trained agent. With 0, there is no video."""
    threads: int = 1
    """Let PyTorch use this many threads. A second one makes PPO faster by about a third if it has a processor of its
    own. The sums are then rounded in another way, so another agent is trained."""
    device: str = "cpu"
    """Train the network on this device of PyTorch: "cpu", or for example "cuda". A GPU pays with thousands of tables
    and samples in a gradient step."""
    table: TableOption = "full_size"
    randomize: RandomizeOption = None
    camera: CameraOption = None
    action_delay_ms: DelayOption = (0.0,)
    stack: Count = 1
    """Show the agent this many of its last observations at once, from 1 to 64, each with the action that led to it."""
    conditions: Annotated[dict[str, Any] | None, tyro.conf.Suppress] = None
    """What the four options above mean. It is no option, but config.json keeps it with them: a run that is resumed does
    not need the files again."""


def conditions_of(args: TrainArgs) -> Conditions:
    """The conditions under which an agent is trained and evaluated: those that the run keeps, or those of the options.

    Raises:
        OSError, ValueError: see `Conditions.of_options` and `Conditions.of_dict`.
    """
    return Conditions.of_options(args) if args.conditions is None else Conditions.of_dict(args.conditions)


def with_conditions(args: Args) -> Args:
    """The same options with the contents of `conditions`, for config.json.

    Raises:
        OSError, ValueError: see `conditions_of`.
    """
    return dataclasses.replace(args, conditions=conditions_of(args).as_dict())


class Phase(NamedTuple):
    """A part of training with its own tables."""

    title: str  # a sentence, printed when the phase begins
    purpose: str  # of the tables' random streams: one of `agents.seeding.PURPOSES`
    env: VecEnv
    callbacks: Sequence[BaseCallback] = ()


class Setup(NamedTuple):
    """A model and the functions that train, evaluate and show it."""

    model: BaseAlgorithm
    title: str  # the title of the picture
    phases: Callable[[History], Iterator[Phase]]  # code after a `yield` runs when that phase is over
    evaluate: Callable[[Stop], dict[str, Any]]  # plays and returns a row for the records
    report: Callable[[History, Stop], list[dict[str, Any]]]  # plays, prints the results and returns them as rows
    frames: Callable[[RunFolder], Iterator[NDArray[np.uint8]]]  # pictures (height, width, 3) for the video
    evaluation: dict[str, Any]  # a row of `evaluate`, as a pattern of `read_json`
    league: League | None = None  # is saved and loaded with the model


class Recipe(NamedTuple):
    """The functions behind a training command."""

    command: str  # the command's name under scripts/, which config.json keeps
    args: type[TrainArgs]
    resolve: Callable[[Any], Any]  # checks the options and replaces None by numbers, `steps` among them
    build: Callable[[Any, bool], Setup]  # takes resolved options, and whether the run is new
