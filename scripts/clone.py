"""Clone the behaviour in a data set: python -m scripts.clone ID --out policy.npz"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from agents.datasets.storage import check_minari
from agents.options import check_output, check_ranges
from scripts._command import run_command


@dataclass(frozen=True)
class CloneArgs:
    """Train a policy to imitate the player of a data set: behaviour cloning, the baseline of offline learning."""

    dataset: Annotated[
        str, tyro.conf.Positional, tyro.conf.arg(metavar="ID", help="Imitate the player of this Minari data set.")
    ]
    out: Path = Path("policy.npz")
    """Write the policy to this .npz file, which all commands accept as a player."""
    epochs: int = 10
    """Pass over the data set this many times."""
    seed: int = 0
    """Draw the first weights and the order of the steps from this seed."""


def clone(args: CloneArgs) -> None:
    """Train, and write the policy.

    Raises:
        ValueError, OSError: an argument does not fit.
        gymnasium.error.DependencyNotInstalled: Minari is missing.
    """
    check_ranges(args, epochs=(1, 10**6), seed=(0, 10**9))
    check_output("out", args.out, ".npz")
    check_minari("Reading a data set needs")
    import minari

    from agents.training.cloning import clone_dataset

    try:
        dataset = minari.load_dataset(args.dataset)
    except FileNotFoundError as error:
        raise FileNotFoundError(f"ID must name a data set in Minari's folder; {error}") from error
    policy, loss = clone_dataset(dataset, epochs=args.epochs, seed=args.seed)
    policy.save(args.out)
    print(f"{args.out}: imitates {args.dataset} with an error of {loss:.4f} in the last pass")


def main() -> None:
    """Read the command line and train."""
    run_command("clone", CloneArgs, clone)


if __name__ == "__main__":
    main()
