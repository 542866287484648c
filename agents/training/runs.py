"""A run's folder, runs/NAME/: its files, and what is noted while it trains."""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import itertools
import os
import platform
import re
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import KVWriter, Logger, configure
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from agents.files import (
    COUNT,
    NUMBER,
    POSITIVE,
    SHARE,
    TEXT,
    Args,
    or_none,
    read_arguments,
    read_json,
    replace_together,
    write_json,
)
from agents.models import export_policy
from agents.sb3_files import load_weights
from airhockey_env.files import read_arrays
from airhockey_env.kernel.state import OBSERVATION_SIZE

EVALUATION = {
    "steps": COUNT,
    "seconds": NUMBER,
    "opponent": TEXT,
    **dict.fromkeys(("wins", "losses", "draws"), COUNT),
    "points": POSITIVE,
    **dict.fromkeys(("win_rate", "decided_win_rate"), or_none(SHARE)),
    **dict.fromkeys(("win_rate_95", "decided_win_rate_95"), (SHARE, SHARE)),
}
"""What a file of records has of every evaluation, for `read_json`."""

HISTORY = {
    "practice": or_none(COUNT),
    "evaluations": [EVALUATION],
    "updates": [{"steps": COUNT, "seconds": NUMBER}],
    "report": [{}],
}
"""What the file of records of a run of `train_ppo` has."""
fcntl: Any
msvcrt: Any
try:
    import fcntl
except ImportError:  # Windows
    fcntl = None
try:
    import msvcrt
except ImportError:  # everywhere else
    msvcrt = None

NAME = re.compile(r"\w[\w.+=@-]*")

MOST_NAME_BYTES = 200
"""Most file systems take 255, of UTF-8."""

DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{number}" for port in ("COM", "LPT") for number in range(10))}
"""What Windows takes for devices, with any suffix."""


class RunFolder:
    """The files of one run."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.config = path / "config.json"
        self.model = path / "model.zip"
        self.policy = path / "policy.npz"
        self.buffer = path / "replay_buffer.npz"
        self.evaluations = path / "evaluations.json"
        self.picture = path / "training.png"
        self.video = path / "video.gif"

    @classmethod
    def create(cls, name: str | None, algorithm: str = "ppo") -> RunFolder:
        """A new folder; without a name, that of the algorithm and the time.

        Raises:
            FileExistsError: there is a run of that name.
            ValueError: the name is none that a folder can have.
        """
        if name is not None:
            path = Path("runs") / check_name(name)
            path.mkdir(parents=True, exist_ok=True)
        else:
            stem = f"{algorithm}-{datetime.datetime.now():%Y%m%d-%H%M%S}"
            for number in itertools.count(1):  # runs may begin in the same second
                path = Path("runs") / (stem if number == 1 else f"{stem}-{number}")
                with contextlib.suppress(FileExistsError):
                    path.mkdir(parents=True)
                    break
        folder = cls(path)
        folder._check_new()
        return folder

    def files(self) -> str:
        """The folder and what a user finds in it, for a command's last line."""
        named = [self.model, self.policy, self.evaluations, self.picture, self.video]
        there = [path.name for path in named if path.exists()]
        return f"{self.path}: {', '.join(there)} and TensorBoard logs"

    def _check_new(self) -> None:
        if self.config.exists():
            raise FileExistsError(
                f"{self.path} holds a run already: choose another --name, or go on with --resume {self.path}"
            )

    @classmethod
    def open(cls, name: str, option: str = "RUN") -> RunFolder:
        """The folder of a run that exists, by its path or its name under runs/.

        Args:
            option: what the error about one that is none calls the argument.

        Raises:
            FileNotFoundError: there is no such run.
        """
        for path in (Path(name), Path("runs") / name) if name else ():
            with contextlib.suppress(OSError, ValueError):  # of names that no file can have
                if (path / "config.json").is_file() and (path / "model.zip").is_file():
                    return cls(path)
        raise FileNotFoundError(f"{option} must be a run's folder, with config.json and model.zip, got {name!r}")

    @contextlib.contextmanager
    def locked(self, new: bool = False) -> Iterator[None]:
        """Keep other processes from training in this folder. The lock ends with the process, however that ends.

        On NFS it holds between machines where the server locks files (NFSv4 does); where nothing can be locked, there
        is a warning and no lock.

        Args:
            new: the folder must not hold a run yet.

        Raises:
            BlockingIOError: another process trains in it.
            FileExistsError: it holds a run.
        """
        with open(self.path / ".lock", "a+") as file:
            try:
                lock(file)
            except (BlockingIOError, PermissionError) as error:
                file.seek(0)
                whose = file.read(200).strip() or "another process"
                raise BlockingIOError(f"{self.path} is being trained by {whose}: wait for it, or stop it") from error
            except OSError as error:
                warnings.warn(f"{self.path} cannot be locked ({error}): let no second process resume it", stacklevel=3)
            file.truncate(0)
            file.write(f"process {os.getpid()} on {platform.node()}")
            file.flush()
            if new:
                self._check_new()
            yield


def read_config(folder: RunFolder, kind: type[Args], command: str, beside: Sequence[str] = (), **changed: Any) -> Args:
    """The arguments that a run was begun with, checked.

    Args:
        kind: of arguments, a dataclass.
        command: whose run it must be.
        beside: what else stands in the file.
        changed: fields with other values.

    Raises:
        ValueError: it is a run of another command, or damaged.
    """
    whose = read_json(folder.config, {}).get("command", command)
    if whose != command:
        raise ValueError(f"{folder.path} is a run of scripts.{whose}, which can resume it, not of scripts.{command}")
    kept: Any = read_arguments(folder.config, kind, ("command", *beside))
    return dataclasses.replace(kept, **changed)


def check_name(name: str) -> str:
    """A name for a run's folder, if it can be one on every system.

    Raises:
        ValueError: it cannot; the message names `--name`.
    """
    device = name.split(".")[0].upper() in DEVICES
    if not NAME.fullmatch(name) or name.endswith(".") or device or len(os.fsencode(name)) > MOST_NAME_BYTES:
        raise ValueError(
            "--name must be a folder's name: letters, digits and _ at first, then also . - + = @; up to "
            f"{MOST_NAME_BYTES} bytes, and no device of Windows; got {name!r}"
        )
    return name


def lock(file: IO[str]) -> None:
    """Lock an open file, for as long as it is open, or fail at once.

    Raises:
        BlockingIOError, PermissionError: another process has locked it.
        OSError: files cannot be locked here.
    """
    if fcntl is not None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    elif msvcrt is not None:
        file.seek(2**30)  # a byte far behind the text, which others may read
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)


def take_up(folder: RunFolder, pattern: dict[str, Any], model: BaseAlgorithm, asked: int | None) -> dict[str, Any]:
    """Load what a run has learned into a freshly built model; returns the run's records.

    Args:
        pattern: what its file of records has, for `read_json`.
        asked: the steps in all that the command line asks for.

    Raises:
        OSError, ValueError: a file is missing or damaged, or the run has more steps than asked for already.
    """
    history = read_json(folder.evaluations, pattern)
    load_weights(model, folder.model)
    rollout = model.n_envs * getattr(model, "n_steps", 1)  # off-policy algorithms collect a step at a time
    if asked is not None and model.num_timesteps >= asked + rollout:
        raise ValueError(f"the run has {model.num_timesteps:,} steps: --steps must be more, got {asked:,}")
    return {name: history[name] for name in pattern}


def where_it_stands(done: int, steps: int) -> str:
    """How much of a run is left, for its first line: empty for a new one."""
    if done == 0:
        return ""
    return f" It goes on at {done:,}." if done < steps else f" It has {done:,} already: nothing is left to train."


class Records(KVWriter):
    """Keeps what Stable-Baselines3 logs after every update."""

    def __init__(self, rows: list[dict[str, float]], clock: Clock) -> None:
        self.rows = rows
        self.clock = clock

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, Any], step: int = 0) -> None:
        names = {
            "rollout/ep_len_mean": "episode_length",
            "rollout/ep_rew_mean": "episode_reward",
            "train/entropy_loss": "entropy",
            "train/approx_kl": "kl",
            "train/explained_variance": "explained_variance",
            "time/fps": "fps",
        }
        row = {names[key]: float(value) for key, value in key_values.items() if key in names}
        if "entropy" in row:
            row["entropy"] = -row["entropy"]
        self.rows.append({"steps": step, "seconds": self.clock.seconds, **row})

    def close(self) -> None:
        """Nothing is held open."""


class Clock:
    """Wall time of training, over all sessions of a run."""

    def __init__(self, before: float) -> None:
        self.before = before
        self.start = time.perf_counter()

    @property
    def seconds(self) -> float:
        return self.before + time.perf_counter() - self.start


def save(
    folder: RunFolder, model: BaseAlgorithm, history: dict[str, Any], more: Callable[[], object] = lambda: None
) -> None:
    """Write the model, its policy (of states alone), the replay buffer if it has one, and the record of the run.

    They are written beside the old ones, which they replace when all of them are complete.

    Args:
        more: writes what else belongs to the run, at first.

    Raises:
        OSError: they cannot be written; the message says that the old ones are whole.
    """
    writes: dict[Path, Callable[[Path], object]] = {folder.model: lambda part: _save_zip(model, part)}
    if model.observation_space.shape == (OBSERVATION_SIZE,):
        writes[folder.policy] = export_policy(model).save
    if isinstance(model, OffPolicyAlgorithm) and model.replay_buffer is not None:
        writes[folder.buffer] = lambda part: save_buffer(model.replay_buffer, part)
    writes[folder.evaluations] = lambda part: write_json(part, history)
    try:
        more()
        replace_together(writes)
    except OSError as error:
        raise OSError(f"{folder.path} could not be saved, its last checkpoint is whole: {error}") from error


def _save_zip(model: BaseAlgorithm, path: Path) -> None:
    with open(path, "wb") as file:  # a path would get a suffix of its own
        model.save(file)


BUFFER_ARRAYS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def save_buffer(buffer: Any, path: Path) -> None:
    """Write a `ReplayBuffer` as plain arrays: of (steps, tables, ...), those that hold something."""
    arrays = {name: getattr(buffer, name)[: buffer.size()] for name in BUFFER_ARRAYS if hasattr(buffer, name)}
    with open(path, "wb") as file:
        np.savez(file, position=buffer.pos, full=buffer.full, **arrays)


def load_buffer(buffer: Any, path: Path) -> None:
    """Fill a `ReplayBuffer` with what `save_buffer` wrote.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is damaged, or of a buffer of another shape.
    """
    names = [name for name in BUFFER_ARRAYS if hasattr(buffer, name)]
    try:
        most = sum(getattr(buffer, name).nbytes for name in names) + 2**14  # and their headers
        kept = read_arrays(path, "a training run", ("position", "full", *names), most)
        position, full = int(kept["position"]), bool(kept["full"])
        size = buffer.buffer_size if full else position
        if not 0 <= position < buffer.buffer_size:
            raise ValueError(f"position must be below {buffer.buffer_size}, got {position}")
        for name in names:
            own, saved = getattr(buffer, name), kept[name]
            if saved.shape != (size, *own.shape[1:]) or saved.dtype != own.dtype:
                wanted = (size, *own.shape[1:])
                raise ValueError(f"{name} must be {wanted} of {own.dtype}, got {saved.shape} of {saved.dtype}")
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path} does not hold this run's replay buffer: {error}") from error
    for name in names:
        getattr(buffer, name)[:size] = kept[name]
    buffer.pos, buffer.full = position, full


def logger(folder: RunFolder, records: Records) -> Logger:
    logger = configure(str(folder.path / "tensorboard"), ["tensorboard"])
    logger.output_formats.append(records)
    return logger
