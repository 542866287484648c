"""A run's folder, runs/NAME/: its files, and what is noted while it trains."""

from __future__ import annotations

import contextlib
import datetime
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import KVWriter, Logger, configure

from agents.files import COUNT, NUMBER, POSITIVE, SHARE, TEXT, or_none, write_json
from agents.learning import ProgressBar
from agents.models import export_policy
from airhockey_env.files import replace
from airhockey_env.records import OBSERVATION_SIZE

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


class RunFolder:
    """The files of one run."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.config = path / "config.json"
        self.model = path / "model.zip"
        self.policy = path / "policy.npz"
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
        if name is not None and (not name or Path(name).name != name):
            raise ValueError(f"--name must be a folder's name, got {name!r}")
        path = Path("runs") / (name or f"{algorithm}-{datetime.datetime.now():%Y%m%d-%H%M%S}")
        if (path / "config.json").exists():
            raise FileExistsError(f"{path} holds a run already: choose another --name, or go on with --resume {path}")
        path.mkdir(parents=True, exist_ok=True)
        return cls(path)

    @classmethod
    def open(cls, name: str) -> RunFolder:
        """The folder of a run that exists, by its path or its name under runs/.

        Raises:
            FileNotFoundError: there is no such run.
        """
        for path in (Path(name), Path("runs") / name):
            if (path / "config.json").exists() and (path / "model.zip").exists():
                return cls(path)
        raise FileNotFoundError(f"a run must be a folder with config.json and model.zip, got {name!r}")


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


def save(folder: RunFolder, model: BaseAlgorithm, history: dict[str, Any]) -> None:
    """Write the model, its policy (of states alone) and the record of the run, each at once or not at all."""
    replace(folder.model, lambda part: _save_zip(model, part))
    if model.observation_space.shape == (OBSERVATION_SIZE,):
        export_policy(model).save(folder.policy)
    write_json(folder.evaluations, history)


def _save_zip(model: BaseAlgorithm, path: Path) -> None:
    with open(path, "wb") as file:  # a path would get a suffix of its own
        model.save(file)


@contextlib.contextmanager
def until_ctrl_c(bar: ProgressBar, stopped: str) -> Iterator[None]:
    """Let Ctrl-C end what is within, and nothing else; `stopped` is printed then."""
    try:
        yield
    except KeyboardInterrupt:
        bar.close()  # or it would go on drawing over the report
        print(f"\n{stopped}")


def logger(folder: RunFolder, records: Records) -> Logger:
    logger = configure(str(folder.path / "tensorboard"), ["tensorboard"])
    logger.output_formats.append(records)
    return logger
