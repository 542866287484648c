"""Recording through PettingZoo: two players at one table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from airhockey_env.parallel_env import AirHockeyParallelEnv  # first: it says what to install
from airhockey_env.replay.recorder import Recorder, check_played

from pettingzoo.utils import BaseParallelWrapper  # isort: skip


class RecordParallelReplay(Recorder, BaseParallelWrapper[str, Any, Any]):
    """Record everything that is played into a replay file, as `RecordReplay` does, with the actions of both players.

    Args:
        env: an `AirHockeyParallelEnv`; other wrappers go around the recording.
        path: the file, .npz.

    Raises:
        ValueError: another environment, or another suffix.
        FileNotFoundError: there is no such folder.
    """

    def __init__(self, env: AirHockeyParallelEnv, path: str | Path) -> None:
        if not isinstance(env, AirHockeyParallelEnv):
            raise ValueError(f"env must be an AirHockeyParallelEnv itself, got {env!r}")
        BaseParallelWrapper.__init__(self, env)
        self._record(env._game, path, [0])

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begin an episode, and a segment."""
        result = self.env.reset(seed=seed, options=options)
        self._recordings[0].begin(self._state(0), None if seed is None else int(seed))
        return result

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Play one control step."""
        before = self._state(0)
        result = self.env.step(actions)
        after = self._state(0)
        if check_played(before, after, "RecordParallelReplay"):  # and not step({}) after the end
            self._recordings[0].add(before, self._action(0, actions["left"]), self._right_action(0), after)
            if not self.env.agents:
                self._save_now_and_then()
        return result

    def close(self) -> None:
        """Write the file, if there is anything to write that is not in it, and close the environment."""
        self._save_the_rest()
        super().close()
