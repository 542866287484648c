"""Show what the perfect kiss is worth: python -m scripts.kiss_study"""

from __future__ import annotations

import platform
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

import numpy as np
from gymnasium.error import DependencyNotInstalled

import airhockey_env
from agents.files import write_json
from agents.options import JsonFile, check_output, make_folder
from agents.tables import print_table
from benchmarks import page
from benchmarks.kiss import engines, error, phases, picture, reversal
from benchmarks.style import check_matplotlib
from scripts._command import run_command

ROOT = Path(__file__).parents[1]
PARTS: dict[str, ModuleType] = {
    "picture": picture,
    "error": error,
    "phases": phases,
    "reversal": reversal,
    "engines": engines,
}
PAGE = "kiss_study.md"


@dataclass(frozen=True)
class KissStudyArgs:
    """Measure what exact contacts are worth, draw the figures of the study and write its tables."""

    out: Path = ROOT / "docs"
    """Write the figures into this folder, which is made if needed, and the tables into its copy of the page."""
    quick: bool = False
    """Measure few points in short runs, to see that everything works."""
    only: Literal["picture", "error", "phases", "reversal", "engines"] | None = None
    """Measure only this part. What was written about the others stays."""
    json: JsonFile = None


def kiss_study(args: KissStudyArgs) -> None:
    """Measure, draw, and write.

    Raises:
        ValueError, OSError: the folder does not fit.
        DependencyNotInstalled: the figures cannot be drawn.
    """
    from rich.progress import track

    check_matplotlib("the figures need")
    make_folder("out", args.out)
    check_output("json", args.json)
    own_page = args.out / PAGE
    text = (own_page if own_page.exists() else ROOT / "docs" / PAGE).read_text(encoding="utf-8")
    results: dict[str, Any] = {
        "airhockey_env": airhockey_env.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
    }
    notes = []
    for name in track([args.only] if args.only else list(PARTS), description="kiss study", transient=True):
        part = PARTS[name]
        data = part.measure(args.quick)
        notes += data.pop("missing", [])
        if not data:
            notes.append(f"{name} is skipped: there is nothing to compare with")
            continue
        part.draw(data, args.out / f"kiss_{name}.png")
        table = part.table(data)
        print_table(name, [[cell.replace("`", "") for cell in row] for row in table])
        text = page.insert(text, name, table)
        results[name] = data
        page.write(own_page, text)  # after every part: an interrupt loses none that is done
        if args.json is not None:
            write_json(args.json, results)
    for note in notes:
        print(note)
    if args.only not in (None, *results):
        raise DependencyNotInstalled(f'--only {args.only} needs the extra "study": pip install -e ".[study]"')
    print(f"Figures and tables: {args.out}")


def main() -> None:
    """Read the command line and draw."""
    run_command("kiss_study", KissStudyArgs, kiss_study)


if __name__ == "__main__":
    main()
