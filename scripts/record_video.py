"""Record a video of two players: python -m scripts.record_video MODEL --opponent NAME --out FILE"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from tqdm import tqdm

from agents.checks import check_ranges
from agents.models import load_player
from agents.video import SUFFIXES, frames_of_play, write_video
from scripts._command import run_command


@dataclass(frozen=True)
class RecordArgs:
    """Record a video of two players."""

    model: Annotated[str, tyro.conf.Positional]
    """The left player: a run's folder, a policy.npz, a model.zip, or a scripted opponent's name."""
    opponent: str = "striker"
    """The right player: likewise."""
    out: Path = Path("video.mp4")
    """File to write: .mp4 or .gif."""
    seconds: float = 20.0
    """Of play."""
    fps: int = 25
    """Pictures for a second, 1 to 50."""
    width: int = 640
    """px."""
    height: int = 344
    """px."""
    table: str = "full_size"
    """A table preset."""
    seed: int = 0
    """Of the serves."""


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
    frames = frames_of_play(
        load_player(args.model),
        load_player(args.opponent),
        args.seconds,
        seed=args.seed,
        fps=args.fps,
        size=(args.width, args.height),
        table=args.table,
    )
    number = round(args.seconds * args.fps)
    write_video(
        args.out, iter(tqdm(frames, total=number, unit="frame", delay=1.0, leave=False, disable=None)), args.fps
    )
    print(f"{args.out}: {args.seconds:g} s of play")


def main() -> None:
    """Read the command line and record."""
    run_command("record_video", RecordArgs, record)


if __name__ == "__main__":
    main()
