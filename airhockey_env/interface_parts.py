"""The parts of a player's interface: a delay of its actions, a camera, and a history of what it saw and did.

Each does its share of what happens to a game: an episode begins, a step is played, a state is saved or put back.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airhockey_env.cameras import Camera
from airhockey_env.kernel.action_delay import begin_delays, delay_actions, follow_delays, make_delay
from airhockey_env.kernel.camera import (
    ARRIVES,
    CAMERA_STATE,
    MOMENT,
    VELOCITY_FRAMES,
    derive_rows,
    follow_rows,
    make_camera,
    show_rows,
    start_rows,
)
from airhockey_env.kernel.history import follow_history, longer, start_history
from airhockey_env.kernel.outputs import Outputs
from airhockey_env.kernel.state import AUTORESET_SAME_STEP, OBSERVATION_SIZE, ROW_SIZE

_CAMERA_FLOATS = tuple(name for name in CAMERA_STATE.names or () if CAMERA_STATE[name].base.kind == "f")


class Tables(NamedTuple):
    """What the parts need of the game."""

    number: int  # N
    control_hz: float
    parameters: NDArray[np.void]  # (1,) or (N,) PARAMETERS
    settings: NDArray[np.void]  # (1,) SETTINGS
    drivers: NDArray[np.int8]  # (2, N): who drives each paddle
    out: Outputs


def _stream(seed: int, number: int) -> np.uint64:
    """The state of a random stream of a table's own, besides the one that the game has for this seed."""
    return np.random.SeedSequence(seed, spawn_key=(number,)).generate_state(1, np.uint64)[0]


class Part:
    """One thing between the player of a seat and the table. What it does not need to do, it leaves as it is here."""

    what = ""
    """What errors call it."""

    def __init__(self, seat: int, tables: Tables) -> None:
        self.seat, self._tables = seat, tables

    def kept(self) -> dict[str, NDArray[Any]]:
        """All that it keeps of the tables and that decides what follows: arrays (N, ...), by what they are called."""
        return {}

    def seed(self, i: int, seed: int) -> None:
        """Start its random stream of table i."""

    def start(self, rows: NDArray[np.int64]) -> None:
        """Begin an episode on the given tables, after `reset_rows`."""

    def follow(self, first: int, last: int, actions: NDArray[np.float32]) -> None:
        """Follow a step of the tables `first` to `last` (excluded), after `step_rows`.

        Args:
            actions: (N, 2) what the caller or a policy has sent, on the tables where one of them plays.
        """

    def show(self, rows: NDArray[np.int64]) -> None:
        """Bring the given tables up to date after `refresh_rows`."""

    def could_be(
        self, saved: Mapping[str, NDArray[Any]], states: NDArray[np.void], parameters: NDArray[np.void]
    ) -> bool:
        """Tell whether it could be in saved states, (n, ...) by the names of `kept`: compiled code counts on it.

        Args:
            saved: by these names.
            states: (n,) `STATE` of the same tables.
            parameters: (1,) or (n,) `PARAMETERS` likewise.
        """
        return True


class DelayPart(Part):
    """A delay of the player's actions."""

    what = "delay of actions"

    def __init__(self, seat: int, tables: Tables, low_ms: float, high_ms: float) -> None:
        super().__init__(seat, tables)
        self.arrays = make_delay(low_ms, high_ms, tables.number, tables.control_hz)

    def kept(self) -> dict[str, NDArray[Any]]:
        return {"action_delay": self.arrays.states, "sent_actions": self.arrays.sent}

    def seed(self, i: int, seed: int) -> None:
        self.arrays.states["stream"][i] = _stream(seed, 3 + self.seat)

    def act(self, first: int, last: int, actions: NDArray[np.float32]) -> NDArray[np.float32]:
        """What the paddles on the tables `first` to `last` (excluded) obey in the coming step, (N, 2)."""
        delay_actions(first, last, self._tables.drivers[self.seat], actions, self.arrays)
        return self.arrays.played

    def start(self, rows: NDArray[np.int64]) -> None:
        begin_delays(rows, self.arrays)

    def follow(self, first: int, last: int, actions: NDArray[np.float32]) -> None:
        follow_delays(first, last, self._tables.out.began, self.arrays)

    def could_be(
        self, saved: Mapping[str, NDArray[Any]], states: NDArray[np.void], parameters: NDArray[np.void]
    ) -> bool:
        state, sent, (low, high) = saved["action_delay"], saved["sent_actions"], self.arrays.range
        return bool(
            ((state["steps"] >= low) & (state["steps"] <= high)).all()
            and ((state["next"] >= 0) & (state["next"] < sent.shape[1])).all()
            and (np.abs(sent) <= 1.0).all()
        )


class CameraPart(Part):
    """A camera, which shows the player the opponent's paddle and the puck."""

    what = "camera"

    def __init__(self, seat: int, tables: Tables, camera: Camera) -> None:
        super().__init__(seat, tables)
        self.arrays = make_camera(camera, tables.number, tables.control_hz)

    def kept(self) -> dict[str, NDArray[Any]]:
        camera, ranges, states, queue, past = self.arrays
        kept = {"camera": states, "camera_queue": queue, "camera_past": past}
        return {**kept, "camera_drawn": camera} if len(ranges) else kept

    def seed(self, i: int, seed: int) -> None:
        self.arrays.states["stream"][i] = _stream(seed, 1 + self.seat)

    def start(self, rows: NDArray[np.int64]) -> None:
        start_rows(rows, self.seat, self._tables.parameters, self.arrays, self._tables.out)

    def follow(self, first: int, last: int, actions: NDArray[np.float32]) -> None:
        follow_rows(first, last, self.seat, self._tables.parameters, self.arrays, self._tables.out)

    def show(self, rows: NDArray[np.int64]) -> None:
        show_rows(rows, self.seat, self.arrays, self._tables.out)

    def could_be(
        self, saved: Mapping[str, NDArray[Any]], states: NDArray[np.void], parameters: NDArray[np.void]
    ) -> bool:
        arrays, state = self.arrays, saved["camera"]
        queue, past, camera = saved["camera_queue"], saved["camera_past"], saved.get("camera_drawn", arrays.camera)
        begun = states["side"] != 0
        due = np.floor((state["step"] + MOMENT) * camera["camera_hz"] / camera["control_hz"]) + 1
        latest = state["step"] + camera["delay"] + camera["jitter"] + 2.0 * MOMENT  # that a frame so far can arrive
        frames = np.maximum(camera["frames"], 1)[:, np.newaxis]
        per_disc = [
            [parameters[name] for name in ("per_x", "per_y", speed, speed)] for speed in ("per_paddle", "per_puck")
        ]
        scale = np.moveaxis(np.array(per_disc), -1, 0)
        return bool(
            self._could_be_drawn(camera)
            and all(np.isfinite(array).all() for array in (*(state[name] for name in _CAMERA_FLOATS), queue, past))
            and ((state["first"] >= 0) & (state["first"] < queue.shape[1])).all()
            and ((state["waiting"] >= 0) & (state["waiting"] <= queue.shape[1])).all()
            and ((state["known"] >= 0) & (state["known"] <= frames)).all()
            and ((state["next"] >= 0) & (state["next"] < frames)).all()
            and ((state["step"] == states["steps"]) | ~begun).all()
            and ((np.abs(state["frame"] - due) <= 1) | ~begun).all()
            and (queue[..., ARRIVES].max(axis=1) <= latest).all()
            and ((state["scale"] == scale).all(axis=(1, 2)) | ~begun).all()
        )

    def _could_be_drawn(self, camera: NDArray[np.void]) -> bool:
        """Whether these are cameras that episodes draw: in the ranges, and with all else following from that."""
        ranges = self.arrays.ranges
        derived = camera.copy()
        if len(ranges):
            derived["control_hz"] = self.arrays.camera["control_hz"][0]
            derived["spec"] = np.clip(camera["spec"], ranges[:, 0], ranges[:, 1])
            derived["spec"][:, VELOCITY_FRAMES] = np.floor(derived["spec"][:, VELOCITY_FRAMES])
            derive_rows(derived)
        return bool(np.isfinite(camera["spec"]).all()) and derived.tobytes() == camera.tobytes()


class HistoryPart(Part):
    """What the player has seen and done last."""

    what = "history"

    def __init__(self, seat: int, tables: Tables, length: int) -> None:
        super().__init__(seat, tables)
        self.rows = np.zeros((tables.number, 1, ROW_SIZE), np.float32)
        self.rows[:, 0, :OBSERVATION_SIZE] = tables.out.observation[seat]
        self.lengthen(length)

    def lengthen(self, length: int) -> None:
        """Keep so many rows from now on."""
        self.rows = longer(self.rows, length)
        same_step = self._tables.settings["autoreset"][0] == AUTORESET_SAME_STEP
        self.final = np.zeros((len(self.rows) if same_step else 0, *self.rows.shape[1:]), np.float32)

    def kept(self) -> dict[str, NDArray[Any]]:
        return {"history": self.rows}

    def start(self, rows: NDArray[np.int64]) -> None:
        start_history(rows, self.rows, self._tables.out.observation[self.seat])

    def follow(self, first: int, last: int, actions: NDArray[np.float32]) -> None:
        out, seat = self._tables.out, self.seat
        observations = out.observation[seat], out.final_observation[seat]
        ends = out.began, out.terminated, out.truncated
        drivers = self._tables.drivers[seat]
        follow_history(first, last, drivers, actions, self.rows, self.final, *observations, *ends)

    def show(self, rows: NDArray[np.int64]) -> None:
        self.rows[rows, -1, :OBSERVATION_SIZE] = self._tables.out.observation[self.seat][rows]

    def could_be(
        self, saved: Mapping[str, NDArray[Any]], states: NDArray[np.void], parameters: NDArray[np.void]
    ) -> bool:
        return bool((np.abs(saved["history"]) <= 1.0).all())
