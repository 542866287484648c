"""Trained policies that ship with the package, by name, such as `opponent="expert"`.

Their model cards stand in docs/trained.md: how they were made, how they rate, and what they are bad at.
"""

from __future__ import annotations

import functools
from pathlib import Path

from airhockey_env.opponents.policy import MlpPolicy

TRAINED = ("adept", "expert", "robust")
"""`adept` and `expert`, from weaker to stronger, see exact states; `robust` has learned to do without."""


@functools.cache
def trained_policy(name: str) -> MlpPolicy:
    """The policy of a name in `TRAINED`; read from disk once."""
    return MlpPolicy.load(Path(__file__).parent / f"{name}.npz")
