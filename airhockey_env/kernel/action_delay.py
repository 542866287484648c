"""A delay of a player's actions, compiled: what has been sent waits until the paddle obeys it.

A delay of k + f control steps, k whole and 0 <= f < 1, ends within a step: for a share f of it the paddle still obeys
the action of k + 1 steps ago, and for the rest that of k steps ago. So its target velocity in the step is the mean of
the two. Before the first action of an episode it is 0.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.compiled import compiled, inlined, records
from airhockey_env.kernel.history import sent_action
from airhockey_env.kernel.random_stream import draw_between

DELAY_STATE = np.dtype(
    [
        ("stream", np.uint64),  # state of the delay's own random stream
        ("steps", np.float64),  # the delay in this episode
        ("next", np.int64),  # place in the ring of the next action
    ],
    align=True,
)
"""What a delay keeps of one table, besides its ring."""


class DelayArrays(NamedTuple):
    """A player's delay: what it is drawn from, and all that it keeps of N tables."""

    range: NDArray[np.float64]  # (2,) steps, least and greatest delay
    states: NDArray[np.void]  # (N,) DELAY_STATE
    sent: NDArray[np.float32]  # (N, length, 2): the last actions, in a ring
    played: NDArray[np.float32]  # (N, 2): what the paddles obey in this step


def make_delay(low_ms: float, high_ms: float, num_tables: int, control_hz: float) -> DelayArrays:
    """A delay over so many tables, with room for all actions that can wait."""
    steps = np.array([low_ms, high_ms]) * control_hz / 1000.0
    states = records(num_tables, DELAY_STATE)
    states["steps"] = steps[0]
    length = math.floor(steps[1]) + 2
    sent = np.zeros((num_tables, length, 2), np.float32)
    return DelayArrays(steps, states, sent, np.zeros((num_tables, 2), np.float32))


@compiled
def delay_actions(first, last, drivers, actions, delays):
    """Work out what the paddles on the tables `first` to `last` (excluded) obey in the coming step, before `step_rows`.

    Args:
        drivers: (N,) int8, who drives the player's paddle.
        actions: (N, 2) float32, what the caller or a policy sends.
        delays: `DelayArrays`; changed in place.
    """
    length = delays.sent.shape[1]
    for i in range(first, last):
        state, sent = delays.states[i], delays.sent[i]
        now = state.next
        sent[now, 0], sent[now, 1] = sent_action(drivers[i], actions[i])
        state.next = now + 1 if now + 1 < length else 0
        whole = int(state.steps)
        share = state.steps - whole
        newer = now - whole if now >= whole else now - whole + length
        older = newer - 1 if newer > 0 else length - 1
        for axis in range(2):
            delays.played[i, axis] = share * float(sent[older, axis]) + (1.0 - share) * float(sent[newer, axis])


@inlined
def _begin(i, delays):
    state = delays.states[i]
    low, high = delays.range[0], delays.range[1]
    state.steps = draw_between(state, low, high) if low < high else low
    state.next = 0
    for k in range(delays.sent.shape[1]):
        delays.sent[i, k, 0] = 0.0
        delays.sent[i, k, 1] = 0.0


@compiled
def begin_delays(rows, delays):
    """Begin an episode on each of the given tables, with a delay of its own and without any actions."""
    for k in range(rows.shape[0]):
        _begin(rows[k], delays)


@compiled
def follow_delays(first, last, began, delays):
    """The same on those of the tables `first` to `last` (excluded) where an episode `began` in the step."""
    for i in range(first, last):
        if began[i]:
            _begin(i, delays)
