"""Independent random streams for every purpose, every seed, every session of a resumed run and every worker.

By Gymnasium's convention, which the environments follow, environment i of a batch gets the seed `seed + i`. Batches of
512 environments with seeds 0 and 1 therefore share 511 streams. Training runs are compared across seeds and need
independent streams, which NumPy's `SeedSequence` provides.
"""

from __future__ import annotations

import numpy as np

PURPOSES = (
    *("actions", "practice", "training", "league", "progress", "report", "evaluation", "video", "imitation"),
    *("dataset", "reference"),
)
"""The purposes of streams. The position in this tuple identifies a purpose, so new ones must be added at the end.

"actions" is exploration, "progress" and "report" are a run's own evaluations during training and at its end, and
"evaluation" is for commands that play."""


def sequence(purpose: str, seed: int, *part: int) -> np.random.SeedSequence:
    """The root of the streams of a purpose.

    Args:
        purpose: one of `PURPOSES`.
        seed: seed of the run or the command, 0 or more.
        part: numbers, each 0 or more, that distinguish streams of the same purpose and seed.
    """
    return np.random.SeedSequence(seed, spawn_key=(PURPOSES.index(purpose), *part))


def table_seeds(purpose: str, seed: int, number: int, *part: int) -> list[int]:
    """Return `number` seeds below 2**64 for the tables of a batch. A larger number has the same seeds first.

    The other arguments are as in `sequence`.
    """
    return sequence(purpose, seed, *part).generate_state(number, np.uint64).tolist()
