"""The recipe for PPO, SAC and TD3 in a registered environment, with hyperparameters from files in RL-Zoo's format."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import gymnasium
import numpy as np
import tyro
from numpy.typing import NDArray
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecEnv, VecFrameStack, VecMonitor, VecTransposeImage

from agents.conditions import Conditions
from agents.measuring.evaluation import CONTROL_HZ, wilson_interval
from agents.models import load_player
from agents.options import Count
from agents.seeding import table_seeds
from agents.training.hyperparameters import Hyperparameters, parse_section, read_section
from agents.training.learning import seed_tables
from agents.training.recipe import (
    TASK_EVALUATION,
    History,
    Phase,
    Recipe,
    Setup,
    TrainArgs,
    conditions_of,
    with_conditions,
)
from agents.training.report import print_successes
from agents.training.runs import RunFolder
from agents.training.stopping import Stop
from agents.video import frames_of_play
from airhockey_env.checks import check_choice
from airhockey_env.game import OBS_TYPES
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3}

HYPERPARAMS = Path(__file__).parents[1] / "hyperparams"

EPISODES_AT_ONCE = 64


@dataclass(frozen=True)
class ZooArgs(TrainArgs):
    """Train an agent with an algorithm of Stable-Baselines3, and write everything into one folder, runs/NAME/."""

    algo: str = "ppo"
    """Train with this algorithm: "ppo", "sac" or "td3"."""
    env: str = "AirHockeyHit-v0"
    """Train in this environment: "AirHockeyHit-v0", "AirHockeyDefend-v0" or "AirHockey-v0"."""
    obs_type: str = "state"
    """Let the agent observe the "state", or pictures, "rgb" or "grayscale". Only PPO has hyperparameters for these."""
    hyperparams: Path | None = None
    """Read the hyperparameters from this file in RL-Zoo's format, which must have a section for the environment. The
    default is agents/hyperparams/ALGO.yml, or ALGO_pixels.yml for pictures."""
    trust: bool = False
    """Run the `policy_kwargs` of --hyperparams as Python, as RL-Zoo does, if they contain more than plain values. Use
    this only with files from people you trust."""
    section: Annotated[dict[str, Any] | None, tyro.conf.Suppress] = None
    """The section for the environment. It is no option, but config.json keeps it with them."""
    eval_episodes: Count = 200
    """Play this many episodes in an evaluation."""
    report_episodes: Count = 1000
    """Play this many episodes for the report at the end."""


def resolve(args: ZooArgs) -> ZooArgs:
    """Check the options and read the hyperparameters. See `Recipe.resolve`.

    Raises:
        FileNotFoundError: there is no such file.
    """
    check_choice("--algo", args.algo, ALGORITHMS)
    check_choice("--obs-type", args.obs_type, OBS_TYPES)
    file = args.hyperparams or default_file(args)
    if args.obs_type != "state" and args.hyperparams is None and not file.is_file():
        raise ValueError(f"--algo must be ppo for pictures, unless --hyperparams names a file; got {args.algo!r}")
    if args.resume is None:
        args = dataclasses.replace(args, hyperparams=file, section=read_section(file, args.env))
    args = with_conditions(args)
    n_timesteps = parsed(args).n_timesteps
    return dataclasses.replace(args, steps=args.steps or n_timesteps)


def default_file(args: ZooArgs) -> Path:
    """The file of hyperparameters that is read without --hyperparams."""
    return HYPERPARAMS / f"{args.algo}{'' if args.obs_type == 'state' else '_pixels'}.yml"


def parsed(args: ZooArgs) -> Hyperparameters:
    """The hyperparameters in `section`, with the observations and the conditions that the options name.

    Raises:
        ValueError: there is no section, or it is not in RL-Zoo's format.
    """
    hyperparameters = parse_section(args.section, f"{args.hyperparams}, section {args.env}", args.trust)
    if args.obs_type != "state":
        hyperparameters.env_kwargs["obs_type"] = args.obs_type
    hyperparameters.env_kwargs.update(conditions_of(args).env_arguments())
    if args.stack > 1 and hyperparameters.env_kwargs.get("obs_type") == "rgb":
        raise ValueError(f"--stack must be 1 for rgb pictures, which have channels already, got {args.stack}")
    if args.stack > 1:
        hyperparameters.env_kwargs["stack"] = args.stack
        return dataclasses.replace(hyperparameters, frame_stack=None)
    return hyperparameters


def build(args: ZooArgs, new: bool) -> Setup:
    """See `Recipe.build`."""
    hyperparameters = parsed(args)
    env = make_env(args.env, hyperparameters)
    model = make_model(args.algo, hyperparameters, env, args.seed, args.device)
    tables = make_env(args.env, hyperparameters, min(args.eval_episodes, EPISODES_AT_ONCE))
    play = partial(successes, model, tables, args.seed)
    title = f"{args.algo} on {args.env}" + (f", {args.obs_type}" if args.obs_type != "state" else "")

    def report(history: History, stop: Stop) -> list[dict[str, Any]]:
        row = play(args.report_episodes, "report", stop)
        print_successes(args.env, {"untrained": history["evaluations"][0], "trained": row})
        return [row]

    return Setup(
        model,
        title,
        phases=lambda history: iter([Phase(f"{title}.", "training", env)]),
        evaluate=partial(play, args.eval_episodes, "progress"),
        report=report,
        frames=partial(frames, args, hyperparameters),
        evaluation=TASK_EVALUATION,
    )


def make_env(env_id: str, hyperparameters: Hyperparameters, num_envs: int | None = None) -> VecEnv:
    """Make tables of a registered environment.

    Args:
        num_envs: the number of tables; by default that of the hyperparameters.

    Raises:
        ValueError: the environment does not have such `env_kwargs`.
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
    if env.observation_space.dtype == np.uint8 and hyperparameters.env_kwargs.get("stack", 1) == 1:
        env = VecTransposeImage(env)  # Stable-Baselines3 would do it last, and stack far slower along the last axis
    return VecFrameStack(env, hyperparameters.frame_stack) if hyperparameters.frame_stack else env


def make_model(
    algo: str, hyperparameters: Hyperparameters, env: VecEnv, seed: int = 0, device: str = "cpu"
) -> BaseAlgorithm:
    """Make an untrained agent.

    Raises:
        ValueError: the algorithm does not have such hyperparameters.
    """
    arguments: dict[str, Any] = hyperparameters.model
    try:
        return ALGORITHMS[algo](env=env, seed=seed, device=device, **arguments)
    except (TypeError, AssertionError) as error:
        raise ValueError(f"hyperparameters do not fit {algo}: {error}") from error


def successes(
    model: BaseAlgorithm, tables: VecEnv, seed: int, episodes: int, purpose: str, stop: Stop
) -> dict[str, Any]:
    """Play episodes with deterministic actions, and return a row for the records.

    Args:
        tables: the tables to play on, each one episode after the other.
        seed, purpose: determine the random streams of the tables, see `agents.seeding`.
        stop: is checked between two steps.
    """
    ended: list[bool] = []

    def note(local: dict[str, Any], _: dict[str, Any]) -> None:
        stop.check()
        if local["done"]:
            ended.append(local["info"]["is_success"])

    seed_tables(tables, table_seeds(purpose, seed, tables.num_envs))
    rewards, lengths = evaluate_policy(
        model, tables, episodes, deterministic=True, return_episode_rewards=True, callback=note
    )
    return {
        "episodes": len(ended),
        "successes": sum(ended),
        "success_rate": sum(ended) / len(ended),
        "success_rate_95": list(wilson_interval(sum(ended), len(ended))),
        "mean_reward": float(np.mean(rewards)),
        "mean_seconds": float(np.mean(lengths)) / CONTROL_HZ,
    }


def frames(args: ZooArgs, hyperparameters: Hyperparameters, folder: RunFolder) -> Iterator[NDArray[np.uint8]]:
    """Pictures of the agent in its environment. See `Setup.frames`."""
    game = {"opponent": "striker", **gymnasium.spec(args.env).kwargs, **hyperparameters.env_kwargs}
    return frames_of_play(
        load_player(str(folder.path), trust=args.trust), game["opponent"], args.video_seconds,
        size=(640, 344), task=game.get("task", "point"), conditions=Conditions.of_env_arguments(game),
    )  # fmt: skip


RECIPE = Recipe("train", ZooArgs, resolve, build)
