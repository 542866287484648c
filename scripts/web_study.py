"""Measure the browser's pages, and take their pictures: python -m scripts.web_study"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from agents.files import write_json
from agents.options import JsonFile, check_output, check_ranges, make_folder
from agents.tables import print_table
from benchmarks import page
from benchmarks.web import latency, load, pictures
from scripts._command import run_command

DOCS = Path(__file__).parents[1] / "docs"


@dataclass(frozen=True)
class WebStudyArgs:
    """Measure how late the pages' pictures are in Chromium, and how many matches one core holds; take their pictures.

    It needs Chromium and its driver, and the extra "dev".
    """

    only: Literal["latency", "load", "pictures"] | None = None
    """Do only this part."""
    seconds: float = 5.0
    """Play each number of matches for this many seconds."""
    trials: int = 60
    """Move the pointer this many times."""
    run: Path | None = None
    """Take a picture of this training run, too."""
    out: Path = DOCS
    """Write the pictures into this folder, which is made if needed."""
    json: JsonFile = None
    page: Path | None = None
    """Also write the tables into this page, between its marks for them, as docs/web.md has them."""


def web_study(args: WebStudyArgs) -> None:
    """Measure, print and write.

    Raises:
        ValueError, OSError: an argument does not fit.
        DependencyNotInstalled: the browser, its driver or selenium are missing.
    """
    check_output("json", args.json, ".json")
    check_ranges(args, seconds=(0.5, 600), trials=(1, 10_000))
    results: dict[str, Any] = {}
    tables: dict[str, page.Rows] = {}
    if args.only in (None, "latency"):
        results["latency"] = latency.measure(args.trials)
        tables["latency"] = latency_table(results["latency"])
    if args.only in (None, "load"):
        results["load"] = load.measure(args.seconds)
        tables["load"] = load_table(results["load"])
    for name, rows in tables.items():
        print_table(name.capitalize(), rows)
    if args.json is not None:
        write_json(args.json, results)
    if args.page is not None:
        text = args.page.read_text(encoding="utf-8")
        for name, rows in tables.items():
            text = page.insert(text, name, rows)
        page.write(args.page, text)
    if args.only in (None, "pictures"):
        make_folder("out", args.out)
        for path in pictures.draw(args.out, args.run):
            print(path)


def latency_table(result: dict[str, Any]) -> page.Rows:
    """The head and the rows of the table of what a person sees."""
    return [
        ("what", "median", "95th percentile"),
        ("pointer event to the first drawn picture in which the paddle has moved, ms",
         f"{result['median_ms']:.1f}", f"{result['p95_ms']:.1f}"),
        ("pictures per second at 1280 x 720", f"{result['pictures_per_second']:.1f}", ""),
    ]  # fmt: skip


def load_table(rows: list[dict[str, Any]]) -> page.Rows:
    """The head and the rows of the table of what the server holds."""
    head = ("matches", "answers per second", "median, ms", "95th percentile, ms")
    columns = (("matches", "d"), ("answers_per_second", ".0f"), ("median_ms", ".2f"), ("p95_ms", ".2f"))
    return [head, *(tuple(format(row[name], form) for name, form in columns) for row in rows)]


def main() -> None:
    """Read the command line and act."""
    run_command("web_study", WebStudyArgs, web_study)


if __name__ == "__main__":
    main()
