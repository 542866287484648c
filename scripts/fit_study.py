"""Show how well fit_table recovers simulated tables: python -m scripts.fit_study"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from agents.files import write_json
from agents.fitting.estimates import check_scipy
from agents.options import Count, JsonFile, check_output, check_ranges
from agents.tables import print_table
from benchmarks import page
from benchmarks.fit import recovery
from scripts._command import run_command


@dataclass(frozen=True)
class FitStudyArgs:
    """Fit many random simulated tables, and count how often the intervals hold what the tables are.

    Each table is watched by a simulated camera, which adds noise and loses frames.
    """

    tables: Count = 100
    """Draw this many tables."""
    seconds: float = 60.0
    """Watch each table for this many seconds."""
    only: Literal["thrown", "played", "thrown_slow"] | None = None
    """Measure only this part: a puck that is thrown, one that two players play with, or a slow camera."""
    seed: int = 0
    """Draw the tables from this seed."""
    json: JsonFile = None
    page: Path | None = None
    """Also write the results into this page, between its marks for them, as docs/fit_table.md has them."""


def fit_study(args: FitStudyArgs) -> None:
    """Simulate, fit, print, and write.

    Raises:
        ValueError, OSError: an argument does not fit.
        DependencyNotInstalled: SciPy is missing.
    """
    from tqdm import tqdm

    check_scipy("fit_study needs")
    check_ranges(args, tables=(1, 10**6), seconds=(5, 300), seed=(0, 10**9))
    check_output("json", args.json)
    check_output("page", args.page)
    parts = list(recovery.PARTS) if args.only is None else [args.only]
    if args.page is not None:
        if not args.page.is_file():
            raise FileNotFoundError(f"--page must be a page that exists, got {args.page}")
        text = args.page.read_text(encoding="utf-8")
        for part in parts:
            page.check(text, part)
    results: dict[str, Any] = {"tables": args.tables, "seconds": args.seconds, "seed": args.seed}
    for part in parts:
        found = list(
            tqdm(
                recovery.recover(part, args.tables, args.seconds, args.seed),
                total=args.tables,
                desc=part,
                unit="table",
                leave=False,
                disable=None,
            )
        )
        results[part] = recovery.summarize(found)
        cells = recovery.table(results[part])
        print_table(recovery.PARTS[part].title, cells)
        if args.json is not None:
            write_json(args.json, results)
        if args.page is not None:
            page.write(args.page, page.insert(args.page.read_text(encoding="utf-8"), part, cells))


def main() -> None:
    """Read the command line and fit."""
    run_command("fit_study", FitStudyArgs, fit_study)


if __name__ == "__main__":
    main()
