"""Study how fast implementations of PPO learn: python -m scripts.learner_study"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from agents.files import write_json
from agents.options import Count, JsonFile, check_output, check_ranges, listed
from agents.tables import print_table
from agents.training.ppo import PpoArgs, resolve
from airhockey_env.checks import check_choice
from benchmarks.learners import LEARNERS, learn, table
from scripts._command import run_command


@dataclass(frozen=True)
class LearnerStudyArgs:
    """Train the baseline with several implementations of PPO, one after the other, and compare how fast they learn.

    Each has one thread. Times leave out the evaluations, but not what a library compiles while it learns.
    """

    learners: tuple[str, ...] = tuple(LEARNERS)
    """Train with these: sb3 (Stable-Baselines3, which the other commands use) and sbx (the same algorithm in JAX)."""
    steps: Count = 10_000_000
    """Train for this many environment steps."""
    seed: int = 0
    """Seed the networks, the exploration and the tables."""
    eval_every: Count = 1_000_000
    """Evaluate every this many steps."""
    points: Count = 1000
    """Play this many points against the striker in an evaluation."""
    json: JsonFile = None


def study(args: LearnerStudyArgs) -> list[dict[str, Any]]:
    """Train, print after each learner, and write.

    Raises:
        ValueError, OSError: an argument does not fit.
        gymnasium.error.DependencyNotInstalled: a library is missing.
    """
    if not args.learners:
        raise ValueError(f"--learners must name one or more of {listed(LEARNERS)}, got none")
    for learner in args.learners:
        check_choice("--learners", learner, LEARNERS)
    check_ranges(args, steps=(1, math.inf), eval_every=(1, math.inf), points=(1, math.inf))
    check_output("json", args.json)
    for learner in args.learners:
        LEARNERS[learner].check()
    options = resolve(PpoArgs(steps=args.steps, seed=args.seed, eval_every=args.eval_every))
    rows: list[dict[str, Any]] = []
    for learner in args.learners:
        rows += learn(LEARNERS[learner], options, args.points)
        print_table("Learning against the striker", list(table(rows)))
        if args.json is not None:
            write_json(args.json, rows)
    return rows


def main() -> None:
    """Read the command line and study."""
    run_command("learner_study", LearnerStudyArgs, study)


if __name__ == "__main__":
    main()
