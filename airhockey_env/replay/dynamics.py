"""What decides how a recorded game plays: its arguments, and a fingerprint of what comes of them."""

from __future__ import annotations

import dataclasses
import hashlib
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from airhockey_env.actions import DIRECTIONS
from airhockey_env.checks import NO_LIMIT
from airhockey_env.game import REWARDS, Game
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.players import NAMES
from airhockey_env.tables import FIELDS, TableSpec

ROLLOUT_TABLES, ROLLOUT_STEPS, ROLLOUT_LIMIT = 16, 150, 60
"""The fingerprint's rollout: tables, steps on each, and steps that end an episode."""

ROLLOUT_FIELDS = ("position", "velocity", "stream", "clock", "side", "done", "score", "plan", "wander")


def arguments_of(game: Game, place: int = 0) -> dict[str, Any]:
    """All that decides how a game on one table plays, ready for JSON.

    Args:
        game: the game.
        place: of the table's opponent in the game's pool. One from outside is None.
    """
    settings = game.settings[0]
    opponents = game.pools[RIGHT].members
    opponent = opponents[place] if opponents else None
    return {
        "task": next(name for name, task in TASKS.items() if task.number == settings["task"]),
        "opponent": recorded_name(opponent),
        "table": dataclasses.asdict(game.spec),
        "continuous": game.continuous or game.interfaces[LEFT].delay is not None,  # of what reaches the paddle
        "reward": REWARDS[int(settings["shaped"])],
        "control_hz": game.control_hz,
        "randomize": {name: game.ranges[FIELDS.index(name)].tolist() for name in game.randomized} or None,
        "points": int(settings["points"]),
        "max_episode_steps": int(settings["max_steps"]) or NO_LIMIT,
    }


def recorded_name(opponent: Any) -> str | None:
    """The name by which a replay knows an opponent; None for one whose actions it has to keep."""
    return opponent if isinstance(opponent, str) and opponent in NAMES else None


def make_game(arguments: dict[str, Any], num_tables: int = 1, **changes: Any) -> Game:
    """The game that `arguments_of` describes."""
    table = TableSpec(**arguments["table"])
    if not (arguments["opponent"] is None or arguments["opponent"] in NAMES):  # and not a path: a replay opens no file
        raise ValueError(f"opponent must be null or one of {NAMES}, got {arguments['opponent']!r}")
    limit = arguments["max_episode_steps"] or NO_LIMIT  # which was null in files of older versions
    given = {**arguments, "table": table, "max_episode_steps": limit, "num_threads": 1}
    given["right"] = given.pop("opponent")
    return Game(num_tables, **{"autoreset_mode": AutoresetMode.DISABLED, **given, **changes})


def play_actions(game: Game, action: Any, right_action: NDArray[np.float32] | None) -> None:
    """Play one step on the one table of a game.

    Args:
        game: the game.
        action: of the left player, as a replay holds it.
        right_action: (2,) likewise of a right player whose actions are recorded.
    """
    left = game.check_actions(LEFT, np.asarray(action)[np.newaxis] if game.continuous else [int(action)])
    game.play(left, None if right_action is None else right_action[np.newaxis])


def fingerprint(arguments: dict[str, Any]) -> str:
    """A hash of how a game plays: of a short rollout from fixed seeds with fixed actions, on a few tables.

    Raises:
        ValueError, TypeError: not arguments of a game.
    """
    n = ROLLOUT_TABLES
    changes = {"max_episode_steps": ROLLOUT_LIMIT, "autoreset_mode": AutoresetMode.SAME_STEP}
    game = make_game(arguments, n, **changes)
    game.reset(seed=0)
    chases = np.arange(n)[:, np.newaxis] % 2 == 0
    digest = hashlib.sha256()
    for step in range(ROLLOUT_STEPS):
        places = game.positions
        direction = DIRECTIONS[(step // 8 + np.arange(n)) % len(DIRECTIONS)]
        left = np.where(chases, 5.0 * (places[:, PUCK] - places[:, LEFT]), direction)
        right = np.where(chases, 5.0 * (places[:, RIGHT] - places[:, PUCK]), direction)
        right_actions = right.astype(np.float32) if arguments["opponent"] is None else None
        game.play(left.astype(np.float32), right_actions)
        for name in ROLLOUT_FIELDS:
            digest.update(game.states[name].tobytes())
        digest.update(game.out.reward.tobytes())
    return digest.hexdigest()[:32]
