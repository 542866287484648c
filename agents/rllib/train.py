"""Train with RLlib: checkpoints, a run that can be continued, and its policy as a file."""

from __future__ import annotations

import dataclasses
import math
import shutil
import time
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from agents.cluster import connect
from agents.files import read_arguments, write_json
from agents.options import check_cluster, check_ranges
from agents.rllib import ppo, self_play
from agents.rllib.export import export_policy
from agents.rllib.ppo import RllibPpoArgs
from agents.rllib.recipe import ACTIVATION, RllibArgs
from agents.rllib.self_play import RllibSelfPlayArgs
from agents.training.runs import RunFolder, check_name
from agents.training.stopping import Stop, stopping
from airhockey_env.checks import check_choice
from airhockey_env.game import REWARDS

Args = TypeVar("Args", bound=RllibArgs)

RECIPES: dict[type[RllibArgs], tuple[str, ModuleType]] = {
    RllibPpoArgs: ("rllib_ppo", ppo),
    RllibSelfPlayArgs: ("rllib_self_play", self_play),
}
"""The recipes by the type of their options: the command, and the module with `make_config` and `MODULE`."""

SESSION = ("steps", "workers", "address")
"""The options that can be others when a run is continued."""

SAVE_EVERY = 60.0
"""Seconds between two checkpoints."""


def train(args: RllibArgs) -> RunFolder:
    """Train to `args.steps`, or until Ctrl-C; return the folder of the run. A run that has begun is continued.

    RLlib's checkpoints hold pickles, which can run any code: continue only runs of your own.

    Raises:
        ValueError, OSError: an option is wrong, or the run has other options.
        gymnasium.error.DependencyNotInstalled: Ray is missing.
    """
    most = math.inf
    check_ranges(
        args, steps=(1, most), seed=(0, 2**31 - 1), num_envs=(1, most), batch=(2, most), minibatch=(2, args.batch),
        epochs=(1, most), learning_rate=(0, 1), gamma=(0, 1), net_width=(1, most),
    )  # fmt: skip
    check_cluster(args)
    check_choice("--reward", args.reward, REWARDS)
    command, recipe = RECIPES[type(args)]
    folder = RunFolder(Path("runs") / check_name(args.name))
    folder.path.mkdir(parents=True, exist_ok=True)
    with folder.locked(), connect(args.address, 1 + (args.workers or 0)), stopping() as stop:
        _keep(folder, command, args)
        algorithm = recipe.make_config(args).build_algo()
        try:
            _learn(folder, args, algorithm, recipe.MODULE, stop)
        finally:
            algorithm.stop()
        stop.check()
    print(f"{folder.path}: policy.npz, config.json and {latest(folder).name}")
    return folder


def latest(folder: RunFolder) -> Path:
    """The last checkpoint of a run.

    Raises:
        FileNotFoundError: there is none.
    """
    checkpoints = sorted(folder.path.glob("checkpoint-[0-9]*"))
    if not checkpoints:
        raise FileNotFoundError(f"{folder.path} must have a checkpoint")
    return checkpoints[-1].absolute()


def _keep(folder: RunFolder, command: str, args: RllibArgs) -> None:
    """Write the options of a new run, or check those of one that is continued."""
    if not folder.config.exists():
        kept = {name: value for name, value in dataclasses.asdict(args).items() if name not in ("workers", "address")}
        write_json(folder.config, {"command": command, **kept})
        return
    before = read_arguments(folder.config, type(args), beside=("command",))
    session = {name: getattr(args, name) for name in SESSION}
    if dataclasses.replace(before, **session) != args:
        raise ValueError(f"{folder.path} is a run with other options: choose another --name")


def _learn(folder: RunFolder, args: RllibArgs, algorithm: Any, module: str, stop: Stop) -> None:
    from tqdm import tqdm

    steps = 0
    if list(folder.path.glob("checkpoint-[0-9]*")):
        algorithm.restore_from_path(str(latest(folder)))
        steps = int(latest(folder).name.partition("-")[2])
    with tqdm(total=args.steps, initial=min(steps, args.steps), unit="step", unit_scale=True, disable=None) as bar:
        saved = time.monotonic()
        while steps < args.steps and not stop.asked:
            result = algorithm.train()
            steps = int(result["num_env_steps_sampled_lifetime"])
            runners = result["env_runners"]
            returns = runners.get("module_episode_returns_mean", runners.get("module_episode_return_mean", {}))
            if module in returns:
                bar.set_postfix_str(f"return {returns[module]:.2f}")
            bar.update(min(steps, args.steps) - bar.n)
            if time.monotonic() > saved + SAVE_EVERY:
                _save(folder, algorithm, module, steps)
                saved = time.monotonic()
    _save(folder, algorithm, module, steps)


def _save(folder: RunFolder, algorithm: Any, module: str, steps: int) -> None:
    """Write a checkpoint and the policy; then remove the checkpoints before it."""
    path, part = folder.path / f"checkpoint-{steps:012d}", folder.path / "part"
    if path.exists():
        return
    export_policy(algorithm.get_weights([module])[module], ACTIVATION).save(folder.policy)
    shutil.rmtree(part, ignore_errors=True)  # of a process that was killed
    algorithm.save_to_path(str(part.absolute()))
    part.rename(path)
    for other in folder.path.glob("checkpoint-[0-9]*"):
        if other != path:
            shutil.rmtree(other)
