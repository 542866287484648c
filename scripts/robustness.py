"""Measure how robust players are: python -m scripts.robustness MODEL [MODEL ...]"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import tyro
from tqdm import tqdm

from agents.files import write_json
from agents.measuring.robustness import LISTS, PARTS, conditions_of_part, measure, together
from agents.measuring.robustness_report import draw_robustness, print_robustness
from agents.models import load_player, load_players, short_name
from agents.options import (
    PLAYER_HELP,
    Address,
    Count,
    JsonFile,
    PlotFile,
    Trust,
    Workers,
    check_cluster,
    check_output,
    check_ranges,
)
from scripts._command import run_command

PLAYERS_HELP = f"Measure these players side by side. {PLAYER_HELP}"


@dataclass(frozen=True)
class RobustnessArgs:
    """Measure how much players keep of their play through cameras and on tables that they have not been trained on.

    Every player plays points against an opponent under many conditions: presets, a grid of the delay and the noise of a
    camera, a grid of the drag and the wall restitution of a table, and tables and cameras that no training range
    contains. The opponent sees exact states. docs/robustness.md explains the conditions.
    """

    players: Annotated[
        tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="MODEL [MODEL ...]", help=PLAYERS_HELP)
    ]
    opponent: str = "striker"
    """Play the points against this player."""
    points: Count = 600
    """Play this many points under each of the conditions, half of them on each side of the table."""
    only: Literal["named", "held_out", "camera", "table"] | None = None
    """Measure only the presets, the held-out tables and cameras, the grid of cameras, or the grid of tables."""
    seed: int = 0
    """Draw the serves from this seed."""
    trust: Trust = False
    workers: Workers = None
    address: Address = None
    json: JsonFile = None
    plot: PlotFile = None


def robustness(args: RobustnessArgs) -> None:
    """Play, print, and write.

    Raises:
        ValueError, OSError: an argument does not fit.
    """
    check_ranges(args, points=(1, 10**6), seed=(0, 10**9))
    check_cluster(args)
    check_output("json", args.json)
    check_output("plot", args.plot, ".png")
    if not args.players:
        raise ValueError("MODEL must name one player or more, got none")
    players = load_players(args.players, args.trust)
    opponent = load_player(args.opponent, "--opponent", trust=args.trust)
    opponent_name = short_name(args.opponent)
    parts = (args.only,) if args.only else PARTS
    total = len(players) * sum(len(conditions_of_part(part)) for part in parts)
    played = measure(
        players,
        opponent,
        args.points,
        opponent_name=opponent_name,
        parts=parts,
        seed=args.seed,
        workers=args.workers,
        address=args.address,
    )
    numbered = dict(tqdm(played, total=total, unit="condition", desc="robustness", leave=False, disable=None))
    cells = [numbered[number] for number in range(total)]
    print_robustness(cells)
    if args.json is not None:
        summaries = {
            part: [
                together([cell for cell in cells if (cell.part, cell.player) == (part, player)]).as_dict()
                for player in players
            ]
            for part in parts
            if part in LISTS
        }
        settings = {"opponent": args.opponent, "points": args.points, "seed": args.seed}
        write_json(args.json, {**settings, "together": summaries, "cells": [cell.as_dict() for cell in cells]})
    if args.plot is not None:
        draw_robustness(cells, f"Against {opponent_name}, {cells[0].result.points} points each", args.plot)


def main() -> None:
    """Read the command line and measure."""
    run_command("robustness", RobustnessArgs, robustness)


if __name__ == "__main__":
    main()
