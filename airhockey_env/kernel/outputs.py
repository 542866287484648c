"""What the compiled step writes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import records
from airhockey_env.engine.records import CONTACT
from airhockey_env.kernel.state import CONTACT_ROWS, OBSERVATION_SIZE
from airhockey_env.tables import FIELDS


class Outputs(NamedTuple):
    """The results of the last reset or step on N tables; allocated once, overwritten by the next.

    The first axis of `observation`, `final_observation` and `reward` is the seat: LEFT or RIGHT. A seat's observations,
    and the shaping terms of its rewards, are worked out only where somebody looks at them: the caller, a policy or a
    camera. Scripted players look at the state itself.
    """

    observation: NDArray[np.float32]
    """(2, N, 13) what each player observes."""
    final_observation: NDArray[np.float32]
    """(2, N, 13) where an automatic reset began a new episode in the same step: the last observation of the old one."""
    reward: NDArray[np.float64]
    """(2, N) rewards of the last step."""
    point: NDArray[np.int8]
    """(N,) +1 if the left player scored in the last step, -1 if the right one did, else 0."""
    foul: NDArray[np.bool_]
    """(N,) whether a shot clock ran out in the last step."""
    success: NDArray[np.bool_]
    """(N,) whether the last step ended the episode with success for the left player."""
    terminated: NDArray[np.bool_]
    """(N,) whether the last step ended the episode."""
    truncated: NDArray[np.bool_]
    """(N,) whether the limit of steps cut it off."""
    began: NDArray[np.bool_]
    """(N,) whether an episode began in the last step, by an automatic reset, or by a reset."""
    score: NDArray[np.int32]
    """(N, 2) points: left, right."""
    final_score: NDArray[np.int32]
    """(N, 2) where an automatic reset began a new episode in the same step: the last score of the old one."""
    final_spec: NDArray[np.float64]
    """(N, 15) there, with tables that are drawn for every episode: the old one's values, in the order of `FIELDS`."""
    n_contacts: NDArray[np.int32]
    """(N,) contacts of the last step."""
    contacts: NDArray[np.void]
    """(N, CONTACT_ROWS) `CONTACT`: the first `n_contacts[i]` of row i, in the order of time."""


def make_outputs(num_tables: int, randomized: bool) -> Outputs:
    """Outputs for so many tables, all zeros."""
    n = num_tables
    return Outputs(
        observation=np.zeros((2, n, OBSERVATION_SIZE), np.float32),
        final_observation=np.zeros((2, n, OBSERVATION_SIZE), np.float32),
        reward=np.zeros((2, n), np.float64),
        point=np.zeros(n, np.int8),
        foul=np.zeros(n, np.bool_),
        success=np.zeros(n, np.bool_),
        terminated=np.zeros(n, np.bool_),
        truncated=np.zeros(n, np.bool_),
        began=np.zeros(n, np.bool_),
        score=np.zeros((n, 2), np.int32),
        final_score=np.zeros((n, 2), np.int32),
        final_spec=np.zeros((n if randomized else 0, len(FIELDS)), np.float64),
        n_contacts=np.zeros(n, np.int32),
        contacts=records((n, CONTACT_ROWS), CONTACT),
    )
