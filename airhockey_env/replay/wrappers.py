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

from airhockey_env.env import AirHockeyEnv
from airhockey_env.replay.dynamics import game_of, play, recorded_name
from airhockey_env.replay.takes import Recorder, check_played
from airhockey_env.vector_env import AirHockeyVectorEnv


class RecordReplay(Recorder, gym.Wrapper, RecordConstructorArgs):
    """Record everything that is played into a replay file.

    The file is written by `close` and by `save`, and at the end of an episode once a quarter more has been played
    than it holds; it is replaced at once or not at all. It has all episodes since the wrapper was made.

    Put it inside of wrappers that change actions, skip frames or the like: it records the actions that it is given,
    and the environment has to play these. An opponent from outside need not be there for the playback: its actions
    are recorded too.

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
        """Begin an episode, and a take."""
        result = self.env.reset(seed=seed, options=options)
        self._takes[0].begin(self._state(0), None if seed is None else int(seed))
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
            other = self._game.answers[0] if recorded_name(self._game.opponents[0]) is None else None
            self._takes[0].add(before, self._action(action), other, after)
        if result[2] or result[3]:
            self._save_now_and_then()
        return result

    def close(self) -> None:
        """Write the file, if there is anything to write that is not in it, and close the environment."""
        self._save_the_rest()
        super().close()


class RecordVectorReplay(Recorder, VectorWrapper, RecordConstructorArgs):
    """Record what is played on some tables of a batch into one replay file, in any of the autoreset modes.

    Written, and to be put around the environment, as `RecordReplay` has it. The tables play back as tables of their
    own: all takes of the first, then those of the next.

    Args:
        env: an `AirHockeyVectorEnv`, wrapped or not.
        path: the file, .npz.
        tables: numbers of the tables to record, each once. One scripted opponent must play on all of them, as long as
            the recording goes on; or opponents from outside, each of which may be another and change.

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
        self._alone = game_of(self._arguments)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and a take, on every table, or on those of `options["reset_mask"]`."""
        result = self.env.reset(seed=seed, options=options)
        mask = options.get("reset_mask") if isinstance(options, Mapping) else None
        seeds = self._batch._check_seeds(seed)
        for i, takes in self._takes.items():
            if mask is None or mask[i]:
                takes.begin(self._state(i), seeds[i])
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
        before = {i: self._state(i) for i in self._takes}
        result = self.env.step(actions)
        over = result[2] | result[3]
        for i, takes in self._takes.items():
            after = self._state(i)
            action = self._action(actions[i])
            other = self._game.answers[i] if self._opponent is None else None
            if over[i] and self._batch.autoreset_mode == AutoresetMode.SAME_STEP:
                # The end itself is gone: it is played once more.
                self._alone.set_state(before[i])
                play(self._alone, action, other)
                takes.add(before[i], action, other, self._alone.get_state())
                takes.begin(after)
            elif check_played(before[i], after, "RecordVectorReplay"):
                takes.add(before[i], action, other, after)
            else:
                takes.begin(after)
        if any(over[i] for i in self._takes):
            self._save_now_and_then()
        return result

    def close(self, **kwargs: Any) -> None:
        """Write the file, if there is anything to write that is not in it, and close the environment."""
        self._save_the_rest()
        super().close(**kwargs)

    def _opponent_of(self, table: int) -> str | None:
        """Who plays on a table: a scripted player's name, or None for one from outside."""
        return recorded_name(self._game.opponents[self._game.tables["opponent"][table]])

    def _check_opponents(self) -> None:
        for i in self._takes:
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
