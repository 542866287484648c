"""Stable-Baselines3's algorithms by name, with hyperparameters from files in RL-Zoo's format."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
import yaml
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.noise import NormalActionNoise, OrnsteinUhlenbeckActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.vec_env import VecEnv, VecFrameStack, VecMonitor, VecTransposeImage

from agents.files import COUNT, NUMBER, read_json, write_json
from agents.measuring.evaluation import CONTROL_HZ, wilson_interval
from agents.options import Count, OptionalCount, check_ranges, check_resumed
from agents.seeding import table_seeds
from agents.training.algorithms_report import draw_run, print_run
from agents.training.learning import ProgressBar, learning, seed_learning, seed_tables
from agents.training.literals import read_kwargs
from agents.training.runs import (
    Clock,
    Records,
    RunFolder,
    load_buffer,
    logger,
    read_config,
    save,
    take_up,
    where_it_stands,
)
from agents.training.stopping import Stop, StopLearning, stopping
from airhockey_env.game import OBS_TYPES
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3}

NOISES = {"normal": NormalActionNoise, "ornstein-uhlenbeck": OrnsteinUhlenbeckActionNoise}
"""By RL-Zoo's names."""

HYPERPARAMS = Path(__file__).parents[1] / "hyperparams"

EPISODES_AT_ONCE = 64

HISTORY = {"evaluations": [{"steps": COUNT, "seconds": NUMBER, "episodes": COUNT}], "updates": [{"steps": COUNT}]}
"""What the file of records of a run has, for `read_json`."""

COMMAND = "train"
"""Under scripts/; a run's config.json names it."""


@dataclass(frozen=True)
class AlgorithmArgs:
    """Train an agent with an algorithm of Stable-Baselines3. Everything goes into one folder, runs/NAME/."""

    algo: str = "ppo"
    """The algorithm: "ppo", "sac" or "td3"."""
    env: str = "AirHockeyHit-v0"
    """The environment: "AirHockeyHit-v0", "AirHockeyDefend-v0" or "AirHockey-v0"."""
    obs_type: str = "state"
    """What the agent sees: "state", or pictures, "rgb" or "grayscale", for which only PPO has hyperparameters."""
    hyperparams: Path | None = None
    """A file in RL-Zoo's format, with a section for the environment. The default is agents/hyperparams/ALGO.yml, for
    pictures ALGO_pixels.yml."""
    trust: bool = False
    """Run `policy_kwargs` of --hyperparams as Python where it is more than plain values, as RL-Zoo does: only for files
    of people you trust."""
    name: str | None = None
    """The name of the run's folder under runs/. The default is the algorithm and the time."""
    resume: str | None = None
    """Go on with this run (its folder, or its name under runs/), with its own arguments, to --steps in all."""
    steps: OptionalCount = None
    """Environment steps in all, as 100_000, 100k or 1e5. The default is what the file says, or with --resume what the
    run was to have."""
    seed: int = 0
    """The seed of the network, the exploration and the tables. Runs with other seeds share no random numbers."""
    evaluations: Count = 10
    """The number of evaluations while training, each with a checkpoint. One before training and one at its end come on
    top."""
    eval_episodes: Count = 200
    """The number of episodes in an evaluation."""
    report_episodes: Count = 1000
    """The number of episodes in the evaluation at the end."""
    threads: int = 1
    """The number of threads that PyTorch uses."""

    @property
    def file(self) -> Path:
        """The file of hyperparameters."""
        return self.hyperparams or HYPERPARAMS / f"{self.algo}{'' if self.obs_type == 'state' else '_pixels'}.yml"

    def check(self) -> None:
        """Refuse what no run can have, before anything is written.

        Raises:
            ValueError: an argument is out of range.
        """
        if self.algo not in ALGORITHMS:
            raise ValueError(f"--algo must be one of {tuple(ALGORITHMS)}, got {self.algo!r}")
        if self.obs_type not in OBS_TYPES:
            raise ValueError(f"--obs-type must be one of {OBS_TYPES}, got {self.obs_type!r}")
        if self.obs_type != "state" and self.hyperparams is None and not self.file.is_file():
            raise ValueError(f"--algo must be ppo for pictures, unless --hyperparams names a file; got {self.algo!r}")
        most = math.inf
        check_ranges(
            self, steps=(1, most), seed=(0, 2**31 - 1), evaluations=(1, 10**6), eval_episodes=(1, most),
            report_episodes=(1, most), threads=(1, 1024),
        )  # fmt: skip


@dataclass(frozen=True)
class Hyperparameters:
    """A section of a file in RL-Zoo's format."""

    n_timesteps: int
    n_envs: int
    frame_stack: int | None
    env_kwargs: dict[str, Any]
    model: dict[str, Any]
    """Arguments of the algorithm's class."""
    section: dict[str, Any]
    """All of it, as it stands in the file."""


@dataclass(frozen=True)
class _Linear:
    """A value that falls linearly to 0, RL-Zoo's `lin_`."""

    start: float

    def __call__(self, remaining: float) -> float:
        return self.start * remaining


def read_section(path: Path, env_id: str) -> dict[str, Any]:
    """The section of an environment in a file in RL-Zoo's format, as it stands there.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it has no section for the environment.
    """
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path} of hyperparameters")
    try:
        if path.stat().st_size > 2**20:
            raise ValueError("it has more than a megabyte")
        sections = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, TypeError, RecursionError) as error:
        raise ValueError(f"{path} is not a YAML file: {error}") from error
    env_id = env_id.rpartition(":")[2]  # of "airhockey_env:AirHockeyHit-v0"
    if not isinstance(sections, dict) or not isinstance(sections.get(env_id), dict):
        has = sorted(map(str, sections)) if isinstance(sections, dict) else "none"
        raise ValueError(f"--env must have a section in {path}, got {env_id!r}; it has {has}")
    return sections[env_id]


def read_hyperparameters(path: Path, env_id: str, trust: bool = False) -> Hyperparameters:
    """Read the section of an environment in RL-Zoo's format.

    Args:
        trust: run `policy_kwargs` as Python, as RL-Zoo does, where it is more than plain values (see `read_kwargs`).

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it has no section for the environment, or not in this format.
    """
    return parse_section(read_section(path, env_id), f"{path}, section {env_id}", trust)


def parse_section(section: dict[str, Any], where: str, trust: bool = False) -> Hyperparameters:
    """What a section in RL-Zoo's format says.

    Args:
        section: plain values, as a YAML or a JSON file has them.
        where: it stands, for errors.
        trust: as in `read_hyperparameters`.

    Raises:
        ValueError: it is not in this format.
    """
    whole, section = section, dict(section)
    try:
        _check_size(section)
        n_timesteps, n_envs = int(section.pop("n_timesteps")), int(section.pop("n_envs", 1))
        frame_stack, env_kwargs = section.pop("frame_stack", None), dict(section.pop("env_kwargs", {}))
        if isinstance(section.get("policy_kwargs"), str):
            section["policy_kwargs"] = read_kwargs(section["policy_kwargs"], trust)
        for name in ("learning_rate", "clip_range"):
            if isinstance(section.get(name), str):
                kind, start = section[name].split("_")
                if kind != "lin":
                    raise ValueError(f"{name} must be a number or lin_ and a number, got {section[name]!r}")
                section[name] = _Linear(float(start))
        noise, deviation = section.pop("noise_type", None), section.pop("noise_std", 0.0)
        if noise is not None and noise not in NOISES:
            raise ValueError(f"noise_type must be one of {tuple(NOISES)}, got {noise!r}")
        if noise is not None:
            section["action_noise"] = NOISES[noise](np.zeros(2), np.full(2, float(deviation)))
    except Exception as error:  # whatever the Python in it does
        raise ValueError(f"{where}, is not in RL-Zoo's format: {error!r}") from error
    return Hyperparameters(n_timesteps, n_envs, frame_stack, env_kwargs, section, whole)


def _check_size(section: dict[str, Any]) -> None:
    """Raises ValueError for a section whose aliases, YAML's `*name`, multiply it beyond all use, or hold itself."""
    parts: list[Any] = [section]
    for _ in range(10_000):
        if not parts:
            return
        part = parts.pop()
        parts += part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    raise ValueError("a section must have fewer than 10,000 values")


def make_env(env_id: str, hyperparameters: Hyperparameters, num_envs: int | None = None) -> VecEnv:
    """Tables of a registered environment, over the native batch.

    Args:
        num_envs: how many, if not as many as training has.

    Raises:
        ValueError: `env_kwargs` are not those of the environment.
    """
    spec = gymnasium.spec(env_id)
    try:
        tables = AirHockeySB3VecEnv(
            num_envs or hyperparameters.n_envs,
            max_episode_steps=spec.max_episode_steps,
            **{**spec.kwargs, **hyperparameters.env_kwargs},
        )
    except TypeError as error:
        raise ValueError(f"hyperparameters do not fit {env_id}: {error}") from error
    env: VecEnv = VecMonitor(tables)
    if env.observation_space.dtype == np.uint8:
        env = VecTransposeImage(env)  # Stable-Baselines3 would do it last, and stack far slower along the last axis
    return VecFrameStack(env, hyperparameters.frame_stack) if hyperparameters.frame_stack else env


def make_model(algo: str, hyperparameters: Hyperparameters, env: VecEnv, seed: int = 0) -> BaseAlgorithm:
    """An untrained agent.

    Raises:
        ValueError: the hyperparameters are not those of the algorithm.
    """
    arguments: dict[str, Any] = hyperparameters.model
    try:
        return ALGORITHMS[algo](env=env, seed=seed, device="cpu", **arguments)
    except (TypeError, AssertionError) as error:
        raise ValueError(f"hyperparameters do not fit {algo}: {error}") from error


def success_row(
    model: BaseAlgorithm, env: VecEnv, episodes: int, seed: int, purpose: str, stop: Stop
) -> dict[str, Any]:
    """Play episodes, deterministically; for a JSON file.

    Args:
        env: tables, which play one episode after the other.
        seed, purpose: of the tables' random streams, see `agents.seeding`.
        stop: asked between two steps.
    """
    successes: list[bool] = []

    def note(local: dict[str, Any], _: dict[str, Any]) -> None:
        stop.check()
        if local["done"]:
            successes.append(local["info"]["is_success"])

    seed_tables(env, table_seeds(purpose, seed, env.num_envs))
    rewards, lengths = evaluate_policy(
        model, env, episodes, deterministic=True, return_episode_rewards=True, callback=note
    )
    return {
        "episodes": len(successes),
        "successes": sum(successes),
        "success_rate": sum(successes) / len(successes),
        "success_rate_95": list(wilson_interval(sum(successes), len(successes))),
        "mean_reward": float(np.mean(rewards)),
        "mean_seconds": float(np.mean(lengths)) / CONTROL_HZ,
    }


class _Watch(BaseCallback):
    """Evaluates and saves while training; the clock stands still meanwhile."""

    def __init__(
        self, folder: RunFolder, env: VecEnv, args: AlgorithmArgs, history: dict[str, Any], clock: Clock, stop: Stop
    ) -> None:
        super().__init__()
        assert args.steps is not None
        self.folder, self.env, self.args = folder, env, args
        self.every = max(1, args.steps // args.evaluations)
        self.history, self.clock, self.stop = history, clock, stop

    def _on_step(self) -> bool:
        if isinstance(self.model, OffPolicyAlgorithm):
            self._evaluate_if_due()
        return True

    def _on_rollout_start(self) -> None:
        self._evaluate_if_due()

    def _evaluate_if_due(self) -> None:
        if self.num_timesteps // self.every > self.history["evaluations"][-1]["steps"] // self.every:
            self.evaluate(self.args.eval_episodes, "progress")

    def save(self) -> None:
        """Write everything that a resumed run needs but its arguments."""
        save(self.folder, self.model, self.history)

    def evaluate(self, episodes: int, purpose: str) -> None:
        """Play, and save everything."""
        seconds = self.clock.seconds
        row = success_row(self.model, self.env, episodes, self.args.seed, purpose, self.stop)
        self.clock.start += self.clock.seconds - seconds
        self.history["evaluations"].append({"steps": self.model.num_timesteps, "seconds": seconds, **row})
        self.model.logger.record("eval/success_rate", row["success_rate"])
        self.save()


def train(args: AlgorithmArgs, callbacks: Sequence[BaseCallback] = ()) -> RunFolder:
    """Train to the end, or until Ctrl-C; then write the report. Returns the run's folder.

    A second Ctrl-C, SIGTERM or SIGHUP leaves out the report, not the saving.

    Args:
        callbacks: of Stable-Baselines3, for trackers and the like.

    Raises:
        ValueError, FileExistsError, FileNotFoundError: an argument does not fit; nothing has been written then.
        BlockingIOError: another process trains this run.
        OSError: the run could not be saved; its last checkpoint is whole.
    """
    args.check()
    asked = args.steps
    with contextlib.ExitStack() as stack:
        stop = stack.enter_context(stopping())
        if args.resume is None:
            folder, section = None, read_section(args.file, args.env)
            where = f"{args.file}, section {args.env}"
        else:
            folder, args, section = _go_on(args, stack)
            where = f"{folder.config}, section"
        hyperparameters = parse_section(section, where, args.trust)
        if args.obs_type != "state":
            hyperparameters.env_kwargs["obs_type"] = args.obs_type
        args = dataclasses.replace(args, steps=args.steps or hyperparameters.n_timesteps)
        torch.set_num_threads(args.threads)
        env = make_env(args.env, hyperparameters)
        model = make_model(args.algo, hyperparameters, env, args.seed)
        if folder is None:
            folder = RunFolder.create(args.name, args.algo)
            stack.enter_context(folder.locked(new=True))
            history: dict[str, Any] = {"evaluations": [], "updates": []}
            save(folder, model, history)
            settings = {"command": COMMAND, **dataclasses.asdict(args), "hyperparams": str(args.file)}
            del settings["trust"]  # is asked for with every command
            write_json(folder.config, {**settings, "section": section})  # last: what has it can be resumed
        else:
            history = take_up(folder, HISTORY, model, asked)
            if isinstance(model, OffPolicyAlgorithm):
                load_buffer(model.replay_buffer, folder.buffer)
        judge = make_env(args.env, hyperparameters, min(args.eval_episodes, EPISODES_AT_ONCE))
        _train(folder, args, model, env, judge, history, callbacks, stop)
    return folder


def own_args(args: AlgorithmArgs) -> tuple[RunFolder, AlgorithmArgs]:
    """The folder that `args.resume` names, and the arguments that the run was begun with.

    Raises:
        FileNotFoundError: there is no such run.
        ValueError: it is a run of another command, or damaged.
    """
    assert args.resume is not None
    folder = RunFolder.open(args.resume, "--resume")
    kept = read_config(folder, AlgorithmArgs, COMMAND, beside=("section",), resume=args.resume, trust=args.trust)
    return folder, kept


def _go_on(args: AlgorithmArgs, stack: contextlib.ExitStack) -> tuple[RunFolder, AlgorithmArgs, dict[str, Any]]:
    """A run that goes on, with its section of hyperparameters; its folder stays locked as long as the stack."""
    folder, kept = own_args(args)
    check_resumed(args, kept)
    stack.enter_context(folder.locked())
    section = read_json(folder.config, {"section": {}})["section"]
    return folder, dataclasses.replace(kept, steps=args.steps or kept.steps), section


def _train(
    folder: RunFolder,
    args: AlgorithmArgs,
    model: BaseAlgorithm,
    env: VecEnv,
    judge: VecEnv,
    history: dict[str, Any],
    callbacks: Sequence[BaseCallback],
    stop: Stop,
) -> None:
    assert args.steps is not None
    steps = args.steps
    print(
        f"{folder.path}: {steps:,} steps of {args.env} with {args.algo} in all."
        f"{where_it_stands(model.num_timesteps, steps)} Ctrl-C stops early and keeps everything."
    )
    clock = Clock(history["updates"][-1]["seconds"] if history["updates"] else 0.0)
    model.set_logger(logger(folder, Records(history["updates"], clock)))
    watch = _Watch(folder, judge, args, history, clock, stop)
    watch.init_callback(model)
    bar = ProgressBar()
    each = 100 if isinstance(model, OffPolicyAlgorithm) else 1  # episodes, or updates, between two lines of the log
    with learning(stop, bar, watch.save, f"python -m scripts.{COMMAND} --resume {folder.path}"):
        if not history["evaluations"]:
            watch.evaluate(args.eval_episodes, "progress")
        if model.num_timesteps < steps:
            seed_learning(model, env, "training", args.seed)
            every = CallbackList([*callbacks, watch, bar, StopLearning(stop)])
            first = model.num_timesteps == 0
            model.learn(steps - model.num_timesteps, callback=every, log_interval=each, reset_num_timesteps=first)
    last = history["evaluations"][-1] if history["evaluations"] else {"steps": -1}
    if last["steps"] < model.num_timesteps or last["episodes"] < args.report_episodes:
        watch.evaluate(args.report_episodes, "report")
    print_run(args.env, history)
    title = f"{args.algo} on {args.env}" + (f", {args.obs_type}" if args.obs_type != "state" else "")
    draw_run(history, title, folder.picture)
    print(folder.files())
