"""Blocks: some tables at a time in columns, so that the processor works on several of them at once.

The state of a game is one record for each table. A processor that adds eight numbers at once wants the same number of
eight tables side by side, so `step` copies the tables of a block into columns, does each of its passes on all of them,
and copies them back. What a pass does to table k of a block stands in a function of plain numbers, without regard to
all this; the compiler makes of its branches selections between results.

For that it must know that nothing is written where something else is still to be read. So all columns are in one
record, at distances that it knows, each of numbers of eight bytes; and the copying loops index the records from the
first one of all, without which it would gather their numbers one pass at a time, which is several times slower.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np
from numba.core import config
from numpy.typing import NDArray

from airhockey_env.compiled import compiled, inlined, records
from airhockey_env.kernel.state import LEFT, PUCK, RIGHT

TABLES = 120
"""Tables of a block, an even number: it fits into the first cache, and a loop over it is worth its beginning."""


class Params(NamedTuple):
    """What the passes need of a `PARAMETERS` record, by the same names."""

    tick: float
    half_length: float
    half_width: float
    half_goal: float
    disc_restitution: float
    glide_p: float
    glide_q: float
    glide_r: float
    glide_s: float
    bend: float
    puck_speed: float
    paddle_speed: float
    paddle_step: float
    clock_limit: float
    radius: tuple[float, float, float]


BLOCK = np.dtype(
    [
        *((name, np.float64, (TABLES,)) for name in Params._fields[:-1]),
        ("radius", np.float64, (3, TABLES)),
        # of STATE
        ("position", np.float64, (3, 2, TABLES)),
        ("velocity", np.float64, (3, 2, TABLES)),
        ("plan", np.float64, (TABLES,)),
        ("skill", np.float64, (2, TABLES)),
        ("score", np.int64, (2, TABLES)),
        ("steps", np.int64, (TABLES,)),
        ("clock", np.int64, (TABLES,)),
        ("side", np.int64, (TABLES,)),
        ("done", np.int64, (TABLES,)),
        # of this step
        ("begins", np.int64, (TABLES,)),  # an episode begins in it: nothing is played
        ("driver", np.int64, (TABLES,)),  # who drives the paddle in question
        ("action", np.float64, (2, 2, TABLES)),
        ("before", np.float64, (2, TABLES)),  # potentials that the shaping terms start from
        ("quiet", np.int64, (TABLES,)),  # nothing touches anything
        ("n_contacts", np.int64, (TABLES,)),
        ("point", np.int64, (TABLES,)),
        ("crossed", np.int64, (TABLES,)),  # the puck came to the other side
        ("foul", np.int64, (TABLES,)),
        ("terminated", np.int64, (TABLES,)),
        ("truncated", np.int64, (TABLES,)),
        ("success", np.int64, (TABLES,)),
        ("reward", np.float64, (2, TABLES)),
        ("hits", np.int32, (3,)),  # room for the engine's counts
    ],
    align=True,
)


def _room() -> NDArray[np.void]:
    """Room for the tables of a block: an array of one `BLOCK`, whose only element is to be taken where it is used.

    A record in compiled code does not keep alive the array that it is part of. Numba frees the array after its last
    use, and another thread may write there while the record is still in use.
    """
    return np.empty(1, BLOCK)


room_for_block = functools.partial(records, 1, BLOCK) if config.DISABLE_JIT else inlined(_room)  # type: ignore


@inlined
def params_at(block, k):
    """The parameters of table k of the block."""
    return Params(
        block.tick[k],
        block.half_length[k],
        block.half_width[k],
        block.half_goal[k],
        block.disc_restitution[k],
        block.glide_p[k],
        block.glide_q[k],
        block.glide_r[k],
        block.glide_s[k],
        block.bend[k],
        block.puck_speed[k],
        block.paddle_speed[k],
        block.paddle_step[k],
        block.clock_limit[k],
        (block.radius[LEFT, k], block.radius[RIGHT, k], block.radius[PUCK, k]),
    )


@inlined
def load_params(block, k, params):
    """Copy what `Params` has of a `PARAMETERS` record to table k of the block."""
    block.tick[k] = params.tick
    block.half_length[k] = params.half_length
    block.half_width[k] = params.half_width
    block.half_goal[k] = params.half_goal
    block.disc_restitution[k] = params.disc_restitution
    block.glide_p[k] = params.glide_p
    block.glide_q[k] = params.glide_q
    block.glide_r[k] = params.glide_r
    block.glide_s[k] = params.glide_s
    block.bend[k] = params.bend
    block.puck_speed[k] = params.puck_speed
    block.paddle_speed[k] = params.paddle_speed
    block.paddle_step[k] = params.paddle_step
    block.clock_limit[k] = params.clock_limit
    for disc in range(3):
        block.radius[disc, k] = params.radius[disc]


@inlined
def load_pair(block, k, one, other):
    """Copy two `STATE` records to the tables k and k + 1 of the block.

    Two at a time, and what is read of both before it is written: that takes half as many writes.
    """
    for disc in range(3):
        for axis in range(2):
            _write(block.position[disc, axis], k, one.position[disc, axis], other.position[disc, axis])
            _write(block.velocity[disc, axis], k, one.velocity[disc, axis], other.velocity[disc, axis])
    for player in range(2):
        _write(block.skill[player], k, one.skill[player], other.skill[player])
        _write(block.score[player], k, one.score[player], other.score[player])
    _write(block.plan, k, one.plan, other.plan)
    _write(block.steps, k, one.steps, other.steps)
    _write(block.clock, k, one.clock, other.clock)
    _write(block.side, k, one.side, other.side)
    _write(block.done, k, one.done, other.done)


@inlined
def _write(column, k, one, other):
    column[k] = one
    column[k + 1] = other


@inlined
def load_discs(block, k, state):
    """Copy where the discs of a `STATE` record are, and how they move, to table k of the block."""
    for disc in range(3):
        for axis in range(2):
            block.position[disc, axis, k] = state.position[disc, axis]
            block.velocity[disc, axis, k] = state.velocity[disc, axis]


@inlined
def store_discs(block, k, state):
    """Copy where the discs of table k of the block are, and how they move, back to its record."""
    for disc in range(3):
        for axis in range(2):
            state.position[disc, axis] = block.position[disc, axis, k]
            state.velocity[disc, axis] = block.velocity[disc, axis, k]


@compiled
def load_shared_params(block, n, params):
    """Copy the parameters that all tables share to n tables of the block."""
    for k in range(n):
        load_params(block, k, params)
