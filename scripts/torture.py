"""Look for trouble: hostile play and trials of every face, with all laws checked: python -m scripts.torture"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from agents.options import Count, OptionalCount, check_ranges
from scripts._command import run_command
from tests.torture.cases import Case
from tests.torture.hostile import play_hostile

if TYPE_CHECKING:
    from tests.torture.chamber import Tally

REGRESSIONS = Path(__file__).parents[1] / "tests" / "torture" / "regressions"


@dataclass(frozen=True)
class TortureArgs:
    """Play as roughly as the game allows, for as long as you like, and check its laws after every step.

    Each failure is written to a file that reproduces it, and the exit code is 1. Ctrl-C ends the play and reports.
    """

    seconds: float = 60.0
    """Play for this many seconds, and finish what is under way then."""
    steps: OptionalCount = None
    """Stop after this many steps, if they are played before the time is up."""
    seed: int = 0
    """Draw everything that is played from this seed and the number of the bout."""
    first: Count = 0
    """Begin with the bout of this number, to continue where an earlier run stopped."""
    jobs: int = 1
    """Play in this many processes."""
    out: Path = REGRESSIONS
    """Write the files that reproduce failures into this folder. The tests play all files in the default folder."""
    replay: Path | None = None
    """Play this file of a failure again, and nothing else."""


def torture_chamber(args: TortureArgs) -> None:
    """Play, print, and write.

    Raises:
        ValueError, OSError: an argument does not fit.
        DependencyNotInstalled: PettingZoo is missing, for one of the faces.
    """
    from tqdm import tqdm

    from tests.torture.chamber import Tally, save_cases, torture
    from tests.torture.trial import play_case

    check_ranges(args, seconds=(0, 1e9), steps=(1, 10**15), seed=(0, 10**9), first=(0, 10**9), jobs=(1, 1024))
    if args.replay is not None:
        if not args.replay.is_file():
            raise FileNotFoundError(f"--replay must be a case's file, got {args.replay}")
        law = play_case(Case.load(args.replay))
        print(f"{args.replay}: {law or 'all laws hold'}")
        sys.exit(1 if law else 0)
    total, stopped = Tally(), False
    play_hostile("full_size", 50.0, 1, seed=0)  # compile before the clock runs
    start = time.perf_counter()
    try:
        with tqdm(total=math.ceil(args.seconds), unit="s", desc="torture", leave=False, disable=None) as bar:
            for tally in torture(args.seed, args.seconds, args.steps, args.jobs, args.first):
                total.add(tally)
                save_cases(total, args.out, args.seed)
                bar.set_postfix_str(f"{total.steps:.3g} steps, {len(total.cases)} failures")
                bar.update(min(int(time.perf_counter() - start), bar.total) - bar.n)
    except KeyboardInterrupt:
        stopped = True
    print_tally(total, time.perf_counter() - start, args)
    if stopped:
        raise KeyboardInterrupt
    if total.cases:
        sys.exit(1)


def print_tally(tally: Tally, seconds: float, args: TortureArgs) -> None:
    """What was played, and what was found."""
    paddle, edge, crowded, pinned, points, drawn = tally.counts
    print(
        f"seed {args.seed}, bouts {args.first} to {args.first + tally.bouts - 1}: {tally.steps:,} steps "
        f"in {seconds:.0f} s\n"
        f"  hostile play: {tally.hostile_steps:,} steps, {paddle:,} contacts with paddles, {edge:,} with walls and "
        f"posts, {crowded:,} steps with 8 or more, {pinned:,} that left the puck pinned, {points:,} points, "
        f"{drawn:,} tables drawn\n"
        f"  trials of faces: {tally.trials:,}, of which {tally.refused:,} ended with bad arguments; "
        f"{tally.operations:,} operations, {tally.trial_steps:,} steps\n"
        f"  deepest overlap: {tally.worst:.2g} m\n"
        f"  failures: {len(tally.cases)}"
    )
    for case, path in zip(tally.cases, tally.files, strict=True):
        print(f"    {case.law}: {path}")


def main() -> None:
    """Read the command line and play."""
    run_command("torture", TortureArgs, torture_chamber)


if __name__ == "__main__":
    main()
