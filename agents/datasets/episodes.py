"""Episodes of a player, straight from the batch: each with a seed that begins it again."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from agents.datasets.settings import Setting
from agents.models import Player, Policy, in_one_game, join
from agents.seeding import sequence
from airhockey_env.game import Game
from airhockey_env.kernel.state import LEFT, observation_shape
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.players import stack_of

TABLES = 256
"""Tables of the batch. More of them play hardly faster, and more play in vain when there are enough episodes."""

MOST_BYTES = 256 * 2**20
"""Memory for the episodes that are being played."""


class Episode(NamedTuple):
    """One episode of T steps, from its first observation to its last."""

    observations: NDArray[np.float32]
    """(T + 1, ...), as the environment shows them."""
    actions: NDArray[np.float32]
    """(T, 2) in [-1, 1]."""
    rewards: NDArray[np.float64]
    """(T,)"""
    terminated: bool
    """Whether the last step terminated the episode; else it truncated it."""
    seed: int | None = None
    """What `reset` takes to begin the episode; None: it begins with `state`."""
    state: NDArray[np.void] | None = None
    """(1,) What `set_state` takes to begin it."""

    def __len__(self) -> int:
        return len(self.rewards)


class UniformPlayer:
    """A player that draws every action from the action space, as the random policy of Minari's scores does."""

    def __init__(self, random: np.random.Generator) -> None:
        self.random = random

    def __call__(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (N, 2) for observations (N, ...)."""
        return self.random.uniform(-1.0, 1.0, (len(observations), 2)).astype(np.float32)


class _Noted:
    """A policy whose last actions are kept, clipped as the environment clips them."""

    def __init__(self, policy: Policy) -> None:
        self.policy, self.stack = policy, stack_of(policy)
        self.actions = np.zeros((0, 2), np.float32)

    def __call__(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        self.actions = np.clip(np.asarray(self.policy(observations), np.float32), -1.0, 1.0)
        return self.actions


def play_episodes(player: Player | None, setting: Setting, seed: int, purpose: str = "dataset") -> Iterator[Episode]:
    """Play without end, and yield the episodes in the order of their seeds.

    A batch that stopped after a number of steps would have more of the short episodes than there are, since the long
    ones are cut off. Every episode here that precedes one that is yielded has been yielded.

    Args:
        player: a policy or a model; None: a `UniformPlayer`.
        setting: the environment, in which it is the left player.
        seed: determines the episodes' seeds.
        purpose: see `agents.seeding`.
    """
    root = sequence(purpose, seed, TASKS[setting.task].number)
    random, noise = (np.random.default_rng(child) for child in root.spawn(2))
    inner = UniformPlayer(noise) if player is None else in_one_game(player)
    assert not isinstance(inner, str), "scripted players choose their actions within the compiled step"
    policy, limit, shape = _Noted(inner), setting.max_episode_steps, observation_shape(setting.stack)
    n = max(1, min(TABLES, MOST_BYTES // (4 * (limit + 1) * (math.prod(shape) + 4))))
    game = Game(n, left=policy, autoreset_mode=AutoresetMode.DISABLED, **setting.game_arguments())
    join(game, inner)

    observations = np.empty((n, limit + 1, *shape), np.float32)
    actions, rewards = np.empty((n, limit, 2), np.float32), np.empty((n, limit))
    every, t = np.arange(n), np.zeros(n, np.int64)
    numbers = itertools.count()
    playing = [(next(numbers), _draw_seed(random)) for _ in range(n)]
    game.reset([drawn for _, drawn in playing])
    observations[:, 0] = game.observations(LEFT)
    finished: dict[int, Episode] = {}  # those that wait for an earlier one
    for number in itertools.count():
        while number not in finished:
            game.step()
            out = game.out
            actions[every, t], rewards[every, t] = policy.actions, out.reward[LEFT]
            t += 1
            observations[every, t] = game.observations(LEFT)
            over = np.flatnonzero(out.terminated | out.truncated)
            if not len(over):
                continue
            seeds: list[int | None] = [None] * n
            for i in over.tolist():
                k, (done, began_with) = t[i], playing[i]
                finished[done] = Episode(
                    observations[i, : k + 1].copy(),
                    actions[i, :k].copy(),
                    rewards[i, :k].copy(),
                    bool(out.terminated[i]),
                    began_with,
                )
                playing[i] = next(numbers), _draw_seed(random)
                seeds[i] = playing[i][1]
            game.reset(seeds, tables=over)
            t[over] = 0
            observations[over, 0] = game.observations(LEFT, over)
        yield finished.pop(number)


def _draw_seed(random: np.random.Generator) -> int:
    """A seed of an episode, which fits into Minari's int64."""
    return int(random.integers(2**63))


def until(steps: int, episodes: Iterable[Episode]) -> Iterator[Episode]:
    """The first episodes, as many as are needed for that many steps. A progress bar appears if it takes long."""
    from tqdm import tqdm

    with tqdm(total=steps, unit="step", unit_scale=True, delay=2.0, leave=False, disable=None) as bar:
        played = 0  # a bar that is not shown does not count
        for episode in episodes:
            yield episode
            bar.update(len(episode))
            played += len(episode)
            if played >= steps:
                return
