"""Measure a player's skills: python -m scripts.scorecard MODEL"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from agents.conditions import Conditions
from agents.files import write_json
from agents.measuring.scorecard import measure
from agents.measuring.scorecard_report import draw_card, print_card
from agents.models import load_player, short_name
from agents.options import (
    PLAYER_HELP,
    CameraOption,
    Count,
    DelayOption,
    JsonFile,
    PlotFile,
    RandomizeOption,
    TableOption,
    Trust,
    check_output,
    check_ranges,
)
from scripts._command import run_command

MODEL_HELP = f"Measure this player. {PLAYER_HELP}"


@dataclass(frozen=True)
class ScorecardArgs:
    """Measure a player's shots, saves, time on the attack, fouls, own goals and reaction time.

    It plays points against an opponent, half of them on each side of the table, and episodes of the tasks hit and
    defend. docs/scorecard.md defines the figures.
    """

    model: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="MODEL", help=MODEL_HELP)]
    opponent: str = "striker"
    """Play the points against this player."""
    points: Count = 2000
    """Play this many points against the opponent."""
    episodes: Count = 4000
    """Play this many episodes of each task."""
    table: TableOption = "full_size"
    randomize: RandomizeOption = None
    camera: CameraOption = None
    action_delay_ms: DelayOption = (0.0,)
    seed: int = 0
    """Draw the serves and the tasks from this seed."""
    trust: Trust = False
    json: JsonFile = None
    plot: PlotFile = None


def scorecard(args: ScorecardArgs) -> None:
    """Play, print, and write.

    Raises:
        ValueError, OSError: an argument does not fit.
    """
    check_ranges(args, points=(1, 10**6), episodes=(1, 10**6), seed=(0, 10**9))
    check_output("json", args.json)
    check_output("plot", args.plot, ".png")
    conditions = Conditions.of_options(args)
    card = measure(
        load_player(args.model, trust=args.trust),
        load_player(args.opponent, "--opponent", trust=args.trust),
        player_name=short_name(args.model),
        opponent_name=short_name(args.opponent),
        points=args.points,
        episodes=args.episodes,
        seed=args.seed,
        conditions=conditions,
    )
    print_card(card)
    if args.json is not None:
        write_json(args.json, {"conditions": conditions.as_dict(), "seed": args.seed, **card.as_dict()})
    if args.plot is not None:
        draw_card(card, conditions.table, args.plot)


def main() -> None:
    """Read the command line and measure."""
    run_command("scorecard", ScorecardArgs, scorecard)


if __name__ == "__main__":
    main()
