"""Functions and constants that the tests of several files share."""

from __future__ import annotations

import copy
import math
import os
import pickle
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import airhockey_env
from airhockey_env.cameras import Camera
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.live import LiveMatch
from airhockey_env.opponents.policy import MlpPolicy

ROOT = Path(__file__).parents[1]
"""The checkout."""

NAN, INF = math.nan, math.inf

SHOT = {"puck_position": (1.0, 0.1), "puck_velocity": (5.0, 0.0)}
"""Reset options: a puck past an idle right paddle that is in the goal in the second step at 50 Hz."""
SHOT_BACK = {"puck_position": (-1.0, -0.1), "puck_velocity": (-5.0, 0.0)}
"""Its mirror image."""

IDS = sorted(
    name for name, spec in gymnasium.registry.items() if str(spec.entry_point).startswith(airhockey_env.__name__)
)
"""Every environment that the package registers."""

COPIES = {"deepcopy": copy.deepcopy, "pickle": lambda thing: pickle.loads(pickle.dumps(thing))}

HEAVY = Camera(
    camera_hz=77,
    delay_ms=33,
    jitter_ms=30,
    noise_mm=5,
    opponent_noise_mm=3,
    velocity_frames=3,
    dropout=0.2,
    occlusion_mm=300,
)
"""A camera that does all that cameras do, at a rate that is not the control rate's."""

DRAWN = Camera(
    camera_hz=(20, 90),
    delay_ms=(0, 50),
    jitter_ms=(0, 60),
    noise_mm=(0, 10),
    opponent_noise_mm=(1, 2),
    velocity_frames=(2, 9),
    dropout=(0.1, 0.3),
    occlusion_mm=(0, 300),
)
"""A camera that is another one in every episode of every table, in every respect."""

Call = Callable[..., str]
"""The fixture `call`: from a command's name and arguments to what it prints; `fails=True` where it must fail."""


# Games


def pursue(seen: np.ndarray) -> np.ndarray:
    """A policy that can be pickled: chase the puck, from observations (N, 13) to actions (N, 2)."""
    return 5.0 * (seen[:, 8:10] - seen[:, 0:2])


def shown(value: Any) -> str:
    """A parameter as a part of a test's name; without functions' addresses, which differ from process to process."""
    return re.sub(r"<function ([\w<>.]+) at \w+>", r"\1", str(value))


def random_actions(seed: int, steps: int, num_envs: int, continuous: bool = True) -> np.ndarray:
    """Actions that change now and then, some of them out of range: (steps, num_envs, ...)."""
    rng = np.random.default_rng(seed)
    held = -(-steps // 8)
    if continuous:
        drawn = rng.uniform(-1.3, 1.3, (held, num_envs, 2)).astype(np.float32)
    else:
        drawn = rng.integers(9, size=(held, num_envs))
    return np.repeat(drawn, 8, axis=0)[:steps]


def same(first: Any, second: Any) -> bool:
    """Whether two results are alike to the bit: arrays (types included), infos, and what they hold."""
    if isinstance(first, dict):
        return (
            isinstance(second, dict) and first.keys() == second.keys() and all(same(first[k], second[k]) for k in first)
        )
    if isinstance(first, (tuple, list)):
        return type(first) is type(second) and len(first) == len(second) and all(map(same, first, second))
    if isinstance(first, np.ndarray) and first.dtype == object:
        return isinstance(second, np.ndarray) and len(first) == len(second) and all(map(same, first, second))
    if isinstance(first, (np.ndarray, np.generic)):
        return first.dtype == second.dtype and first.shape == second.shape and first.tobytes() == second.tobytes()
    return bool(first == second)


def handed(env: Any, rows: Any) -> Any:
    """Actions, one a table or a player, as an API takes them: (2, ...) for two players, else a row or all rows."""
    if hasattr(env, "possible_agents"):
        return dict(zip(env.possible_agents, rows, strict=True))
    return rows if hasattr(env, "num_envs") else rows[0]


def begin(env: Any, steps: int = 10, **arguments: Any) -> Any:
    """A game of any API with one or two tables, after some steps; what `reset` takes may be given."""
    if hasattr(env, "env_method"):  # Stable-Baselines3 takes the seed before
        env.seed(1)
        env.reset()
    else:
        env.reset(**{"seed": 1, **arguments})
    for rows in random_actions(1, steps, 2, env._game.continuous):
        env.step(handed(env, rows))
    return env


def play(env: Any, steps: int, seed: int = 0) -> list[Any]:
    """Everything that a game of any API returns, with a reset where an episode ends for good."""
    results: list[Any] = []
    for rows in random_actions(seed, steps, 2, env._game.continuous):
        result = env.step(handed(env, rows))
        results.append(result)
        if hasattr(env, "possible_agents"):
            over = not env.agents
        else:
            over = not hasattr(env, "num_envs") and (result[2] or result[3])
        if over:
            results.append(env.reset())
    return results


def snapshot(env: Any) -> tuple[Any, ...]:
    """All that decides what follows, and what is seen of it, of a game of any API."""
    game = env._game
    if hasattr(env, "possible_agents"):
        other: Any = list(env.agents)
    else:
        sb3 = hasattr(env, "env_method")
        other = str((env._actions, env._seeds, env._options) if sb3 else env.np_random.bit_generator.state)
    return game.get_state().tobytes(), game.out.observation.tobytes(), other


def turned(tables: NDArray[np.void]) -> NDArray[np.void]:
    """The same tables, (N,) of their states, seen from the other side: turned by 180 degrees, the players swapped."""
    other = tables.copy()
    for name in ("position", "velocity"):
        other[name] = 0.0 - tables[name][:, [RIGHT, LEFT, PUCK]]
    other["side"] = -tables["side"]
    for name in ("score", "member", "skill", "wander"):
        other[name] = tables[name][:, ::-1]
    return other


def save_match(path: Path, opponent: str, skill: float, points: int = 3) -> Path:
    """Save the replay of a match in which somebody points at the puck, and which goes on for a while after `points`."""
    match = LiveMatch(opponent, skill=skill, points=7, recorded=True, seed=1)
    now = 0.0
    while sum(match.score) < points:
        now += 1 / 60
        assert now < 600.0
        x, y = match.positions[PUCK].tolist()
        match.advance(now, (x - 0.03, y))
    for _ in range(90):
        now += 1 / 60
        match.advance(now)
    match.replay().save(path)
    return path


# Policies


def some_policy(outputs: int = 2, activation: str = "tanh", seed: int = 3, stack: int = 1) -> MlpPolicy:
    """A policy with two hidden layers and random weights, that can be saved to a file."""
    random = np.random.default_rng(seed)
    sizes = (13 if stack == 1 else 15 * stack, 8, 8, outputs)
    weights = [random.normal(0.0, 0.5, (after, before)).astype(np.float32) for before, after in pairwise(sizes)]
    biases = [random.normal(0.0, 0.1, size).astype(np.float32) for size in sizes[1:]]
    return MlpPolicy(weights, biases, activation, stack=stack)


def still_policy() -> MlpPolicy:
    """A policy of one layer that does nothing."""
    return MlpPolicy([np.zeros((2, 13), np.float32)], [np.zeros(2, np.float32)])


def some_observations(number: int = 200) -> NDArray[np.float32]:
    """(number, 13), whatever they may mean."""
    return np.random.default_rng(5).uniform(-1.0, 1.0, (number, 13)).astype(np.float32)


# Commands


def start(script: str, *arguments: str, folder: Path) -> subprocess.Popen[str]:
    """Start a command as a user does, from `folder`."""
    return subprocess.Popen(
        [sys.executable, "-m", f"scripts.{script}", *arguments],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "100"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        # A shell's background jobs do not get Ctrl-C; this process does, however the tests were started.
        preexec_fn=None if os.name == "nt" else lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def run(script: str, *arguments: str, folder: Path) -> str:
    """Run a command to its end; what it printed."""
    process = start(script, *arguments, folder=folder)
    printed, _ = process.communicate(timeout=300)
    assert process.returncode == 0, printed
    assert "Traceback" not in printed
    return printed
