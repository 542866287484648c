"""Rate players who have all played each other: python -m scripts.ladder [MODELS...]"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from agents.conditions import Conditions, in_words
from agents.files import write_json
from agents.measuring.ladder import ANCHOR, ANCHOR_RATING, PRIOR, Match, find_players, play_ladder, rate
from agents.measuring.ladder_report import draw_ladder, print_ladder
from agents.options import (
    PLAYER_HELP,
    Address,
    CameraOption,
    Count,
    DelayOption,
    JsonFile,
    PlotFile,
    RandomizeOption,
    TableOption,
    Trust,
    Workers,
    check_cluster,
    check_output,
    check_ranges,
)
from scripts._command import run_command

PLAYERS_HELP = f"Rate these players as well as the named ones. {PLAYER_HELP}"


@dataclass(frozen=True)
class LadderArgs:
    """Rate players: each pair plays points, half of them on each side of the table.

    Both players of a pair have the camera and the delay, if any are given; scripted players see exact states. The
    ratings come with 95 % intervals. Ctrl-C ends the play early and rates what has been played.
    """

    players: Annotated[
        tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="[MODEL ...]", help=PLAYERS_HELP)
    ] = ()
    only: bool = False
    """Rate only the players that are given, and not all of the named ones."""
    points: Count = 2000
    """Let each pair play this many points."""
    table: TableOption = "full_size"
    randomize: RandomizeOption = None
    camera: CameraOption = None
    action_delay_ms: DelayOption = (0.0,)
    seed: int = 0
    """Draw the serves from this seed."""
    trust: Trust = False
    workers: Workers = None
    address: Address = None
    json: JsonFile = None
    plot: PlotFile = None


def ladder(args: LadderArgs) -> None:
    """Play, rate, print, and write.

    Raises:
        ValueError, OSError: an argument does not fit.
    """
    from tqdm import tqdm

    check_ranges(args, points=(1, 10**8), seed=(0, 10**9))
    check_cluster(args)
    check_output("json", args.json)
    check_output("plot", args.plot, ".png")
    conditions = Conditions.of_options(args)
    players = find_players(args.players, args.only, args.trust)
    names = list(players)
    played: dict[int, Match] = {}
    total, stopped = len(names) * (len(names) - 1) // 2, False
    plays = play_ladder(
        players, args.points, seed=args.seed, conditions=conditions, workers=args.workers, address=args.address
    )
    try:
        with tqdm(total=total, unit="match", desc="ladder", leave=False, disable=None) as bar:
            for number, match in plays:
                played[number] = match
                bar.update()
    except KeyboardInterrupt:
        if not played:
            raise
        stopped = True
    matches = [played[number] for number in sorted(played)]
    ratings = rate(names, matches)
    print_ladder(ratings, matches)
    if args.json is not None:
        write_json(
            args.json,
            {
                "conditions": conditions.as_dict(),
                "points_of_a_pair": args.points,
                "seed": args.seed,
                "anchor": {"player": ANCHOR if ANCHOR in names else "mean", "rating": ANCHOR_RATING},
                "prior": {"wins": PRIOR, "losses": PRIOR, "draws": PRIOR},
                "ratings": [rating.as_dict() for rating in ratings],
                "matches": [match.as_dict() for match in matches],
            },
        )
    if args.plot is not None:
        pairs = f"{len(matches)} of {total} pairs" if stopped else "each pair"
        draw_ladder(ratings, matches, f"{in_words(args)}, {matches[0].result.points} points of {pairs}", args.plot)
    if stopped:
        print(f"Stopped after {len(matches)} of {total} matches.")
        raise KeyboardInterrupt


def main() -> None:
    """Read the command line and play."""
    run_command("ladder", LadderArgs, ladder)


if __name__ == "__main__":
    main()
