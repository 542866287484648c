"""Stable-Baselines3's algorithms by name, with hyperparameters from files in RL-Zoo's format."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
import yaml
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback, CallbackList, ProgressBarCallback
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.noise import NormalActionNoise, OrnsteinUhlenbeckActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.vec_env import VecEnv, VecFrameStack, VecMonitor, VecTransposeImage

from agents.algorithms_report import draw_run, print_run
from agents.checks import check_ranges
from agents.evaluation import CONTROL_HZ, wilson_interval
from agents.files import write_json
from agents.literals import read_kwargs
from agents.runs import Clock, Records, RunFolder, logger, save, until_ctrl_c
from airhockey_env.game import OBS_TYPES
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3}

NOISES = {"normal": NormalActionNoise, "ornstein-uhlenbeck": OrnsteinUhlenbeckActionNoise}
"""By RL-Zoo's names."""

HYPERPARAMS = Path(__file__).parent / "hyperparams"

EPISODES_AT_ONCE = 64


@dataclass(frozen=True)
class AlgorithmArgs:
    """Train an agent with an algorithm of Stable-Baselines3. Everything goes into one folder, runs/NAME/."""

    algo: str = "ppo"
    """"ppo", "sac" or "td3"."""
    env: str = "AirHockeyHit-v0"
    """"AirHockeyHit-v0", "AirHockeyDefend-v0" or "AirHockey-v0"."""
    obs_type: str = "state"
    """"state"; or "rgb" or "grayscale": pictures, for which only PPO has hyperparameters."""
    hyperparams: Path | None = None
    """File in RL-Zoo's format, with a section for the environment.
    Default: agents/hyperparams/ALGO.yml, for pictures ALGO_pixels.yml."""
    name: str | None = None
    """Name of the run's folder under runs/. Default: the algorithm and the time."""
    steps: int | None = None
    """Environment steps in all. Default: what the file says."""
    seed: int = 0
    """Of the network, the actions and the tables."""
    evaluations: int = 10
    """While training, each with a checkpoint; besides one before it begins and one at the end."""
    eval_episodes: int = 200
    """Episodes of an evaluation."""
    report_episodes: int = 1000
    """Episodes of the one at the end."""
    threads: int = 1
    """Of torch."""
    trust: bool = False
    """Run `policy_kwargs` of --hyperparams as Python where it is more than plain values, as RL-Zoo does: only for files
    of people you trust."""

    def check(self) -> None:
        """Refuse what no run can have, before anything is written.

        Raises:
            ValueError: an argument is out of range.
        """
        if self.algo not in ALGORITHMS:
            raise ValueError(f"--algo must be one of {tuple(ALGORITHMS)}, got {self.algo!r}")
        if self.obs_type not in OBS_TYPES:
            raise ValueError(f"--obs-type must be one of {OBS_TYPES}, got {self.obs_type!r}")
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


def read_hyperparameters(path: Path, env_id: str, trust: bool = False) -> Hyperparameters:
    """Read the section of an environment in RL-Zoo's format.

    Args:
        trust: run `policy_kwargs` as Python, as RL-Zoo does, where it is more than plain values (see `read_kwargs`).

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it has no section for the environment, or not in this format.
    """
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path} of hyperparameters")
    try:
        if path.stat().st_size > 2**20:
            raise ValueError("it has more than a megabyte")
        sections = yaml.safe_load(path.read_text())
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, TypeError, RecursionError) as error:
        raise ValueError(f"{path} is not a YAML file: {error}") from error
    if not isinstance(sections, dict) or not isinstance(sections.get(env_id), dict):
        has = sorted(map(str, sections)) if isinstance(sections, dict) else "none"
        raise ValueError(f"--env must have a section in {path}, got {env_id!r}; it has {has}")
    section = dict(sections[env_id])
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
        raise ValueError(f"{path}, section {env_id}, is not in RL-Zoo's format: {error!r}") from error
    return Hyperparameters(n_timesteps, n_envs, frame_stack, env_kwargs, section, sections[env_id])


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
    """
    spec = gymnasium.spec(env_id)
    env: VecEnv = AirHockeySB3VecEnv(
        num_envs or hyperparameters.n_envs,
        max_episode_steps=spec.max_episode_steps,
        **{**spec.kwargs, **hyperparameters.env_kwargs},
    )
    env = VecMonitor(env)
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


def success_row(model: BaseAlgorithm, env: VecEnv, episodes: int, seed: int) -> dict[str, Any]:
    """Play episodes, deterministically and on tables that no evaluation of another seed has; for a JSON file."""
    successes: list[bool] = []

    def note(local: dict[str, Any], _: dict[str, Any]) -> None:
        if local["done"]:
            successes.append(local["info"]["is_success"])

    env.seed(seed * 1_000_003)
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
        self, folder: RunFolder, env: VecEnv, episodes: int, every: int, history: dict[str, Any], clock: Clock
    ) -> None:
        super().__init__()
        self.folder, self.env, self.episodes = folder, env, episodes
        self.every = self.due = every
        self.history, self.clock = history, clock

    def _on_step(self) -> bool:
        if isinstance(self.model, OffPolicyAlgorithm):
            self._evaluate_if_due()
        return True

    def _on_rollout_start(self) -> None:
        self._evaluate_if_due()

    def _evaluate_if_due(self) -> None:
        if self.num_timesteps >= self.due:
            self.due += self.every
            self.evaluate(self.episodes, seed=1)

    def evaluate(self, episodes: int, seed: int) -> None:
        """Play, and save everything."""
        seconds = self.clock.seconds
        row = success_row(self.model, self.env, episodes, seed)
        self.clock.start += self.clock.seconds - seconds
        self.history["evaluations"].append({"steps": self.model.num_timesteps, "seconds": seconds, **row})
        self.model.logger.record("eval/success_rate", row["success_rate"])
        save(self.folder, self.model, self.history)


def train(args: AlgorithmArgs) -> RunFolder:
    """Train to the end, or until Ctrl-C; then write the report. Returns the run's folder.

    Raises:
        ValueError, FileExistsError, FileNotFoundError: an argument does not fit; nothing has been written then.
    """
    args.check()
    torch.set_num_threads(args.threads)
    pixels = args.obs_type != "state"
    path = args.hyperparams or HYPERPARAMS / f"{args.algo}{'_pixels' if pixels else ''}.yml"
    hyperparameters = read_hyperparameters(path, args.env, args.trust)
    if pixels:
        hyperparameters.env_kwargs["obs_type"] = args.obs_type
    steps = args.steps or hyperparameters.n_timesteps
    env = make_env(args.env, hyperparameters)
    judge = make_env(args.env, hyperparameters, min(args.eval_episodes, EPISODES_AT_ONCE))
    model = make_model(args.algo, hyperparameters, env, args.seed)
    folder = RunFolder.create(args.name, args.algo)
    history: dict[str, Any] = {"evaluations": [], "updates": []}
    save(folder, model, history)
    settings = {**dataclasses.asdict(args), "steps": steps, "hyperparams": str(path)}
    del settings["trust"]  # is asked for anew
    write_json(folder.config, {**settings, "section": hyperparameters.section})
    print(f"{folder.path}: {steps:,} steps of {args.env} with {args.algo}. Ctrl-C stops early and keeps everything.")
    clock = Clock(0.0)
    model.set_logger(logger(folder, Records(history["updates"], clock)))
    watch = _Watch(folder, judge, args.eval_episodes, max(1, steps // args.evaluations), history, clock)
    watch.init_callback(model)
    watch.evaluate(args.eval_episodes, seed=1)
    bar = ProgressBarCallback()
    each = 100 if isinstance(model, OffPolicyAlgorithm) else 1  # episodes, or updates, between two lines of the log
    with until_ctrl_c(bar, "Stopped."):
        model.learn(steps, callback=CallbackList([watch, bar]), log_interval=each)
    watch.evaluate(args.report_episodes, seed=2)
    print_run(args.env, history)
    draw_run(history, f"{args.algo} on {args.env}" + (f", {args.obs_type}" if pixels else ""), folder.picture)
    print(f"Model, policy, TensorBoard logs, evaluations and training.png: {folder.path}")
    return folder
