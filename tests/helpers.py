"""What the tests of several files need to know of the package's faces."""

from __future__ import annotations

import copy
import pickle
import re
from typing import Any

import gymnasium
import numpy as np

import airhockey_env

IDS = sorted(
    name for name, spec in gymnasium.registry.items() if str(spec.entry_point).startswith(airhockey_env.__name__)
)
"""Every environment that the package registers."""

COPIES = {"deepcopy": copy.deepcopy, "pickle": lambda thing: pickle.loads(pickle.dumps(thing))}


def pursue(seen: np.ndarray) -> np.ndarray:
    """A policy that can be pickled: chase the puck, from observations (N, 13) to actions (N, 2)."""
    return 5.0 * (seen[:, 8:10] - seen[:, 0:2])


def shown(value: Any) -> str:
    """A parameter as a part of a test's name; without functions' addresses, which differ from process to process."""
    return re.sub(r"<function ([\w<>.]+) at \w+>", r"\1", str(value))


def random_actions(seed: int, steps: int, num_envs: int, continuous: bool = True) -> np.ndarray:
    """Actions that change now and then, some of them out of range: (steps, num_envs, ...)."""
    rng = np.random.default_rng(seed)
    held = -(-steps // 8)
    if continuous:
        drawn = rng.uniform(-1.3, 1.3, (held, num_envs, 2)).astype(np.float32)
    else:
        drawn = rng.integers(9, size=(held, num_envs))
    return np.repeat(drawn, 8, axis=0)[:steps]


def same(first: Any, second: Any) -> bool:
    """Whether two results are alike to the bit: arrays (types included), infos, and what they hold."""
    if isinstance(first, dict):
        return (
            isinstance(second, dict) and first.keys() == second.keys() and all(same(first[k], second[k]) for k in first)
        )
    if isinstance(first, (tuple, list)):
        return type(first) is type(second) and len(first) == len(second) and all(map(same, first, second))
    if isinstance(first, np.ndarray) and first.dtype == object:
        return isinstance(second, np.ndarray) and len(first) == len(second) and all(map(same, first, second))
    if isinstance(first, (np.ndarray, np.generic)):
        return first.dtype == second.dtype and first.shape == second.shape and first.tobytes() == second.tobytes()
    return bool(first == second)
