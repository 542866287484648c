"""The options of a reset: how an episode begins."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.checks import check_choice, check_pair, fault
from airhockey_env.engine.tolerances import OVERLAP
from airhockey_env.kernel.state import HOME
from airhockey_env.kernel.tasks import right_start
from airhockey_env.tables import TableSpec

SERVERS = {"random": 0, "left": -1, "right": 1}


class ResetOptions(NamedTuple):
    """How an episode begins."""

    serve: str = "random"  # one of SERVERS
    puck_position: NDArray[np.float64] | None = None  # (2,) m, in place of the served one
    puck_velocity: NDArray[np.float64] | None = None  # (2,) m/s

    def puck(self) -> NDArray[np.float64]:
        """Position, velocity and speed as `kernel.rules.place_puck` takes them, (5,), NaN where none is given."""
        puck = np.full(5, np.nan)
        if self.puck_position is not None:
            puck[:2] = self.puck_position
        if self.puck_velocity is not None:
            puck[2:] = *self.puck_velocity, max(math.hypot(*self.puck_velocity), 1e-300)
        return puck


def check_reset_options(
    options: Mapping[str, Any] | None, spec: TableSpec, task: int, randomized: bool
) -> ResetOptions:
    """`options` of a reset, checked; see `AirHockeyEnv.reset`.

    Args:
        spec: the table that was asked for.
        task: its number.
        randomized: whether another may be drawn in its place.

    Raises:
        ValueError: one is unknown or out of range.
    """
    options = {} if options is None else options
    if not isinstance(options, Mapping):
        raise fault("options", "a mapping or None", options)
    for name in options:
        if name not in ResetOptions._fields:
            raise fault("options", f"a mapping whose keys are among {ResetOptions._fields}", name)
    serve = check_choice("options['serve']", options.get("serve", "random"), SERVERS)
    place, velocity = options.get("puck_position"), options.get("puck_velocity")
    if place is not None:
        place = check_pair("options['puck_position']", place)
        limit = np.array([0.5 * spec.length, 0.5 * spec.width]) - spec.puck_radius
        if (np.abs(place) > limit + OVERLAP).any():
            raise ValueError(
                f"options['puck_position'] must be at most ({limit[0]:.4g}, {limit[1]:.4g}) m from the centre, "
                f"got {tuple(place.tolist())}"
            )
        if randomized:
            raise ValueError("options['puck_position'] does not go with randomize: the table is not known yet")
        reach = spec.paddle_radius + spec.puck_radius
        for x, y in ((-0.5 * HOME * spec.length, 0.0), right_start(spec, task)):
            if math.dist(place, (x, y)) < reach - OVERLAP:
                raise ValueError(
                    f"options['puck_position'] must be at least {reach:.4g} m from the paddle that starts at "
                    f"({x:.4g}, {y:.4g}), got {tuple(place.tolist())}"
                )
    if velocity is not None:
        velocity = check_pair("options['puck_velocity']", velocity)
        if math.hypot(*velocity) > spec.puck_speed:
            raise ValueError(
                f"options['puck_velocity'] must be at most {spec.puck_speed:.4g} m/s, got {tuple(velocity.tolist())}"
            )
    return ResetOptions(serve, place, velocity)
