"""What the recording wrappers have in common: what was played on some tables, and the file that it is written to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, RIGHT
from airhockey_env.replay.dynamics import arguments_of, fingerprint
from airhockey_env.replay.file import Replay
from airhockey_env.saved_states import game_state, save
from airhockey_env.version import __version__


class TableRecording:
    """What was played on one table."""

    def __init__(self) -> None:
        self.seeds: list[int | None] = []
        self.starts: list[int] = []
        self.states: list[NDArray[np.void]] = []
        self.ends: list[NDArray[np.void]] = []
        self.actions: list[Any] = []
        self.right_actions: list[NDArray[np.float32]] = []

    def begin(self, state: NDArray[np.void], seed: int | None = None) -> None:
        """Begin a segment, in place of the last one if nothing was played in that."""
        if self.starts and self.starts[-1] == len(self.actions):
            for column in (self.seeds, self.starts, self.states, self.ends):
                del column[-1]
        self.seeds.append(seed)
        self.starts.append(len(self.actions))
        self.states.append(state)
        self.ends.append(state)

    def add(
        self, before: NDArray[np.void], action: Any, right_action: NDArray[np.float32] | None, after: NDArray[np.void]
    ) -> None:
        """Note a step; it begins a segment if its state is not where the last one led to."""
        if not self.ends or self.ends[-1].tobytes() != before.tobytes():
            self.begin(before)
        self.actions.append(action)
        if right_action is not None:
            self.right_actions.append(np.array(right_action, np.float32))
        self.ends[-1] = after


class Recorder:
    """The segments of some tables of a game, and the file."""

    path: Path

    def _record(self, game: Game, path: str | Path, tables: list[int], env_id: str | None = None) -> None:
        """Get ready.

        Raises:
            ValueError: another suffix.
            FileNotFoundError: there is no such folder.
        """
        self.path = Path(path)
        if self.path.suffix != ".npz":
            raise ValueError(f"path must end in .npz, got {self.path.name!r}")
        if not self.path.parent.is_dir():
            raise FileNotFoundError(f"path must lie in a folder that exists, got {self.path}")
        self._game = game
        self._id = env_id
        self._arguments = arguments_of(game, int(game.pools[RIGHT].indices[tables[0]]))  # of now: a pool may change
        self._recordings = {table: TableRecording() for table in tables}
        self._saved = -1

    def replay(self) -> Replay:
        """What was recorded so far.

        Raises:
            ValueError: nothing was.
        """
        played = [recording for recording in self._recordings.values() if recording.starts]
        if not played:
            raise ValueError("there is nothing to replay yet: reset first")
        before = np.cumsum([0, *(len(recording.actions) for recording in played)])
        continuous = self._arguments["continuous"]
        return Replay(
            version=__version__,
            fingerprint=fingerprint(self._arguments),
            id=self._id,
            arguments=self._arguments,
            seeds=tuple(seed for recording in played for seed in recording.seeds),
            starts=np.concatenate([np.array(t.starts, np.int64) + n for t, n in zip(played, before, strict=False)]),
            states=np.concatenate([state for recording in played for state in recording.states]),
            ends=np.concatenate([state for recording in played for state in recording.ends]),
            actions=np.array(
                [action for recording in played for action in recording.actions], np.float32 if continuous else np.int8
            ).reshape((-1, 2) if continuous else (-1,)),
            right_actions=np.array(
                [action for recording in played for action in recording.right_actions], np.float32
            ).reshape(-1, 2),
        )

    def save(self) -> None:
        """Write the file.

        Raises:
            ValueError: nothing was recorded yet.
        """
        self.replay().save(self.path)
        self._saved = self._steps()

    def _steps(self) -> int:
        return sum(len(recording.actions) for recording in self._recordings.values())

    def _save_now_and_then(self) -> None:
        """Write the file if a quarter more has been played than it holds."""
        if self._steps() > 1.25 * self._saved:
            self.save()

    def _save_the_rest(self) -> None:
        """Write the file, if there is anything to write that is not in it."""
        recordings: dict[int, TableRecording] = getattr(
            self, "_recordings", {}
        )  # Gymnasium 1.1 closes also a wrapper that was refused
        if any(recording.starts for recording in recordings.values()) and self._saved != self._steps():
            self.save()

    def _state(self, table: int) -> NDArray[np.void]:
        """The state of a table, (1,), as it would be in a game of its own."""
        game = self._game
        # What stands between the players and the table decides what they see, not what comes of their actions.
        state = save(np.array([table]), game.states, game.parameters, bool(game.randomized), None)
        game_state(state)["member"] = 0
        return state

    def _action(self, table: int, action: Any) -> Any:
        """What reached the left paddle of a table in the last step, as a replay holds it: the action, or a late one."""
        continuous = self._arguments["continuous"]
        return self._game.played_actions(LEFT)[table].clip(-1.0, 1.0) if continuous else int(action)

    def _right_action(self, table: int) -> NDArray[np.float32]:
        """The same of a right player whose actions are recorded."""
        return self._game.played_actions(RIGHT)[table]


def check_played(before: NDArray[np.void], after: NDArray[np.void], who: str) -> bool:
    """Whether a step led from one state to the other; if not, the table is new or as it was.

    Raises:
        ValueError: more than one step did.
    """
    played = steps_of(after) - steps_of(before)
    if played not in (0, 1) and steps_of(after) != 0:
        raise ValueError(f"{who} must be put inside of wrappers that play {played} steps for one action")
    return played == 1


def steps_of(state: NDArray[np.void]) -> int:
    """Steps of the episode so far."""
    return int(game_state(state)["steps"][0])
