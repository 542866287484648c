"""The environments to measure, ours and others, each as a `Measure` of some steps."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from airhockey_env.game import Game
from benchmarks.speed.measure import Measure

WARM_UP = 150  # steps, past the first serves
MAX_STEPS = 1500


def _repeat(name: str, num_envs: int, step: Callable[[Any], Any], actions: list[Any], threads: int = 1) -> Measure:
    steps = max(1, 4096 // num_envs)

    def work() -> None:
        for k in range(steps):
            step(actions[k % len(actions)])

    for k in range(WARM_UP):
        step(actions[k % len(actions)])
    return Measure(name, num_envs, steps * num_envs, work, threads)


def _random_actions(num_envs: int) -> list[Any]:
    rng = np.random.default_rng(0)
    return [rng.uniform(-1.0, 1.0, (num_envs, 2)).astype(np.float32) for _ in range(8)]


def batch(name: str, num_envs: int, threads: int = 1, **arguments: Any) -> Measure:
    """The default game through `gym.make_vec`, with everything that a step returns, and random actions."""
    envs = gym.make_vec("AirHockey-v0", num_envs=num_envs, num_threads=threads, **arguments)
    envs.reset(seed=0)
    return _repeat(name, num_envs, envs.step, _random_actions(num_envs), threads)


def _game(num_envs: int, threads: int = 1, **arguments: Any) -> Game:
    game = Game(num_envs, max_episode_steps=MAX_STEPS, num_threads=threads, **arguments)
    game.reset(seed=0)
    return game


def compiled(name: str, num_envs: int, threads: int = 1) -> Measure:
    """Only the compiled step of the batch."""
    return _repeat(name, num_envs, _game(num_envs, threads).step, _random_actions(num_envs), threads)


def in_c(
    name: str, num_envs: int, command: tuple[str, ...] | None = None, flags: tuple[str, ...] | None = None
) -> Measure:
    """The same game in hand-written C, built with the command of a compiler and flags.

    Raises:
        DependencyNotInstalled: there is no working C compiler.
    """
    from benchmarks.speed.reference import CGame, library

    return _repeat(name, num_envs, CGame(_game(num_envs), library(command, flags)).step, _random_actions(num_envs))


def both_sides(name: str, num_envs: int) -> Measure:
    """A batch in which the caller controls both players."""
    game = _game(num_envs, right=None)
    actions = _random_actions(num_envs)
    return _repeat(name, num_envs, lambda action: game.step(action, actions[0]), actions)


def _cart_actions(num_envs: int) -> list[Any]:
    rng = np.random.default_rng(0)
    return [rng.integers(0, 2, num_envs) for _ in range(8)]


def cart_poles(name: str, num_envs: int, mode: str) -> Measure:
    """Gymnasium's CartPole-v1 as a batch; `mode` is "sync" or "vector_entry_point"."""
    envs = gym.make_vec("CartPole-v1", num_envs=num_envs, vectorization_mode=mode)
    envs.reset(seed=0)
    return _repeat(name, num_envs, envs.step, _cart_actions(num_envs))


def env_pool(name: str, num_envs: int, threads: int = 1) -> Measure:
    """EnvPool's CartPole-v1.

    Raises:
        ImportError: EnvPool or a part of it is not installed.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import envpool

            envs = envpool.make("CartPole-v1", env_type="gymnasium", num_envs=num_envs, num_threads=threads)
            envs.reset()
    except OSError as error:  # its data are in separate packages
        raise ImportError(str(error)) from error
    return _repeat(name, num_envs, envs.step, _cart_actions(num_envs), threads)


def single(name: str, env: Any) -> Measure:
    """One environment with its wrappers, and random actions."""
    env.reset(seed=0)
    env.action_space.seed(0)
    actions = [env.action_space.sample() for _ in range(64)]
    steps = 1000

    def work() -> None:
        env.reset()
        for k in range(steps):
            _, _, terminated, truncated, _ = env.step(actions[k % 64])
            if terminated or truncated:
                env.reset()

    return Measure(name, 1, steps, work)


def pictures(name: str) -> Measure:
    """Rendering of one environment at the default size."""
    env = gym.make("AirHockey-v0", render_mode="rgb_array")
    env.reset(seed=0)
    return Measure(name, 1, 20, lambda: [env.render() for _ in range(20)])
