"""The last observations of episodes that an automatic reset in the same step has replaced."""

from __future__ import annotations

from typing import Any

import numpy as np


class FinalObservations(np.ndarray):
    """`infos["final_obs"]`: (num_envs,) objects, the last observation of each episode that is over, None elsewhere.

    That is the form that Gymnasium's vector environments give it. Its wrappers that convert arrays (NumpyToTorch,
    JaxToNumpy and the like) ask every array for its numbers through DLPack, and objects have none, so that they fail
    over Gymnasium's own vector environments; this array answers with the observations stacked, zeros in place of None.
    """

    def __dlpack__(self, **arguments: Any) -> Any:
        """The observations, (num_envs, ...)."""
        shown = [one for one in self if one is not None]
        if not shown:
            return super().__dlpack__(**arguments)
        blank = np.zeros_like(shown[0])
        return np.stack([blank if one is None else one for one in self]).__dlpack__(**arguments)
