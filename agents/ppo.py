"""The PPO baseline: Stable-Baselines3's PPO over the native batch, its run folder and its report."""

from __future__ import annotations

import dataclasses
import datetime
import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList, ProgressBarCallback
from stable_baselines3.common.logger import KVWriter, Logger, configure
from stable_baselines3.common.vec_env import VecMonitor

from agents.checks import check_ranges
from agents.evaluation import MAX_EPISODE_STEPS, OPPONENTS, play_points
from agents.features import RelativeFeatures
from agents.files import read_json, write_json
from agents.models import export_policy, load_ppo
from airhockey_env.files import replace
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from airhockey_env.tables import PRESETS

DEFAULT_STEPS = 30_000_000


@dataclass(frozen=True)
class TrainArgs:
    """Train an agent with PPO. Everything goes into one folder, runs/NAME/."""

    name: str | None = None
    """Name of the run's folder under runs/. Default: ppo- and the time."""
    resume: str | None = None
    """Go on with this run (its folder, or its name under runs/), with its own arguments, to --steps in all."""
    steps: int | None = None
    """Environment steps in all. Default: 30 million, or with --resume what the run was to have."""
    seed: int = 0
    """Of the network, the actions and the tables."""
    opponents: tuple[str, ...] = ("striker",)
    """Whom to play against while training, on as many tables each; name one twice to meet it twice as often."""
    opponent: str = "striker"
    """Whom evaluations while training are against."""
    reward: str = "shaped"
    """"sparse" or "shaped"."""
    table: str = "full_size"
    """A table preset."""
    num_envs: int = 512
    """Tables."""
    n_steps: int = 32
    """Steps on each table between updates."""
    batch_size: int = 2048
    """Samples of a gradient step."""
    n_epochs: int = 4
    """Passes over the samples of an update."""
    learning_rate: float = 7e-4
    """At the start; falls linearly to a tenth of it."""
    gamma: float = 0.99
    """Discount of a step."""
    gae_lambda: float = 0.95
    """Of generalised advantage estimation."""
    clip_range: float = 0.2
    """Of PPO's surrogate objective."""
    ent_coef: float = 0.0
    """Weight of the entropy bonus."""
    net_width: int = 64
    """Units in each of the two hidden layers, of policy and value network alike."""
    eval_every: int = 2_000_000
    """Steps between evaluations, each with a checkpoint."""
    eval_points: int = 400
    """Points of an evaluation against the training opponent."""
    report_points: int = 2000
    """Points against each scripted opponent for the report at the end."""
    threads: int = 1
    """Of torch. The network is small: a second thread gains nothing, and waits where other programs run."""
    video_seconds: float = 20.0
    """Length of the video of the trained agent; 0 for none."""


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
    def create(cls, name: str | None) -> RunFolder:
        """A new folder.

        Raises:
            FileExistsError: there is a run of that name.
            ValueError: the name is none that a folder can have.
        """
        if name is not None and (not name or Path(name).name != name):
            raise ValueError(f"--name must be a folder's name, got {name!r}")
        path = Path("runs") / (name or f"ppo-{datetime.datetime.now():%Y%m%d-%H%M%S}")
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
        raise FileNotFoundError(f"--resume must name a run's folder with config.json and model.zip, got {name!r}")


class _Records(KVWriter):
    """Keeps what Stable-Baselines3 logs after every update."""

    def __init__(self, rows: list[dict[str, float]], clock: _Clock) -> None:
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


class _Clock:
    """Wall time of training, over all sessions of a run."""

    def __init__(self, before: float) -> None:
        self.before = before
        self.start = time.perf_counter()

    @property
    def seconds(self) -> float:
        return self.before + time.perf_counter() - self.start


class _Watch(BaseCallback):
    """Evaluates and saves while training."""

    def __init__(self, folder: RunFolder, args: TrainArgs, history: dict[str, Any], clock: _Clock) -> None:
        super().__init__()
        self.folder = folder
        self.args = args
        self.history = history
        self.clock = clock
        self.due = (history["evaluations"][-1]["steps"] if history["evaluations"] else 0) + args.eval_every

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self.due:
            self.due = self.num_timesteps + self.args.eval_every
            self.evaluate()

    def evaluate(self) -> None:
        """Play against the training opponent at full skill, and save everything."""
        result = play_points(
            export_policy(self.model), self.args.opponent, self.args.eval_points, seed=1, table=self.args.table
        )
        row = {"steps": self.num_timesteps, "seconds": self.clock.seconds, **result.as_dict()}
        self.history["evaluations"].append(row)
        for name in ("win_rate", "decided_win_rate", "mean_seconds"):
            self.logger.record(f"eval/{name}", row[name])
        self.logger.record("eval/draw_rate", row["draws"] / row["points"])
        save(self.folder, self.model, self.history)


def save(folder: RunFolder, model: BaseAlgorithm, history: dict[str, Any]) -> None:
    """Write the model, its policy and the record of the run, each at once or not at all."""
    replace(folder.model, lambda part: _save_zip(model, part))
    export_policy(model).save(folder.policy)
    write_json(folder.evaluations, history)


def _save_zip(model: BaseAlgorithm, path: Path) -> None:
    with open(path, "wb") as file:  # a path would get a suffix of its own
        model.save(file)


def make_env(args: TrainArgs) -> VecMonitor:
    """The tables to train on."""
    return VecMonitor(
        AirHockeySB3VecEnv(
            args.num_envs,
            opponent=args.opponents,
            reward=args.reward,
            table=args.table,
            max_episode_steps=MAX_EPISODE_STEPS,
        )
    )


def make_model(args: TrainArgs, env: VecMonitor) -> PPO:
    """An untrained agent."""
    return PPO(
        "MlpPolicy",
        env,
        learning_rate=_Falling(args.learning_rate),
        n_steps=args.n_steps,
        batch_size=args.batch_size,
        n_epochs=args.n_epochs,
        gamma=args.gamma,
        gae_lambda=args.gae_lambda,
        clip_range=args.clip_range,
        ent_coef=args.ent_coef,
        policy_kwargs={
            "net_arch": [args.net_width, args.net_width],
            "features_extractor_class": RelativeFeatures,
            "features_extractor_kwargs": {"spec": PRESETS[args.table]},
        },
        seed=args.seed,
        device="cpu",
    )


@dataclass(frozen=True)
class _Falling:
    """A learning rate that falls linearly to a tenth."""

    start: float

    def __call__(self, remaining: float) -> float:
        return self.start * (0.1 + 0.9 * remaining)


def _logger(folder: RunFolder, records: _Records) -> Logger:
    logger = configure(str(folder.path / "tensorboard"), ["tensorboard"])
    logger.output_formats.append(records)
    return logger


def train(args: TrainArgs) -> RunFolder:
    """Train to `args.steps`, or until Ctrl-C; then write the report. Returns the run's folder.

    Raises:
        ValueError, FileExistsError, FileNotFoundError: an argument does not fit; nothing has been written then.
    """
    _check(args)
    if args.steps is None and args.resume is None:
        args = dataclasses.replace(args, steps=DEFAULT_STEPS)
    torch.set_num_threads(args.threads)
    if args.resume is None:
        env = make_env(args)
        model = make_model(args, env)
        folder = RunFolder.create(args.name)
        history: dict[str, Any] = {"evaluations": [], "updates": [], "report": []}
        save(folder, model, history)
        write_json(folder.config, dataclasses.asdict(args))  # last: what has it can be resumed
    else:
        folder = RunFolder.open(args.resume)
        try:
            kept, history = read_json(folder.config), read_json(folder.evaluations)
            args = TrainArgs(**{**kept, "steps": args.steps or kept["steps"], "resume": args.resume})
            history = {name: history[name] for name in ("evaluations", "updates", "report")}
        except (TypeError, KeyError) as error:
            raise ValueError(f"{folder.path} cannot be resumed, its files do not fit: {error}") from error
        _check(args)
        env = make_env(args)
        model = load_ppo(folder.model, env)
        env.seed(args.seed + model.num_timesteps)  # other serves than the ones that were played
    left = (args.steps or DEFAULT_STEPS) - model.num_timesteps
    clock = _Clock(history["updates"][-1]["seconds"] if history["updates"] else 0.0)
    watch = _Watch(folder, args, history, clock)
    model.set_logger(_logger(folder, _Records(history["updates"], clock)))
    whom = ", ".join(args.opponents)
    print(f"{folder.path}: {max(left, 0):,} steps against {whom}. Ctrl-C stops early and keeps everything.")
    bar = ProgressBarCallback()
    try:
        if left > 0:
            model.learn(left, callback=CallbackList([watch, bar]), reset_num_timesteps=args.resume is None)
    except KeyboardInterrupt:
        if hasattr(bar, "pbar"):
            bar.pbar.close()  # or it would go on drawing over the report
        print(f"\nStopped. Go on with: python -m scripts.train_ppo --resume {folder.path}")
    save(folder, model, history)
    report(folder, args, history)
    env.close()
    return folder


def _check(args: TrainArgs) -> None:
    """What no run can have, before anything is written."""
    if args.opponent not in OPPONENTS:
        raise ValueError(f"opponent must be one of {OPPONENTS}, got {args.opponent!r}")
    most = math.inf
    check_ranges(
        args, steps=(1, most), seed=(0, 2**31 - 1), num_envs=(1, most), n_steps=(2, most), batch_size=(2, most),
        n_epochs=(1, most), learning_rate=(0, 1), gamma=(0, 1), gae_lambda=(0, 1), clip_range=(0, 10),
        ent_coef=(0, 10), net_width=(1, most), eval_every=(1, most), eval_points=(1, most), report_points=(1, most),
        threads=(1, 1024), video_seconds=(0, 3600),
    )  # fmt: skip


def report(folder: RunFolder, args: TrainArgs, history: dict[str, Any]) -> None:
    """Play against every scripted opponent, print and write the results, and draw picture and video."""
    from agents.report import draw_training, print_results
    from agents.video import frames_of_play, write_video
    from airhockey_env.policy import MlpPolicy

    policy = MlpPolicy.load(folder.policy)
    results = [play_points(policy, name, args.report_points, seed=2, table=args.table) for name in OPPONENTS]
    history["report"] = [result.as_dict() for result in results]
    write_json(folder.evaluations, history)
    print_results(results)
    draw_training(history, args.opponent, folder.picture)
    if args.video_seconds > 0:
        frames = frames_of_play(policy, args.opponent, args.video_seconds, size=(640, 344), table=args.table)
        write_video(folder.video, frames)
    print(f"Model, policy, TensorBoard logs, evaluations, training.png and video: {folder.path}")
