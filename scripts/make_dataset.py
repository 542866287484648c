"""Make a data set for offline learning, in Minari's format: python -m scripts.make_dataset --player expert"""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from agents.conditions import Conditions
from agents.datasets.describing import HUMAN, UNIFORM, default_id, metadata_of
from agents.datasets.episodes import Episode, play_episodes, until
from agents.datasets.human import load_replays, replayed_episodes, setting_of
from agents.datasets.replaying import check_replay
from agents.datasets.scores import reference_scores
from agents.datasets.settings import Setting
from agents.datasets.storage import check_id, check_minari, write_dataset
from agents.models import PLAYERS, load_player
from agents.options import (
    CameraOption,
    Count,
    DelayOption,
    RandomizeOption,
    TableOption,
    Trust,
    check_ranges,
    listed,
    not_default,
    option_name,
)
from airhockey_env.checks import MOST_STACK, check_choice
from airhockey_env.kernel.scripted import SCRIPTED
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.players import resolve_player
from scripts._command import run_command

PLAYER_HELP = (
    f'Record this player: "{UNIFORM}", which draws every action uniformly from the action space, or one of {PLAYERS}. '
    f"The scripted players {listed(SCRIPTED, 'and')} cannot be recorded, because they do not report their actions."
)
TASK_HELP = f"Play this task: {listed(TASKS)}."
REPLAYS_HELP = (
    "Record a person in place of --player: all complete points of the matches in these replay files, which the page in "
    "the browser saves."
)
ID_HELP = (
    "Give the data set this id. The default consists of the task, the player and what differs from the default "
    'options, for example "airhockey/point/expert-v0".'
)


@dataclass(frozen=True)
class DatasetArgs:
    """Make a data set for offline learning, in Minari's format.

    It is written to Minari's folder: the one that MINARI_DATASETS_PATH names, or ~/.minari/datasets. If the command is
    stopped or fails, nothing of it is left there.
    """

    player: Annotated[str, tyro.conf.arg(help=PLAYER_HELP)] = "expert"
    opponent: str | None = None
    """Play against this player: a name, a policy.npz or a run's folder. The default is the task's own opponent."""
    steps: Count = 1_000_000
    """Record complete episodes until there are at least this many steps."""
    task: Annotated[str, tyro.conf.arg(help=TASK_HELP)] = "point"
    replays: Annotated[tuple[Path, ...], tyro.conf.arg(metavar="FILE", help=REPLAYS_HELP)] = ()
    id: Annotated[str | None, tyro.conf.arg(metavar="ID", help=ID_HELP)] = None
    table: TableOption = "full_size"
    randomize: RandomizeOption = None
    camera: CameraOption = None
    action_delay_ms: DelayOption = (0.0,)
    stack: int = 1
    """Let every observation consist of this many of the latest ones, with the actions between them."""
    seed: int = 0
    """Draw the seeds of the episodes from this seed."""
    author: str = "The airhockey-env authors"
    """Name this author in the data set."""
    author_email: str = "https://github.com/airhockey-env/airhockey-env/issues"
    """Name this address of the author in the data set, or any other contact."""
    check: bool = False
    """Afterwards, play every episode again in the environment that the data set recovers, and compare every bit."""
    trust: Trust = False


MOST_STEPS = 10**8
"""A data set is put together in memory, where this many steps of plain observations take 8 GB."""

GO_WITH_REPLAYS = ("replays", "id", "author", "author_email", "check")


def make_dataset(args: DatasetArgs) -> None:
    """Play, write, and print what the data set contains.

    Raises:
        ValueError, OSError: an argument does not fit, or the disk is full.
        gymnasium.error.DependencyNotInstalled: Minari is missing.
    """
    check_ranges(args, steps=(1, MOST_STEPS), stack=(1, MOST_STACK), seed=(0, 10**9))
    check_choice("--task", args.task, TASKS)
    player = HUMAN if args.replays else args.player
    setting, episodes = from_replays(args) if args.replays else from_play(args)
    check_minari("Making a data set needs")
    dataset_id = check_id("--id", args.id or default_id(player, setting, differences(args)))
    scores = reference_scores(setting)
    command = shlex.join(["python", "-m", "scripts.make_dataset", *sys.argv[1:]])
    metadata = metadata_of(player, setting, scores, (args.author, args.author_email), command)
    began = time.perf_counter()
    written = write_dataset(dataset_id, setting, metadata, episodes)
    seconds = time.perf_counter() - began
    mean = float(written.returns.mean())
    print(f"{dataset_id}: {len(written.returns):,} episodes, {written.steps:,} steps, {written.megabytes:.1f} MB")
    print(f"Mean return {mean:.3f}, normalised score {100 * scores.normalised(mean):.1f}")
    print(f"Played and written in {seconds:.1f} s: {written.steps / seconds:,.0f} steps/s")
    if args.check:
        import minari

        print(f"All {check_replay(minari.load_dataset(dataset_id)):,} episodes play back to the bit.")


def from_play(args: DatasetArgs) -> tuple[Setting, Iterator[Episode]]:
    """The environment and the episodes of a player.

    Raises:
        ValueError, OSError: an argument does not fit.
    """
    if args.player in SCRIPTED:
        raise ValueError(f"--player must be a player that reports its actions, got the scripted {args.player!r}")
    player = None if args.player == UNIFORM else load_player(args.player, "--player", trust=args.trust)
    opponent = TASKS[args.task].opponent if args.opponent is None else args.opponent
    resolve_player("--opponent", opponent)
    setting = Setting(args.task, opponent, Conditions.of_options(args), args.stack)
    return setting, until(args.steps, play_episodes(player, setting, args.seed))


def from_replays(args: DatasetArgs) -> tuple[Setting, Iterator[Episode]]:
    """The environment and the episodes of a person.

    Raises:
        ValueError, OSError: an argument does not fit.
    """
    others = [option_name(name) for name in not_default(args) if name not in GO_WITH_REPLAYS]
    if others:
        raise ValueError(f"--replays does not go with {listed(others, 'and')}: the files determine what was played")
    replays = load_replays("--replays", args.replays)
    setting = setting_of(replays)
    return setting, replayed_episodes(replays, setting)


def differences(args: DatasetArgs) -> list[str]:
    """Parts of the data set's name for the conditions that differ from the defaults."""
    given = not_default(args)
    parts = [Path(getattr(args, name)).stem for name in ("table", "randomize", "camera") if name in given]
    parts += ["delay" + "_".join(f"{value:g}" for value in args.action_delay_ms)] * ("action_delay_ms" in given)
    return [*parts, *[f"stack{args.stack}"] * ("stack" in given)]


def main() -> None:
    """Read the command line and make a data set."""
    run_command("make_dataset", DatasetArgs, make_dataset)


if __name__ == "__main__":
    main()
