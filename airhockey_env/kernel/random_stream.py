"""Random draws inside compiled code: one stream a table, part of the table's state.

So results depend neither on the size of the batch nor on the order in which its tables are played. The generator is
SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
"""

from __future__ import annotations

import numpy as np

from airhockey_env.compiled import compiled

_STEP = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


@compiled
def draw(state):
    """The next number of the table's stream, uniform in [0, 1)."""
    state.stream += _STEP
    z = state.stream
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    z = z ^ (z >> _S31)
    return np.float64(z >> _S11) * (1.0 / 9007199254740992.0)


@compiled
def draw_between(state, low, high):
    """The next number of the table's stream, uniform in [low, high)."""
    return low + (high - low) * draw(state)


def stream_from_seed(seed: int) -> np.uint64:
    """The state of a stream for a seed: any integer from 0 up, however large."""
    return np.random.SeedSequence(seed).generate_state(1, np.uint64)[0]
