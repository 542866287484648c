"""The folder of a run, runs/NAME/: its files, its name and its lock."""

from __future__ import annotations

import contextlib
import datetime
import itertools
import os
import platform
import re
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import IO

NAME = re.compile(r"\w[\w.+=@-]*")

MOST_NAME_BYTES = 200
"""Most file systems allow 255 bytes in UTF-8."""

DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{port}{number}" for port in ("COM", "LPT") for number in range(10))}
"""Names of devices on Windows, whatever their suffix."""


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
        """Make a new folder. Without a name, it is named after the algorithm and the time.

        Raises:
            FileExistsError: the folder contains a run already.
            ValueError: a folder cannot have this name.
        """
        if name is not None:
            path = Path("runs") / check_name(name)
            path.mkdir(parents=True, exist_ok=True)
        else:
            stem = f"{algorithm}-{datetime.datetime.now():%Y%m%d-%H%M%S}"
            for number in itertools.count(1):  # several runs may begin in the same second
                path = Path("runs") / (stem if number == 1 else f"{stem}-{number}")
                with contextlib.suppress(FileExistsError):
                    path.mkdir(parents=True)
                    break
        folder = cls(path)
        folder._check_new()
        return folder

    def files(self) -> str:
        """The folder and its files, for the last line that a command prints."""
        named = [self.model, self.policy, self.evaluations, self.picture, self.video]
        there = [path.name for path in named if path.exists()]
        return f"{self.path}: {', '.join(there)} and TensorBoard logs"

    def owner(self) -> str:
        """The process that is training in the folder, or the last one that did, as `locked` names it; "" for none."""
        try:
            return (self.path / ".lock").read_text(encoding="utf-8").strip()
        except FileNotFoundError:
            return ""

    def _check_new(self) -> None:
        if self.config.exists():
            raise FileExistsError(
                f"{self.path} contains a run already: choose another --name, or continue it by --resume {self.path}"
            )

    @classmethod
    def open(cls, name: str, option: str = "RUN") -> RunFolder:
        """Find the folder of an existing run, by its path or its name under runs/.

        Args:
            option: the name of the argument in the error.

        Raises:
            FileNotFoundError: there is no such run.
        """
        for path in (Path(name), Path("runs") / name) if name else ():
            with contextlib.suppress(OSError, ValueError):  # raised for names that no file can have
                if (path / "config.json").is_file() and (path / "model.zip").is_file():
                    return cls(path)
        raise FileNotFoundError(f"{option} must be a run's folder, with config.json and model.zip, got {name!r}")

    @contextlib.contextmanager
    def locked(self, new: bool = False) -> Iterator[None]:
        """Prevent other processes from training in this folder. The lock ends with the process, however that ends.

        On NFS, the lock works between machines if the server supports locks, as NFSv4 does. Where files cannot be
        locked, there is a warning and no lock.

        Args:
            new: whether the folder must not contain a run yet.

        Raises:
            BlockingIOError: another process is training in the folder.
            FileExistsError: the folder is to be new and contains a run.
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


def check_name(name: str) -> str:
    """Return the name if a folder can have it on every operating system.

    Raises:
        ValueError: it cannot. The message names `--name`.
    """
    device = name.split(".")[0].upper() in DEVICES
    if not NAME.fullmatch(name) or name.endswith(".") or device or len(os.fsencode(name)) > MOST_NAME_BYTES:
        raise ValueError(
            "--name must be a folder's name: a letter, a digit or _, then these or . - + = @, at most "
            f"{MOST_NAME_BYTES} bytes, and not a device of Windows; got {name!r}"
        )
    return name


def lock(file: IO[str]) -> None:
    """Lock an open file until it is closed, without waiting.

    Raises:
        BlockingIOError, PermissionError: another process has locked it.
        OSError: files cannot be locked here.
    """
    if sys.platform == "win32":
        import msvcrt

        file.seek(2**30)  # a byte far behind the text, so that others can read that
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
