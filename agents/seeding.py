"""Random streams that share nothing: of every purpose, of every seed, and of every session of a resumed run.

Gymnasium's convention, which the environments keep, gives table i of a batch the seed `seed + i`: batches of 512 tables
with seeds 0 and 1 have 511 of their streams in common. What is compared by its seeds, as training runs are, needs
streams that are independent; NumPy's `SeedSequence` spreads them.
"""

from __future__ import annotations

import numpy as np

PURPOSES = ("actions", "practice", "training", "league", "progress", "report", "evaluation", "video")
"""What streams are for. A purpose is known by its place here: new ones go to the end.

"actions" is the exploration, "progress" and "report" are a run's own evaluations while it trains and at its end, and
"evaluation" is what a command plays."""


def sequence(purpose: str, seed: int, *part: int) -> np.random.SeedSequence:
    """The root of the streams of a purpose.

    Args:
        purpose: one of `PURPOSES`.
        seed: 0 or more; the run's or the command's.
        part: 0 or more each; tells streams of the same purpose and seed from each other.
    """
    return np.random.SeedSequence(seed, spawn_key=(PURPOSES.index(purpose), *part))


def table_seeds(purpose: str, seed: int, number: int, *part: int) -> list[int]:
    """Seeds for that many tables, below 2**64; arguments as in `sequence`. More tables have the same ones first."""
    return sequence(purpose, seed, *part).generate_state(number, np.uint64).tolist()
