"""Write the model card of a training run: python -m scripts.model_card RUN"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from agents.options import check_output
from agents.training.model_card import model_card
from agents.training.runs import RunFolder
from airhockey_env.files import replace
from scripts._command import run_command


@dataclass(frozen=True)
class ModelCardArgs:
    """Write the model card of a training run, a README.md as the Hugging Face Hub shows it.

    The card says how the run was made and what it can do. Everything in it comes from the run's own files and from the
    files of results that are given, which belong to it if they are about a player with its name.
    """

    run: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="RUN")]
    """Describe this run, given by its folder or its name under runs/."""
    ladder: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Add the rating from this JSON file of scripts.ladder."""
    scorecard: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Add the tasks from this JSON file of scripts.scorecard."""
    exploit: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Add the exploitability from this JSON file of scripts.exploit."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Write to this .md file, which is replaced if it exists. The default is README.md in the folder of the run."""


def write_card(args: ModelCardArgs) -> None:
    """Read, and write the card.

    Raises:
        ValueError, OSError: an argument does not fit, or a file is damaged.
    """
    check_output("out", args.out, ".md")
    folder = RunFolder.open(args.run)
    card = model_card(folder, ladder=args.ladder, scorecard=args.scorecard, exploit=args.exploit)
    path = args.out or folder.path / "README.md"
    replace(path, lambda part: part.write_text(card, encoding="utf-8"))
    print(path)


def main() -> None:
    """Read the command line and write the card."""
    run_command("model_card", ModelCardArgs, write_card)


if __name__ == "__main__":
    main()
