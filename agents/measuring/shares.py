"""Shares and quartiles, as the reports of players contain them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.measuring.evaluation import wilson_interval


@dataclass(frozen=True)
class Share:
    """A count out of a total."""

    count: int
    of: int

    @property
    def value(self) -> float:
        return self.count / self.of if self.of else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """95 % Wilson interval."""
        return wilson_interval(self.count, self.of)

    def __str__(self) -> str:
        """The share and its interval in %, or "none" if there is nothing to share."""
        low, high = self.interval
        return f"{self.value:.1%} ({100 * low:.1f}-{100 * high:.1f})" if self.of else "none"

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return {"count": self.count, "of": self.of, "share": self.value, "share_95": list(self.interval)}


def quartiles(values: NDArray[np.float64]) -> list[float]:
    """First quartile, median and third quartile. Infinite values count as the greatest; NaN if there are no values."""
    if not len(values):
        return [math.nan] * 3
    return [float(value) for value in np.quantile(values, [0.25, 0.5, 0.75], method="nearest")]
