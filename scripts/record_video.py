"""Record a video of two players, or of a replay: python -m scripts.record_video MODEL --opponent NAME --out FILE"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from numpy.typing import NDArray
from tqdm import tqdm

from agents.conditions import Conditions
from agents.measuring.evaluation import SOLO_TASKS
from agents.models import load_player
from agents.options import (
    PLAYER_HELP,
    CameraOption,
    DelayOption,
    RandomizeOption,
    TableOption,
    Trust,
    check_ranges,
    listed,
    not_default,
    option_name,
)
from agents.video import SUFFIXES, frames_of_play, write_video
from airhockey_env.checks import check_choice
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.replay import Replay, is_replay, play_back_frames
from scripts._command import run_command

TASK_HELP = f"Film this task: {listed(TASKS)}. There is no opponent in {listed(SOLO_TASKS, 'and')}."
MODEL_HELP = f"Film this player on the left, or the game that this file of a replay holds. {PLAYER_HELP}"


@dataclass(frozen=True)
class RecordArgs:
    """Record a video of two players, of a task, or of a replay.

    The player on the left has the camera and the delay, if any are given.
    """

    model: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="MODEL", help=MODEL_HELP)]
    opponent: str | None = None
    """Film this player on the right. The default is the striker, if the task has an opponent."""
    task: Annotated[str, tyro.conf.arg(help=TASK_HELP)] = "match"
    out: Path = Path("video.gif")
    """Write the video to this file, whose name ends in .gif or .mp4. The latter needs the extra "video"."""
    seconds: float | None = None
    """Film this many seconds of play. The default is 20 seconds, or all of a replay."""
    fps: int = 25
    """Show this many frames in a second, from 1 to 50. A replay has at most one frame for each of its steps."""
    width: int = 640
    """Make the frames this many pixels wide."""
    height: int = 344
    """Make the frames this many pixels high."""
    table: TableOption = "full_size"
    randomize: RandomizeOption = None
    camera: CameraOption = None
    action_delay_ms: DelayOption = (0.0,)
    seed: int = 0
    """Draw the serves from this seed."""
    trust: Trust = False


def record(args: RecordArgs) -> None:
    """Play and write.

    Raises:
        ValueError, OSError: an argument does not fit.
    """
    if args.out.suffix not in SUFFIXES:
        raise ValueError(f"--out must end in one of {SUFFIXES}, got {args.out.name!r}")
    if not args.out.parent.is_dir():
        raise FileNotFoundError(f"--out must lie in a folder that exists, got {args.out}")
    check_ranges(args, fps=(1, 50), seconds=(0.1, 3600), width=(32, 4096), height=(32, 4096), seed=(0, 10**9))
    conditions = Conditions.of_options(args)
    check_choice("--task", args.task, TASKS)
    if args.task in SOLO_TASKS and args.opponent is not None:
        raise ValueError(f"--opponent does not go with --task {args.task}, which has no opponent")
    size = (args.width, args.height)
    fps = args.fps
    frames: Iterator[NDArray[np.uint8]]
    if is_replay(args.model):
        for name in not_default(args):
            if name in ("opponent", "task", "table", "randomize", "camera", "action_delay_ms", "seed"):
                raise ValueError(f"{option_name(name)} does not go with a replay, which has its own")
        replay = Replay.load(args.model)
        seconds = replay.seconds if args.seconds is None else min(args.seconds, replay.seconds)
        fps = min(fps, math.floor(replay.control_hz))
        number = max(1, round(seconds * fps))
        frames = islice(play_back_frames(replay, size=size, fps=fps), number)
    else:
        seconds = 20.0 if args.seconds is None else args.seconds
        number = round(seconds * fps)
        frames = frames_of_play(
            load_player(args.model, trust=args.trust),
            load_player(args.opponent or TASKS[args.task].opponent, "--opponent", trust=args.trust),
            seconds,
            task=args.task,
            seed=args.seed,
            fps=fps,
            size=size,
            conditions=conditions,
        )
    write_video(args.out, iter(tqdm(frames, total=number, unit="frame", delay=1.0, leave=False, disable=None)), fps)
    print(f"{args.out}: {seconds:g} s of play")


def main() -> None:
    """Read the command line and record."""
    run_command("record_video", RecordArgs, record)


if __name__ == "__main__":
    main()
