"""Let a model play against others, or a task: python -m scripts.evaluate MODEL --opponent NAME"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from agents.counts import Count
from agents.files import write_json
from agents.measuring.evaluation import OPPONENTS, SOLO_TASKS, play_points, play_task
from agents.models import PLAYER_HELP, TRUST_HELP, load_player, short_name
from agents.options import TABLE_HELP, check_output, check_ranges, check_table
from agents.training.report import print_results, print_task_result
from scripts._command import run_command

TASK_HELP = f"What is played: point, or {' or '.join(SOLO_TASKS)}, which have no opponent."


@dataclass(frozen=True)
class EvaluateArgs:
    """Let a model play points against others, half of them on each side of the table; or a task."""

    model: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="MODEL", help=f"Who plays: {PLAYER_HELP}")]
    task: Annotated[str, tyro.conf.arg(help=TASK_HELP)] = "point"
    opponent: str = "all"
    """A player as above, or "all" for every named opponent."""
    episodes: Count = 2000
    """Points against each opponent, or episodes of the task."""
    opponent_skill: float = 1.0
    """Share of its paddle's speed that a scripted opponent uses, 0 to 1."""
    table: Annotated[str, tyro.conf.arg(help=TABLE_HELP)] = "full_size"
    seed: int = 0
    """Seed of the serves."""
    trust: Annotated[bool, tyro.conf.arg(help=TRUST_HELP)] = False
    json: Path | None = None
    """Write the results to this file too."""


def evaluate(args: EvaluateArgs) -> None:
    """Play, print, and write.

    Raises:
        ValueError, OSError: an argument does not fit.
    """
    check_ranges(args, episodes=(1, 10**8), opponent_skill=(0, 1), seed=(0, 10**9))
    check_output("json", args.json)
    check_table(args.table)
    if args.task not in ("point", *SOLO_TASKS):
        raise ValueError(f"--task must be one of {('point', *SOLO_TASKS)}, got {args.task!r}")
    if args.task != "point" and (args.opponent != "all" or args.opponent_skill != 1.0):
        raise ValueError(f"--opponent and --opponent-skill do not go with --task {args.task}, which has no opponent")
    player = load_player(args.model, trust=args.trust)
    if args.task != "point":
        result = play_task(player, args.task, args.episodes, seed=args.seed, table=args.table)
        print_task_result(result)
        if args.json is not None:
            write_json(args.json, {"model": args.model, "results": [result.as_dict()]})
        return
    names = OPPONENTS if args.opponent == "all" else (args.opponent,)
    results = [
        play_points(
            player,
            load_player(name, "--opponent", trust=args.trust),
            args.episodes,
            name=short_name(name),
            seed=args.seed,
            opponent_skill=args.opponent_skill,
            table=args.table,
        )
        for name in names
    ]
    print_results(results)
    if args.json is not None:
        write_json(args.json, {"model": args.model, "results": [result.as_dict() for result in results]})


def main() -> None:
    """Read the command line and evaluate."""
    run_command("evaluate", EvaluateArgs, evaluate)


if __name__ == "__main__":
    main()
