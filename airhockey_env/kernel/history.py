"""A player's history, compiled: its last observations, each with the action that led to it, from the oldest on.

A row of it has the columns of the observation and then the action (x, y), as a target velocity in [-1, 1]. At the start
of an episode all rows are the first observation, without an action.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled, inlined
from airhockey_env.kernel.scripted import EXTERNAL
from airhockey_env.kernel.state import OBSERVATION_SIZE, ROW_SIZE


@inlined
def sent_action(driver, action):
    """What the caller or a policy has sent to its paddle, (x, y); scripted players send nothing."""
    if driver != EXTERNAL:
        return np.float32(0.0), np.float32(0.0)
    x, y = action[0], action[1]
    return min(max(x, np.float32(-1.0)), np.float32(1.0)), min(max(y, np.float32(-1.0)), np.float32(1.0))


@inlined
def _push(rows, last, observation, x, y):
    """Move all rows, laid out one after the other, up by one; `last` is where the newest begins."""
    for k in range(last):
        rows[k] = rows[k + ROW_SIZE]
    for k in range(OBSERVATION_SIZE):
        rows[last + k] = observation[k]
    rows[last + OBSERVATION_SIZE] = x
    rows[last + OBSERVATION_SIZE + 1] = y


@inlined
def _fill(rows, observation):
    """Begin an episode."""
    for first in range(0, rows.shape[0], ROW_SIZE):
        for k in range(OBSERVATION_SIZE):
            rows[first + k] = observation[k]
        rows[first + OBSERVATION_SIZE] = 0.0
        rows[first + OBSERVATION_SIZE + 1] = 0.0


@compiled
def follow_history(
    first, last, drivers, actions, history, final, observation, final_observation, began, terminated, truncated
):  # fmt: skip
    """Add a row for a step of the tables `first` to `last` (excluded), after `step_rows` and the player's camera.

    Args:
        drivers: (N,) int8, who drives the player's paddle.
        actions: (N, 2) float32, what the caller or a policy has sent.
        history: (N, K, ROW_SIZE) float32; changed in place.
        final: likewise, or (0, K, ROW_SIZE) if no episode begins in the step that ends another; written for those.
        observation, final_observation: (N, OBSERVATION_SIZE) float32.
        began, terminated, truncated: (N,) bool, of `Outputs`.
    """
    n, size = history.shape[0], history.shape[1] * ROW_SIZE
    flat, flat_final = history.reshape(n, size), final.reshape(final.shape[0], size)
    newest = size - ROW_SIZE
    for i in range(first, last):
        if not began[i]:
            x, y = sent_action(drivers[i], actions[i])
            _push(flat[i], newest, observation[i], x, y)
            continue
        if terminated[i] or truncated[i]:  # the end came in the same step
            x, y = sent_action(drivers[i], actions[i])
            _push(flat[i], newest, final_observation[i], x, y)
            for k in range(size):
                flat_final[i, k] = flat[i, k]
        _fill(flat[i], observation[i])


@compiled
def start_history(rows, history, observation):
    """Begin an episode on each of the given tables, after `reset_rows` and the player's camera."""
    flat = history.reshape(history.shape[0], history.shape[1] * ROW_SIZE)
    for k in range(rows.shape[0]):
        _fill(flat[rows[k]], observation[rows[k]])


def next_history(
    history: NDArray[np.float32] | None, observations: NDArray[np.float32], actions: NDArray[np.float32], length: int
) -> NDArray[np.float32]:
    """A history of this length with another row, (N, length, ROW_SIZE), for those who keep one outside of a game.

    Args:
        history: as it was; None, or one of another length, at the start.
        observations: (N, OBSERVATION_SIZE).
        actions: (N, 2) that led to them; zeros at the start.
    """
    row = np.concatenate([observations, np.clip(actions, -1.0, 1.0)], axis=1, dtype=np.float32)[:, np.newaxis]
    if history is None or history.shape[1] != length:
        return np.repeat(row, length, axis=1)
    return np.concatenate([history[:, 1:], row], axis=1)


def longer(history: NDArray[np.float32], length: int) -> NDArray[np.float32]:
    """A history with more rows, (N, length, ROW_SIZE): those that are not known are like the oldest one."""
    more = np.repeat(history[:, :1], length - history.shape[1], axis=1)
    return np.concatenate([more, history], axis=1)
