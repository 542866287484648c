"""Replays: small files that hold what was played, and play back equal to the bit.

```python
env = RecordReplay(gymnasium.make("AirHockey-v0"), "game.npz")
...  # play, any number of episodes
env.close()

for state in play_back("game.npz"):
    print(state["position"])
```

`python -m scripts.record_video game.npz --out game.mp4` makes a video of one.

A file is an .npz without pickles:

| array | what |
|---|---|
| `replay` | JSON: `format`, the package's `version`, the dynamics' `fingerprint`, the environment's `id` (or null), its `arguments`, and of every take the `seeds` that its reset was given (or null) |
| `starts` | (E,) int64: the number of actions that came before each take |
| `states`, `ends` | (E,) records: the table's state at the start of each take and at its end |
| `actions` | (T, 2) float32 target velocities or, with `continuous=False`, (T,) int8 directions |
| `others` | (T, 2) float32: what an opponent from outside did, as it saw it; (0, 2) with a scripted one |

A take is what was played on end: it begins with a reset, or where the state was set in the midst of an episode.

The fingerprint is a hash of a short rollout of the same game (task, table, rate, opponent and so on) from fixed
seeds with fixed actions. So changes of the package that leave this game what it was, a new task or a better opponent
of another name, say, leave its replays valid; and one that plays otherwise, be it for another version of the package
or for a machine that calculates differently, is refused. What such a rollout might miss shows at the end of a take.
"""  # noqa: E501

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, SupportsFloat

import gymnasium as gym
import numpy as np
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from airhockey_env.env import AirHockeyEnv
from airhockey_env.face import draw_row, make_renderer
from airhockey_env.files import replace
from airhockey_env.game import DIRECTIONS, REWARDS, Game
from airhockey_env.physics import FIELDS
from airhockey_env.records import AUTORESET_SAME_STEP, LEFT, PUCK, RIGHT
from airhockey_env.tables import TableSpec
from airhockey_env.tasks import TASKS
from airhockey_env.version import __version__

FORMAT = 1
"""Of the files."""

ROLLOUT_TABLES, ROLLOUT_STEPS, ROLLOUT_LIMIT = 16, 150, 60
"""The fingerprint's rollout: tables, steps on each, and steps that end an episode."""

ROLLOUT_FIELDS = ("position", "velocity", "stream", "clock", "side", "done", "score", "plan", "wander", "potential")


@dataclass(frozen=True)
class Replay:
    """What a file holds; see the module's description for the arrays."""

    version: str
    fingerprint: str
    id: str | None
    arguments: dict[str, Any]
    seeds: tuple[int | None, ...]
    starts: NDArray[np.int64]
    states: NDArray[np.void]
    ends: NDArray[np.void]
    actions: NDArray[Any]
    others: NDArray[np.float32]
    name: str = "the replay"
    """What errors call it."""

    def __len__(self) -> int:
        """Number of actions."""
        return len(self.actions)

    @property
    def control_hz(self) -> float:
        """Actions a second."""
        return float(self.arguments["control_hz"])

    @property
    def seconds(self) -> float:
        """Of play."""
        return len(self) / self.control_hz

    def save(self, path: str | Path) -> None:
        """Write an .npz file; a file that is there already is replaced at once or not at all."""
        notes = {"format": FORMAT, **{name: getattr(self, name) for name in _NOTES}}
        buffer = io.BytesIO()
        arrays: dict[str, Any] = {name: getattr(self, name) for name in _ARRAYS}
        np.savez_compressed(buffer, replay=np.array(json.dumps(notes)), **arrays)
        replace(path, lambda part: part.write_bytes(buffer.getvalue()))

    @classmethod
    def load(cls, path: str | Path) -> Replay:
        """Read a file that `save` wrote. Whether its dynamics are this version's is for `play_back` to say.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: the file does not hold a replay; the message names it.
        """
        try:
            with open(path, "rb") as stream, np.load(stream, allow_pickle=False) as file:
                notes = json.loads(str(file["replay"]))
                if notes["format"] != FORMAT:
                    raise ValueError(f"it is of format {notes['format']!r}, and this version reads format {FORMAT}")
                given = {**{name: notes[name] for name in _NOTES}, **{name: file[name] for name in _ARRAYS}}
            replay = cls(**{**given, "seeds": tuple(given["seeds"])}, name=str(path))
            replay._check()
        except OSError as error:
            if isinstance(error, FileNotFoundError):
                raise
            raise ValueError(f"{path} does not hold a replay: {error}") from error
        except Exception as error:  # whatever a damaged file makes of it
            raise ValueError(f"{path} does not hold a replay: {type(error).__name__}: {error}") from error
        return replay

    def _check(self) -> None:
        """Whether the arrays fit together; a ValueError (or worse) if not."""
        takes, steps = len(self.starts), len(self.actions)
        shapes = self.starts.shape == self.states.shape == self.ends.shape == (len(self.seeds),)
        if not shapes or not takes or self.starts.dtype != np.int64:
            raise ValueError("there must be a start, a state, an end and a seed (or null) of each take, and some takes")
        if self.starts[0] != 0 or (np.diff(self.starts) < 0).any() or self.starts[-1] > steps:
            raise ValueError(f"starts must rise from 0 to at most {steps}, got {self.starts}")
        if self.arguments["continuous"]:
            good = self.actions.dtype == np.float32 and self.actions.shape == (steps, 2)
            good = good and bool(np.isfinite(self.actions).all())
        else:
            good = self.actions.dtype == np.int8 and self.actions.ndim == 1
            good = good and bool(((self.actions >= 0) & (self.actions < len(DIRECTIONS))).all())
        others = steps if self.arguments["opponent"] is None else 0
        good = good and self.others.dtype == np.float32 and self.others.shape == (others, 2)
        if not good or not np.isfinite(self.others).all():
            raise ValueError("the actions are not those of the arguments")
        if not self.control_hz > 0.0:
            raise ValueError(f"control_hz must be greater than 0, got {self.control_hz}")


_NOTES = ("version", "fingerprint", "id", "arguments", "seeds")
_ARRAYS = ("starts", "states", "ends", "actions", "others")


def is_replay(path: str | Path) -> bool:
    """Whether a file looks like a replay (and not like a policy, say)."""
    try:
        with zipfile.ZipFile(path) as file:
            return "replay.npy" in file.namelist()
    except (OSError, zipfile.BadZipFile):
        return False


def play_back(replay: Replay | str | Path) -> Iterator[NDArray[np.void]]:
    """The states of a replay: (1,) records as `AirHockeyEnv.get_state` returns, at each take's start and every step.

    Args:
        replay: or the file that holds one.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file holds no replay; or the dynamics are not those that it was recorded with. The latter is
            told at once by the fingerprint or, at the latest, at the end of a take.
    """
    prepared, game = _prepared(replay)
    return (game.get_state() for _ in _played(prepared, game))


def play_back_frames(
    replay: Replay | str | Path, *, size: tuple[int, int] | None = None, fps: float | None = None
) -> Iterator[NDArray[np.uint8]]:
    """Pictures of a replay, (height, width, 3) uint8.

    Args:
        replay: or the file that holds one.
        size: (width, height) px, or None for the renderer's own.
        fps: pictures for a second of play, at most the control rate; None for one of every state.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: as `play_back` has it; or size or fps are out of range.
    """
    prepared, game = _prepared(replay)
    rate = prepared.control_hz
    if fps is not None and not 0.0 < fps <= rate:
        raise ValueError(f"fps must be greater than 0 and at most the replay's {rate:g} Hz, got {fps!r}")
    renderer = make_renderer(game.spec, size)

    def frames() -> Iterator[NDArray[np.uint8]]:
        shown, every = 0.0, 1.0 if fps is None else rate / fps
        for number, _ in enumerate(_played(prepared, game)):
            if number >= shown:
                yield draw_row(renderer, game, 0)
                shown += every

    return frames()


def _prepared(replay: Replay | str | Path) -> tuple[Replay, Game]:
    """A replay, and a game that plays as the one that was recorded."""
    if not isinstance(replay, Replay):
        replay = Replay.load(replay)
    try:
        game = _game_of(replay.arguments)
        now = fingerprint(replay.arguments)
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        raise ValueError(f"{replay.name} holds a game that this version does not have: {error}") from error
    if now != replay.fingerprint:
        raise ValueError(
            f"{replay.name} was recorded with other dynamics, by version {replay.version} of airhockey-env (or on a "
            f"machine that calculates differently), and would not play back the same in this version {__version__}"
        )
    dtype = game.get_state().dtype
    if replay.states.dtype != dtype or replay.ends.dtype != dtype:
        raise ValueError(f"{replay.name} holds states of another layout than those of this version {__version__}")
    return replay, game


def _played(replay: Replay, game: Game) -> Iterator[None]:
    """Bring the game to the replay's states, one after the other."""
    last = [*replay.starts[1:].tolist(), len(replay)]
    for take, (start, stop) in enumerate(zip(replay.starts.tolist(), last, strict=True)):
        game.set_state(replay.states[take : take + 1])
        yield
        for k in range(start, stop):
            action = replay.actions[k] if game.continuous else int(replay.actions[k])
            game.step(game.check_action(action), replay.others[k : k + 1] if len(replay.others) else None)
            yield
        if game.get_state().tobytes() != replay.ends[take].tobytes():
            raise ValueError(
                f"{replay.name} has not played back the same from step {start} to {stop}: it was recorded with other "
                f"dynamics, by version {replay.version} of airhockey-env, or is damaged"
            )


def arguments_of(game: Game) -> dict[str, Any]:
    """All that decides how a game on one table plays, ready for JSON; the opponent is None if it is from outside."""
    settings = game.settings[0]
    opponent = game.opponents[0] if game.opponents else None
    return {
        "task": next(name for name, task in TASKS.items() if task.number == settings["task"]),
        "opponent": opponent if isinstance(opponent, str) else None,
        "table": dataclasses.asdict(game.spec),
        "continuous": game.continuous,
        "reward": REWARDS[int(settings["shaped"])],
        "control_hz": game.control_hz,
        "randomize": {name: game.ranges[FIELDS.index(name)].tolist() for name in game.randomized} or None,
        "points": int(settings["points"]),
        "max_episode_steps": int(settings["max_steps"]) or None,
    }


def _game_of(arguments: dict[str, Any], num_tables: int = 1, **changes: Any) -> Game:
    """The game that `arguments_of` describes."""
    table = TableSpec(**arguments["table"])
    return Game(num_tables, **{**arguments, "table": table, "num_threads": 1, **changes})


def fingerprint(arguments: dict[str, Any]) -> str:
    """A hash of how a game plays: of a short rollout from fixed seeds with fixed actions, on a few tables.

    Raises:
        ValueError, TypeError: not arguments of a game.
    """
    n = ROLLOUT_TABLES
    changes = {"max_episode_steps": ROLLOUT_LIMIT, "autoreset": AUTORESET_SAME_STEP}
    game = _game_of(arguments, n, **changes)
    game.seed(list(range(n)))
    game.reset()
    chases = np.arange(n)[:, np.newaxis] % 2 == 0
    digest = hashlib.sha256()
    for step in range(ROLLOUT_STEPS):
        places = game.tables["position"]
        direction = DIRECTIONS[(step // 8 + np.arange(n)) % len(DIRECTIONS)]
        left = np.where(chases, 5.0 * (places[:, PUCK] - places[:, LEFT]), direction)
        right = np.where(chases, 5.0 * (places[:, RIGHT] - places[:, PUCK]), direction)
        others = right.astype(np.float32) if arguments["opponent"] is None else None
        game.step(left.astype(np.float32), others)
        for name in ROLLOUT_FIELDS:
            digest.update(game.tables[name].tobytes())
        digest.update(game.out.reward.tobytes())
    return digest.hexdigest()[:32]


class RecordReplay(gym.Wrapper, RecordConstructorArgs):
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
        super().__init__(env)
        if not isinstance(env.unwrapped, AirHockeyEnv):
            raise ValueError(f"env must be an AirHockeyEnv, got {env!r}")
        inner = env
        while isinstance(inner, gym.Wrapper):
            if isinstance(inner, gym.ActionWrapper):
                raise ValueError(f"RecordReplay must be put inside of {type(inner).__name__}, which changes actions")
            inner = inner.env
        self.path = Path(path)
        if self.path.suffix != ".npz":
            raise ValueError(f"path must end in .npz, got {self.path.name!r}")
        if not self.path.parent.is_dir():
            raise FileNotFoundError(f"path must lie in a folder that exists, got {self.path}")
        self._game = env.unwrapped._game
        self._seeds: list[int | None] = []
        self._starts: list[int] = []
        self._states: list[NDArray[np.void]] = []
        self._ends: list[NDArray[np.void]] = []
        self._actions: list[Any] = []
        self._others: list[NDArray[np.float32]] = []
        self._saved = -1

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode, and a take."""
        result = self.env.reset(seed=seed, options=options)
        self._begin(self._game.get_state(), seed)
        return result

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Play one control step.

        Raises:
            ValueError: of the environment; or a wrapper inside has played more than this step.
        """
        before = self._game.get_state()
        result = self.env.step(action)
        after = self._game.get_state()
        played = _steps_of(after) - _steps_of(before)
        if played != 1 and _steps_of(after) != 0:
            raise ValueError(f"RecordReplay must be put inside of wrappers that play {played} steps for one action")
        if played == 1:  # and not a reset by a wrapper, which the next step will notice
            if not self._ends or self._ends[-1].tobytes() != before.tobytes():
                self._begin(before, None)
            self._actions.append(np.array(action, np.float64).clip(-1.0, 1.0) if self._game.continuous else int(action))
            if self._answered:
                self._others.append(self._game.answers[0].copy())
            self._ends[-1] = after
        if (result[2] or result[3]) and len(self._actions) > 1.25 * self._saved:
            self.save()
        return result

    def replay(self) -> Replay:
        """What was recorded so far.

        Raises:
            ValueError: nothing was.
        """
        if not self._starts:
            raise ValueError("there is nothing to replay yet: reset first")
        arguments = arguments_of(self._game)
        shape = (-1, 2) if self._game.continuous else (-1,)
        return Replay(
            version=__version__,
            fingerprint=fingerprint(arguments),
            id=None if self.env.spec is None else self.env.spec.id,
            arguments=arguments,
            seeds=tuple(self._seeds),
            starts=np.array(self._starts, np.int64),
            states=np.concatenate(self._states),
            ends=np.concatenate(self._ends),
            actions=np.array(self._actions, np.float32 if self._game.continuous else np.int8).reshape(shape),
            others=np.array(self._others, np.float32).reshape(-1, 2),
        )

    def save(self) -> None:
        """Write the file.

        Raises:
            ValueError: nothing was recorded yet.
        """
        self.replay().save(self.path)
        self._saved = len(self._actions)

    def close(self) -> None:
        """Write the file, if there is anything to write that is not in it, and close the environment."""
        if self._starts and self._saved != len(self._actions):
            self.save()
        super().close()

    @property
    def _answered(self) -> bool:
        return callable(self._game.opponents[0])

    def _begin(self, state: NDArray[np.void], seed: int | None) -> None:
        """Begin a take, in place of the last one if nothing was played in that."""
        if self._starts and self._starts[-1] == len(self._actions):
            for takes in (self._seeds, self._starts, self._states, self._ends):
                del takes[-1]
        self._seeds.append(None if seed is None else int(seed))
        self._starts.append(len(self._actions))
        self._states.append(state)
        self._ends.append(state)


def _steps_of(state: NDArray[np.void]) -> int:
    return int((state["table"] if "table" in (state.dtype.names or ()) else state)["steps"][0])
