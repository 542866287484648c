"""A policy at a real table: from what a camera, encoders and a referee tell to target velocities of a paddle."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airhockey_env.checks import as_array, as_float, check_number, check_pair, check_velocities, check_whole, fault
from airhockey_env.kernel.history import next_history
from airhockey_env.kernel.observations import CLOCK_COLUMN, OTHER_PADDLE, OWN_PADDLE, PUCK_COLUMNS, scales_of
from airhockey_env.kernel.scripted import EXTERNAL
from airhockey_env.kernel.state import OBSERVATION_SIZE, SHOT_CLOCK
from airhockey_env.opponents.players import Player, driver_of, policy_of, resolve_player, stack_of
from airhockey_env.tables import TableSpec, resolve_table


class Command(NamedTuple):
    """What a `Controller` tells a robot to do until the next control step."""

    action: NDArray[np.float32]
    """(2,) what the policy chose: the target velocity as a share of the paddle's greatest speed, in [-1, 1]."""
    velocity: NDArray[np.float64]
    """(2,) m/s: the same as the paddle of an environment takes it, at most the paddle's greatest speed long."""


class Controller:
    """Plays a policy that was trained in simulation, on a robot.

    It does what an environment with a camera does between the table and a player: it keeps the last position at which
    each disc was seen, estimates velocities, scales everything to an observation, stacks observations and actions, and
    asks the policy. Call `reset` at a serve, `see` with every frame, and `act` at every control step, as many times per
    second as in the training of the policy.

    Positions and velocities are those of the player's own side: the origin is the middle of the table, x points away
    from the own goal along the table, and y to the left. They are in m and m/s, and times in s.

    Args:
        policy: the name of a trained opponent, the path of a `policy.npz` or of a run's folder, or a callable from
            float32 observations (1, 13), or (1, K, 15) if its attribute `stack` is K > 1, to actions (1, 2).
        table: the table that the policy was trained for, as the environments take it. Its sizes and greatest speeds are
            the scales of the observations.
        velocity_frames: 2 to 64, the number of frames from which velocities are estimated: that of the `Camera` that
            the policy was trained with. The default is that of `ROBOT`.

    Attributes:
        observation: what the policy was shown last, float32 (13,) or (K, 15); None before the first `act`.

    Raises:
        ValueError: no such policy or table, or `velocity_frames` is out of range.
    """

    def __init__(
        self,
        policy: Player,
        table: str | TableSpec | Mapping[str, float] = "full_size",
        velocity_frames: int = 6,
    ) -> None:
        member = resolve_player("policy", policy)
        if driver_of(member) != EXTERNAL:
            raise fault("policy", "a trained policy, which acts on observations", policy)
        self._policy, self._stack = policy_of(member), stack_of(member)
        self._table = resolve_table(table)
        self._per_unit = 1.0 / scales_of(self._table)
        frames = check_whole("velocity_frames", velocity_frames, 2, 64)
        self._puck, self._opponent = _Track(frames), _Track(frames)
        self.reset()

    def reset(self) -> None:
        """Begin a point: forget all that was seen and done. The paddles and the puck rest when it is called."""
        self._puck.clear()
        self._opponent.clear()
        self._time = -math.inf
        self._history: NDArray[np.float32] | None = None
        self._action = np.zeros((1, 2), np.float32)
        self.observation: NDArray[np.float32] | None = None

    @property
    def ready(self) -> bool:
        """Whether the puck and the opponent's paddle were seen since `reset`, so that `act` can be called."""
        return bool(self._puck) and bool(self._opponent)

    def see(self, time: float, puck: ArrayLike | None, opponent: ArrayLike | None) -> None:
        """Take in a frame. What was not found in it keeps the position and velocity of the frames before.

        Args:
            time: when the frame was taken, s, on any clock that does not jump; later than the frame before.
            puck: its centre, (2,) m; None or NaN if it was not found.
            opponent: likewise, the centre of the opponent's paddle.

        Raises:
            ValueError: an argument is not as it must be. The frame is not taken in then.
        """
        taken = as_float(time)
        if taken is None or not self._time < taken < math.inf:
            raise fault("time", f"a finite number greater than that of the frame before, {self._time}", time)
        seen = [(self._puck, _found("puck", puck)), (self._opponent, _found("opponent", opponent))]
        self._time = taken
        for track, position in seen:
            if position is not None:
                track.append(taken, position)

    def act(self, position: ArrayLike, velocity: ArrayLike, clock: float = 0.0) -> Command:
        """Choose what to do until the next control step.

        Args:
            position: centre of the own paddle, (2,) m, from its encoders.
            velocity: of the own paddle, (2,) m/s.
            clock: -7 to 7 s: the time that the puck has been on the own side, or minus the time that it has been on the
                other side; 0 if nobody measures it.

        Raises:
            ValueError: an argument is not as it must be, or the policy returns something other than an action.
            RuntimeError: the puck or the opponent's paddle was not seen yet; see `ready`.
        """
        own = check_pair("position", position), check_pair("velocity", velocity)
        clock = check_number("clock", clock, -SHOT_CLOCK, SHOT_CLOCK)
        if not self.ready:
            raise RuntimeError("act needs a frame with the puck and one with the opponent's paddle since reset")
        values = np.empty(OBSERVATION_SIZE)
        values[OWN_PADDLE] = np.concatenate(own)
        values[OTHER_PADDLE] = self._opponent.state()
        values[PUCK_COLUMNS] = self._puck.state()
        values[CLOCK_COLUMN] = clock
        shown = (values * self._per_unit).clip(-1.0, 1.0).astype(np.float32)[np.newaxis]
        if self._stack > 1:
            shown = self._history = next_history(self._history, shown, self._action, self._stack)
        self.observation = shown[0]
        answer = check_velocities("what policy returns", self._policy(shown.copy()), (1, 2))
        self._action = answer.clip(-1.0, 1.0)
        action = self._action[0].copy()
        return Command(action, action * self._table.paddle_speed / max(1.0, math.hypot(*action)))


class _Track:
    """The last positions at which a disc was seen."""

    def __init__(self, length: int) -> None:
        self._seen: deque[tuple[float, float, float]] = deque(maxlen=length)

    def __bool__(self) -> bool:
        return bool(self._seen)

    def clear(self) -> None:
        self._seen.clear()

    def append(self, time: float, position: NDArray[np.float64]) -> None:
        self._seen.append((time, *position))

    def state(self) -> NDArray[np.float64]:
        """Its last position and its velocity, (4,) m and m/s.

        The velocity is the slope of the least-squares line through the positions over the times of their frames, and 0
        while there is only one.
        """
        rows = np.array(self._seen)
        rows, last = rows - rows[0], rows[-1]  # from one of them on, so that little is lost to rounding
        times = rows[:, 0] - rows[:, 0].mean()
        spread = times @ times
        velocity = times @ rows[:, 1:] / spread if spread > 0.0 else np.zeros(2)
        return np.concatenate([last[1:], velocity])


def _found(name: str, value: Any) -> NDArray[np.float64] | None:
    """A position as a tracker gives it, or None where it found none."""
    given = None if value is None else as_array(value)
    if value is None or (given is not None and given.shape == (2,) and np.isnan(given).any()):
        return None
    return check_pair(name, value, also="None or NaN")
