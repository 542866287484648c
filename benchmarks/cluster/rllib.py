"""RLlib beside Stable-Baselines3: environment steps per second of processor time, with the same network and batches."""

from __future__ import annotations

import time
from collections.abc import Callable
from statistics import median
from typing import Any

from agents.cluster import connect
from agents.rllib.ppo import RllibPpoArgs, make_config

TITLE = "PPO with RLlib and with Stable-Baselines3"

UPDATES = 3
"""Updates that are measured at a time, after one that is not."""

ROUNDS = 3
"""The libraries take turns so many times."""


def measure(quick: bool = False) -> list[dict[str, Any]]:
    """Steps per second of this process's processor time for each library: the median, and all rounds."""
    import torch

    torch.set_num_threads(1)
    args = RllibPpoArgs(batch=256, minibatch=128, num_envs=16) if quick else RllibPpoArgs()
    makers = {"Stable-Baselines3": _sb3, "RLlib": _rllib}
    rounds: dict[str, list[float]] = {name: [] for name in makers}
    with connect(None, 1):
        learners = {name: make(args) for name, make in makers.items()}
        for update in learners.values():
            update()
        for _ in range(1 if quick else ROUNDS):
            for name, update in learners.items():
                start, steps = time.process_time(), 0
                for _ in range(UPDATES):
                    steps += update()
                rounds[name].append(steps / (time.process_time() - start))
    return [{"library": name, "per_second": median(values), "rounds": values} for name, values in rounds.items()]


def _rllib(args: RllibPpoArgs) -> Callable[[], int]:
    """A function that makes one update of the recipe and returns its steps. All of it happens in this process."""
    algorithm = make_config(args).build_algo()
    done = 0

    def update() -> int:
        nonlocal done
        before, done = done, int(algorithm.train()["num_env_steps_sampled_lifetime"])
        return done - before

    return update


def _sb3(args: RllibPpoArgs) -> Callable[[], int]:
    """The same with Stable-Baselines3."""
    from stable_baselines3 import PPO
    from torch import nn

    from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

    env = AirHockeySB3VecEnv(args.num_envs, opponent=args.opponent, reward=args.reward, num_threads=1)
    width = args.net_width
    model = PPO(
        "MlpPolicy", env, n_steps=args.batch // args.num_envs, batch_size=args.minibatch, n_epochs=args.epochs,
        policy_kwargs={"net_arch": [width, width], "activation_fn": nn.ReLU}, device="cpu", seed=args.seed,
    )  # fmt: skip

    def update() -> int:
        model.learn(args.batch, reset_num_timesteps=False)
        return args.batch

    return update


def table(rows: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """The rows as a table."""
    cells = [
        (row["library"], f"{row['per_second']:,.0f}", f"{min(row['rounds']):,.0f} to {max(row['rounds']):,.0f}")
        for row in rows
    ]
    return [("library", "steps/s of processor time", "rounds"), *cells]
