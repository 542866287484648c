"""Measure how well a player does: python -m scripts.evaluate MODEL --opponent NAME"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Annotated

import tyro

from agents.conditions import Conditions, in_words
from agents.files import write_json
from agents.measuring.evaluation import OPPONENTS, SOLO_TASKS, Result, play_points, play_task
from agents.models import Player, load_player, short_name
from agents.options import (
    PLAYER_HELP,
    Address,
    CameraOption,
    Count,
    DelayOption,
    JsonFile,
    RandomizeOption,
    TableOption,
    Trust,
    Workers,
    check_cluster,
    check_output,
    check_ranges,
    listed,
)
from agents.spread import spread
from agents.training.report import print_results, print_task_result
from airhockey_env.checks import check_choice
from scripts._command import run_command

TASKS = ("point", *SOLO_TASKS)
TASK_HELP = f"Play this task: {listed(TASKS)}. There is no opponent in {listed(SOLO_TASKS, 'and')}."
MODEL_HELP = f"Evaluate this player. {PLAYER_HELP}"


@dataclass(frozen=True)
class EvaluateArgs:
    """Measure how well a player does against others, or in a task that has no opponent.

    It plays half of the points on each side of the table. The decided points are those that did not end in a draw,
    which a point does after 30 s. The player sees exact states on a full-size table unless options say otherwise, even
    if it was trained under other conditions; its opponents always see exact states. With --workers, the points against
    several opponents are played at the same time.
    """

    model: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="MODEL", help=MODEL_HELP)]
    task: Annotated[str, tyro.conf.arg(help=TASK_HELP)] = "point"
    opponent: str = "all"
    """Play against this player, or with "all" against each of the named players."""
    episodes: Annotated[Count, tyro.conf.arg(aliases=("--points",))] = 2000
    """Play this many points against each opponent, or this many episodes of the task."""
    opponent_skill: float = 1.0
    """Limit scripted opponents to this share of their paddle's top speed, from 0 to 1."""
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


def evaluate(args: EvaluateArgs) -> None:
    """Play, print, and write.

    Raises:
        ValueError, OSError: an argument does not fit.
    """
    check_ranges(args, episodes=(1, 10**8), opponent_skill=(0, 1), seed=(0, 10**9))
    check_cluster(args)
    check_output("json", args.json)
    conditions = Conditions.of_options(args)
    check_choice("--task", args.task, TASKS)
    if args.task != "point" and (args.opponent != "all" or args.opponent_skill != 1.0):
        raise ValueError(f"--opponent and --opponent-skill do not go with --task {args.task}, which has no opponent")
    if args.task != "point" and args.workers is not None:
        raise ValueError(f"--workers does not go with --task {args.task}, which is one task, got {args.workers}")
    kept = {"conditions": conditions.as_dict(), "seed": args.seed}
    player = load_player(args.model, trust=args.trust)
    if args.task != "point":
        result = play_task(player, args.task, args.episodes, seed=args.seed, conditions=conditions)
        print_task_result(result, in_words(args))
        if args.json is not None:
            write_json(args.json, {"model": args.model, **kept, "results": [result.as_dict()]})
        return
    names = OPPONENTS if args.opponent == "all" else (args.opponent,)
    opponents = {short_name(name): load_player(name, "--opponent", trust=args.trust) for name in names}
    play = partial(play_against, args, conditions, player)
    numbered = dict(spread(play, opponents.items(), args.workers, args.address))
    results = [numbered[number] for number in range(len(opponents))]
    print_results(results, in_words(args))
    if args.json is not None:
        write_json(args.json, {"model": args.model, **kept, "results": [result.as_dict() for result in results]})


def play_against(args: EvaluateArgs, conditions: Conditions, player: Player, opponent: tuple[str, Player]) -> Result:
    """Play the points against one opponent, given by its name in the results and the player."""
    name, other = opponent
    return play_points(
        player,
        other,
        args.episodes,
        name=name,
        seed=args.seed,
        opponent_skill=args.opponent_skill,
        conditions=conditions,
    )


def main() -> None:
    """Read the command line and evaluate."""
    run_command("evaluate", EvaluateArgs, evaluate)


if __name__ == "__main__":
    main()
