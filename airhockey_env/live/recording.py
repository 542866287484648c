"""What was played in a match, for a replay."""

from __future__ import annotations

import functools
import json
from array import array

import numpy as np
from numpy.typing import NDArray

from airhockey_env.game import Game
from airhockey_env.replay.dynamics import arguments_of, fingerprint
from airhockey_env.replay.file import Replay
from airhockey_env.saved_states import game_state
from airhockey_env.version import __version__

MOST_SECONDS = 1800.0
"""s of play that are kept: about 6 MB at 200 control steps a second."""


@functools.lru_cache(maxsize=64)
def _fingerprint(arguments: str) -> str:
    """The fingerprint of a game by its arguments, as JSON: it takes a rollout, and most matches are of few kinds."""
    return fingerprint(json.loads(arguments))


class Recording:
    """The actions on the one table of a game since it was reset.

    Args:
        game: of one table, whose left paddle takes the caller's actions.
    """

    def __init__(self, game: Game) -> None:
        self._game = game
        self._limit = round(MOST_SECONDS * game.control_hz)
        self.begin()

    def begin(self) -> None:
        """Forget everything: the game was reset."""
        self._start = self._end = game_state(self._game.get_state())
        self._left, self._right = array("f"), array("f")

    def add(self, left: NDArray[np.float32], right: NDArray[np.float32]) -> None:
        """Note the actions (2,), float32, of the step that was just played."""
        if len(self._left) < 2 * self._limit:
            self._left.frombytes(left.tobytes())
            self._right.frombytes(right.tobytes())
            if len(self._left) == 2 * self._limit:
                self._end = game_state(self._game.get_state())

    def replay(self) -> Replay:
        """What was played, as one segment."""
        arguments = arguments_of(self._game)
        full = len(self._left) == 2 * self._limit
        right = self._right if arguments["opponent"] is None else array("f")
        return Replay(
            version=__version__,
            fingerprint=_fingerprint(json.dumps(arguments, sort_keys=True)),
            id=None,
            arguments=arguments,
            seeds=(None,),
            starts=np.zeros(1, np.int64),
            states=self._start,
            ends=self._end if full else game_state(self._game.get_state()),
            actions=np.array(self._left, np.float32).reshape(-1, 2),
            right_actions=np.array(right, np.float32).reshape(-1, 2),
        )
