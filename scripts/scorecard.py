"""Measure a player's skills: python -m scripts.scorecard MODEL"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from agents.counts import Count
from agents.files import write_json
from agents.measuring.scorecard import measure
from agents.measuring.scorecard_report import draw_card, print_card
from agents.models import PLAYER_HELP, TRUST_HELP, load_player, short_name
from agents.options import TABLE_HELP, check_output, check_ranges, check_table
from scripts._command import run_command


@dataclass(frozen=True)
class ScorecardArgs:
    """Measure a player's shots, saves, time on the attack, fouls, own goals and reaction; docs/scorecard.md says how.

    It plays points against an opponent, half of them on each side of the table, and the tasks hit and defend.
    """

    model: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="MODEL", help=f"Who plays: {PLAYER_HELP}")]
    opponent: str = "striker"
    """A player as above."""
    points: Count = 2000
    """Points played against the opponent."""
    episodes: Count = 4000
    """Episodes of each task."""
    table: Annotated[str, tyro.conf.arg(help=TABLE_HELP)] = "full_size"
    seed: int = 0
    """Seed of the serves and of the tasks."""
    trust: Annotated[bool, tyro.conf.arg(help=TRUST_HELP)] = False
    json: Path | None = None
    """Write the card to this file too."""
    plot: Path | None = None
    """Draw the card to this file, .png."""


def scorecard(args: ScorecardArgs) -> None:
    """Play, print, and write.

    Raises:
        ValueError, OSError: an argument does not fit.
    """
    check_ranges(args, points=(1, 10**6), episodes=(1, 10**6), seed=(0, 10**9))
    check_output("json", args.json)
    check_output("plot", args.plot, ".png")
    spec = check_table(args.table)
    card = measure(
        load_player(args.model, trust=args.trust),
        load_player(args.opponent, "--opponent", trust=args.trust),
        player_name=short_name(args.model),
        opponent_name=short_name(args.opponent),
        points=args.points,
        episodes=args.episodes,
        seed=args.seed,
        table=args.table,
    )
    print_card(card)
    if args.json is not None:
        write_json(args.json, {"table": args.table, "seed": args.seed, **card.as_dict()})
    if args.plot is not None:
        draw_card(card, spec, args.plot)


def main() -> None:
    """Read the command line and measure."""
    run_command("scorecard", ScorecardArgs, scorecard)


if __name__ == "__main__":
    main()
