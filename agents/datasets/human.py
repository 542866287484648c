"""What people played: the points of matches whose replays the page in the browser has saved."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from agents.conditions import Conditions
from agents.datasets.episodes import Episode
from agents.datasets.replaying import begin_episode
from agents.datasets.settings import Setting
from airhockey_env.kernel.state import RIGHT
from airhockey_env.replay import Replay, play_back
from airhockey_env.saved_states import game_state
from airhockey_env.tables import TableSpec

_TASKS = {"match": "point"}
"""The task whose episodes a replay holds, where it is not the replay's own: a match consists of points."""


def setting_of(replays: Sequence[Replay]) -> Setting:
    """The environment in which all of these were played.

    Raises:
        ValueError: an environment cannot repeat one of them, or they were not all played in the same.
    """
    settings = [_setting_of(replay) for replay in replays]
    for replay, setting in zip(replays, settings, strict=True):
        if setting != settings[0]:
            raise ValueError(f"{replay.name} was played in another environment than {replays[0].name}")
    return settings[0]


def _setting_of(replay: Replay) -> Setting:
    arguments = replay.arguments
    if arguments["opponent"] is None:
        raise ValueError(
            f"{replay.name} has an opponent whose actions were recorded, as those of trained ones are in a live match; "
            "an environment can repeat those of scripted opponents only"
        )
    if not arguments["continuous"]:
        raise ValueError(f"{replay.name} has discrete actions, and a data set's are continuous")
    ranges = arguments["randomize"]
    return Setting(
        _TASKS.get(arguments["task"], arguments["task"]),
        arguments["opponent"],
        Conditions(TableSpec(**arguments["table"]), ranges and {name: tuple(pair) for name, pair in ranges.items()}),
        control_hz=replay.control_hz,
        opponent_skill=float(game_state(replay.states)["skill"][0, RIGHT]),
    )


def load_replays(option: str, paths: Sequence[Path]) -> list[Replay]:
    """Read replays.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: one holds no replay. The message names the file.
    """
    for path in paths:
        if not path.is_file():
            raise FileNotFoundError(f"{option} must name files that exist, got {path}")
    return [Replay.load(path) for path in paths]


def replayed_episodes(replays: Sequence[Replay], setting: Setting) -> Iterator[Episode]:
    """The complete episodes in replays, played once more in the environment; what was broken off is left out.

    Raises:
        ValueError: a replay does not play back to the bit, or no episode is complete.
    """
    env = gymnasium.make(setting.spec)
    complete = 0
    for replay in replays:
        for state, actions in _stretches(replay):
            episode = _play(env, state, actions)
            if episode is not None:
                complete += 1
                yield episode
    env.close()
    if not complete:
        raise ValueError(f"no point was played to its end in {', '.join(replay.name for replay in replays)}")


def _stretches(replay: Replay) -> Iterator[tuple[NDArray[np.void], NDArray[np.float32]]]:
    """The states (1,) at the beginnings of episodes, with the actions (T, 2) from there to the end of the segment."""
    states = play_back(replay)
    ends = [*replay.starts[1:].tolist(), len(replay)]
    for start, stop in zip(replay.starts.tolist(), ends, strict=True):
        score: list[int] = []
        for k in range(start, stop + 1):
            state = next(states)
            before, score = score, game_state(state)["score"][0].tolist()
            if score != before and k < stop:
                yield _fresh(state), replay.actions[k:stop]
    next(states, None)  # compares the end of the last segment


def _fresh(state: NDArray[np.void]) -> NDArray[np.void]:
    """A state of a match as one at the beginning of a point."""
    fresh = state.copy()
    table = game_state(fresh)
    table["score"], table["steps"] = 0, 0
    return fresh


def _play(env: gymnasium.Env, state: NDArray[np.void], actions: NDArray[np.float32]) -> Episode | None:
    observations = [begin_episode(env, {"state": np.frombuffer(state.tobytes(), np.uint8)})]
    rewards: list[float] = []
    terminated = truncated = False
    for action in actions:
        result: Any = env.step(action)
        observation, reward, terminated, truncated, _ = result
        observations.append(observation)
        rewards.append(reward)
        if terminated or truncated:
            break
    if not (terminated or truncated):
        return None
    return Episode(
        np.array(observations), actions[: len(rewards)].clip(-1.0, 1.0), np.array(rewards), terminated, state=state
    )
