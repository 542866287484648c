"""The cost of the compiler flags of the game in C, for every compiler that works here."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

from benchmarks.speed import build, games
from benchmarks.speed.measure import Effort, Row, ratio, run

TITLE = "The game in C, one core"
SIZE = 4096
COMPILED = "the compiled step of the batch"
NARROW = ("-mno-fma", "-mno-avx512f")
FUSING = "-ffp-contract=fast"  # changes the game's results


def variants(command: tuple[str, ...]) -> dict[str, list[str]]:
    """Flags by a description of how they differ from those the game is built with, which come first."""
    flags = build.flags(command)

    def without(removed: str) -> list[str]:
        return [flag for flag in flags if flag != removed]

    found = {
        "": flags,
        f", without {build.NO_SLP}": without(build.NO_SLP),
        f", {' '.join(NARROW)} instead": [*without(build.NO_SLP), *NARROW],
        f", without {build.FAST}": without(build.FAST),
        ", and -fno-tree-vectorize": [*flags, "-fno-tree-vectorize"],
        ", and -fno-trapping-math": [*flags, "-fno-trapping-math"],
        ", and -O2": [*flags, "-O2"],
        f", and {FUSING}": [*flags, FUSING],
    }
    return {f"{' '.join(command)}{what}": options for what, options in found.items() if build.knows(command, *options)}


def measure(effort: Effort) -> tuple[list[Row], list[str]]:
    """Rows for every compiler and its flags, and a note if there is none. A quick run uses the first compiler."""
    n = 256 if effort.quick else SIZE
    measures = [games.compiled(COMPILED, n)]
    known: list[Row] = [{}]
    for command in build.compilers()[:1] if effort.quick else build.compilers():
        asked = subprocess.run([*command, "--version"], capture_output=True, encoding="utf-8", errors="replace")
        for what, options in variants(command).items():
            measures.append(games.in_c(what, n, command, tuple(options)))
            more = {"fused": _fused(command, options), "flags": options, "version": asked.stdout.partition("\n")[0]}
            known.append({"first": " ".join(command), **more})
    rows = [row | more for row, more in zip(run(measures, effort), known, strict=True)]
    return rows, [] if rows[1:] else ["the game in C is left out: it needs a C compiler (cc): install gcc or clang"]


def _fused(command: tuple[str, ...], options: list[str]) -> int | None:
    """Number of fused operations in the object code; None if it cannot be read."""
    with tempfile.TemporaryDirectory(prefix="airhockey") as folder:
        found = build.fused(build.build(command, options, Path(folder) / "airhockey.so"))
    return None if found is None else len(found)


def table(rows: list[Row]) -> list[tuple[str, ...]]:
    """One row for the compiled step and one for each set of flags."""
    cells: list[tuple[str, ...]] = [("what", "steps/s", "relative to the flags in use", "fused operations")]
    for row in rows:
        share, fused = ratio(rows, row, row.get("first", "")), row.get("fused")
        shown = "" if share is None else f"{share:.2f}"
        cells.append((row["what"], f"{row['per_second']:,.0f}", shown, "" if fused is None else str(fused)))
    return cells
