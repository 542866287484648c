"""Recording through Gymnasium's environments: one table, or some tables of a batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, SupportsFloat

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from gymnasium.vector import AutoresetMode, VectorActionWrapper, VectorEnv, VectorWrapper
from numpy.typing import NDArray

from airhockey_env.checks import check_seeds
from airhockey_env.env import AirHockeyEnv
from airhockey_env.kernel.state import RIGHT
from airhockey_env.replay.dynamics import make_game, play_actions, recorded_name
from airhockey_env.replay.recorder import Recorder, check_played
from airhockey_env.vector_env import AirHockeyVectorEnv


class RecordReplay(Recorder, gym.Wrapper, RecordConstructorArgs):
    """Record everything that is played into a replay file.

    The file is written by `close` and by `save`. It is also rewritten at the end of an episode when the recording has
    grown by 25 %. Writes are atomic. The file holds all episodes since the wrapper was made.

    Put this wrapper inside wrappers that change actions or skip frames: it records the actions that it is given, and
    the environment must play exactly these. The actions of a policy as the opponent are recorded too, so the policy is
    not needed for playback.

    Args:
        env: an `AirHockeyEnv`, wrapped or not.
        path: the file, .npz.

    Raises:
        ValueError: another environment, another suffix, or a wrapper inside that changes actions.
        FileNotFoundError: there is no such folder.
    """

    def __init__(self, env: gym.Env, path: str | Path) -> None:
        RecordConstructorArgs.__init__(self, path=str(path))
        gym.Wrapper.__init__(self, env)
        if not isinstance(env.unwrapped, AirHockeyEnv):
            raise ValueError(f"env must be an AirHockeyEnv, got {env!r}")
        _check_actions(env, gym.ActionWrapper, "RecordReplay")
        self._record(env.unwrapped._game, path, [0], None if env.spec is None else env.spec.id)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and a segment."""
        result = self.env.reset(seed=seed, options=options)
        self._recordings[0].begin(self._state(0), None if seed is None else int(seed))
        return result

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Play one control step.

        Raises:
            ValueError: of the environment; or a wrapper inside has played more than this step.
        """
        before = self._state(0)
        result = self.env.step(action)
        after = self._state(0)
        if check_played(before, after, "RecordReplay"):  # and not a reset by a wrapper, which the next step will notice
            recorded = recorded_name(self._game.pools[RIGHT].members[0]) is None
            self._recordings[0].add(before, self._action(0, action), self._right_action(0) if recorded else None, after)
        if result[2] or result[3]:
            self._save_now_and_then()
        return result

    def close(self) -> None:
        """Write the file, if there is anything to write that is not in it, and close the environment."""
        self._save_the_rest()
        super().close()


class RecordVectorReplay(Recorder, VectorWrapper, RecordConstructorArgs):
    """Record what is played on some tables of a batch into one replay file, in any of the autoreset modes.

    The file is written when that of `RecordReplay` is, and the same rule holds for other wrappers. The tables play
    back one after the other: all segments of the first, then those of the next.

    Args:
        env: an `AirHockeyVectorEnv`, wrapped or not.
        path: the file, .npz.
        tables: numbers of the tables to record, each once. Either the same named opponent plays on all of them
            throughout, or policies do, which may differ and change.

    Raises:
        ValueError: another environment, another suffix, no such tables, different opponents on them, or a wrapper
            inside that changes actions.
        FileNotFoundError: there is no such folder.
    """

    def __init__(self, env: VectorEnv, path: str | Path, tables: Sequence[int] = (0,)) -> None:
        RecordConstructorArgs.__init__(self, path=str(path), tables=list(tables))
        VectorWrapper.__init__(self, env)
        batch = env.unwrapped
        if not isinstance(batch, AirHockeyVectorEnv):
            raise ValueError(f"env must be an AirHockeyVectorEnv, got {env!r}")
        _check_actions(env, VectorActionWrapper, "RecordVectorReplay")
        rows = batch._game.check_rows(list(tables), "tables").tolist()
        if not rows:
            raise ValueError(f"tables must be numbers of one table or more, got {tables!r}")
        self._batch = batch
        self._record(batch._game, path, rows, None if env.spec is None else env.spec.id)
        self._opponent = self._opponent_of(rows[0])
        self._check_opponents()
        self._alone = make_game(self._arguments)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and a segment, on every table, or on those of `options["reset_mask"]`."""
        result = self.env.reset(seed=seed, options=options)
        mask = options.get("reset_mask") if isinstance(options, Mapping) else None
        seeds = check_seeds(seed, self._game.num_tables)
        for i, recording in self._recordings.items():
            if mask is None or mask[i]:
                recording.begin(self._state(i), seeds[i])
        return result

    def step(
        self, actions: Any
    ) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Play one control step on every table.

        Raises:
            ValueError: of the environment; or another opponent plays on a recorded table now (nothing has changed
                then), or a wrapper inside has played more than this step.
        """
        self._check_opponents()
        before = {i: self._state(i) for i in self._recordings}
        result = self.env.step(actions)
        over = result[2] | result[3]
        for i, recording in self._recordings.items():
            after = self._state(i)
            action = self._action(i, actions[i])
            right_action = self._right_action(i) if self._opponent is None else None
            if over[i] and self._batch.autoreset_mode == AutoresetMode.SAME_STEP:
                # The end itself is gone: it is played once more.
                self._alone.set_state(before[i])
                play_actions(self._alone, action, right_action)
                recording.add(before[i], action, right_action, self._alone.get_state())
                recording.begin(after)
            elif check_played(before[i], after, "RecordVectorReplay"):
                recording.add(before[i], action, right_action, after)
            else:
                recording.begin(after)
        if any(over[i] for i in self._recordings):
            self._save_now_and_then()
        return result

    def close(self, **kwargs: Any) -> None:
        """Write the file, if there is anything to write that is not in it, and close the environment."""
        self._save_the_rest()
        super().close(**kwargs)

    def _opponent_of(self, table: int) -> str | None:
        """Who plays on a table: a scripted player's name, or None for one from outside."""
        pool = self._game.pools[RIGHT]
        return recorded_name(pool.members[pool.indices[table]])

    def _check_opponents(self) -> None:
        for i in self._recordings:
            opponent = self._opponent_of(i)
            if opponent != self._opponent:
                mine, its = (name or "an opponent from outside" for name in (self._opponent, opponent))
                raise ValueError(
                    f"tables must be those of one opponent, which is {mine}, and {its} plays on table {i}: record it "
                    "in a file of its own"
                )


def _check_actions(env: Any, kind: type, who: str) -> None:
    """A ValueError if a wrapper of this kind is between the recorder and the environment."""
    while env is not env.unwrapped:
        if isinstance(env, kind):
            raise ValueError(f"{who} must be put inside of {type(env).__name__}, which changes actions")
        env = env.env
