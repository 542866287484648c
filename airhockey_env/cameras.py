"""Cameras as frozen, validated data, in the units of their data sheets: Hz, ms, mm."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from airhockey_env.checks import check_number_or_range, check_whole_or_range, fault

Number = float | tuple[float, float]
"""A number, or the least and the greatest of those that are drawn from."""


@dataclass(frozen=True)
class Camera:
    """How a camera above the table sees the puck and the opponent's paddle. The defaults are a perfect camera.

    The player's own paddle, which has encoders, and the shot clock, which belongs to the referee, stay exact. Derive a
    variant with `dataclasses.replace(ROBOT, delay_ms=20)`.

    Every field may also be a range (low, high): each table draws its own camera for each episode then, evenly between
    the two. If a range is as wide as one value, it is that value.

    Raises:
        ValueError: a field is not a finite number or is out of range. The message names the field, what was given
            and what is allowed.
    """

    camera_hz: Number | None = None
    """Frames per second, 1 to 1000; None: one per control step. The first is taken at the start of an episode. Below
    the control rate, the last values are kept in between; above it, frames are also taken between control steps."""
    delay_ms: Number = 0.0
    """Time from taking a frame until the player has its result, 0 to 1000 ms."""
    jitter_ms: Number = 0.0
    """0 to `delay_ms`: the delay of each frame is uniform in `delay_ms` ± `jitter_ms`. Frames stay in order: one that
    would overtake another arrives together with it. If one of the two is drawn, a jitter that is greater than the delay
    is as great as the delay."""
    noise_mm: Number = 0.0
    """Standard deviation of the Gaussian noise on the puck's x and y in each frame, 0 to 100 mm."""
    opponent_noise_mm: Number = 0.0
    """Standard deviation of the Gaussian noise on the x and y of the opponent's paddle in each frame, 0 to 100 mm."""
    velocity_frames: int | tuple[int, int] | None = None
    """Number of frames from which velocities are estimated, 2 to 64: the slope of the least-squares line through the
    positions that were seen last, over the times of their frames. With 2 it is the finite difference; more frames
    reduce the noise and add delay. None: the true velocities at the time of the frame."""
    dropout: Number = 0.0
    """Probability, 0 to 1, that a frame is lost; the last values are kept."""
    occlusion_mm: Number = 0.0
    """0 to 1000 mm: the puck is hidden, and its last values are kept, while the gap between its rim and the rim of the
    opponent's paddle is smaller than this."""

    def __post_init__(self) -> None:
        if self.camera_hz is not None:
            self._set("camera_hz", check_number_or_range("camera_hz", self.camera_hz, 1, 1000, also="None"))
        for name, most in (
            ("delay_ms", 1000),
            ("jitter_ms", 1000),
            ("noise_mm", 100),
            ("opponent_noise_mm", 100),
            ("dropout", 1),
            ("occlusion_mm", 1000),
        ):
            self._set(name, check_number_or_range(name, getattr(self, name), 0, most))
        delay, jitter = self.delay_ms, self.jitter_ms
        if not (isinstance(delay, tuple) or isinstance(jitter, tuple)) and jitter > delay:
            raise fault("jitter_ms", f"a number from 0 to delay_ms, which is {self.delay_ms}", self.jitter_ms)
        if self.velocity_frames is not None:
            frames = check_whole_or_range("velocity_frames", self.velocity_frames, 2, 64, also="None")
            self._set("velocity_frames", frames)

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    def fields(self) -> dict[str, Any]:
        """The fields by name: the arguments that make this camera."""
        return dataclasses.asdict(self)

    def ends(self) -> dict[str, tuple[Any, Any]]:
        """The least and the greatest value of every field, which are the same where it is not drawn."""
        return {name: value if isinstance(value, tuple) else (value, value) for name, value in self.fields().items()}


FIELDS = tuple(field.name for field in dataclasses.fields(Camera))
"""The fields of a `Camera`, in their order."""


def resolve_camera(camera: str | Camera | Mapping[str, Any]) -> Camera:
    """The camera that a `camera` argument means: one by name, a `Camera`, or a mapping of its fields.

    Raises:
        ValueError: none of these, or a field is unknown or out of range.
    """
    if isinstance(camera, Camera):
        return camera
    if isinstance(camera, str) and camera in CAMERAS:
        return CAMERAS[camera]
    if isinstance(camera, Mapping):
        for name in camera:
            if name not in FIELDS:
                raise fault("camera", f"a mapping whose keys are among {FIELDS}", name)
        return Camera(**camera)
    raise fault("camera", f"None, one of {tuple(CAMERAS)}, a Camera or a mapping of its fields", camera)


ROBOT = Camera(
    camera_hz=120,
    delay_ms=7,
    jitter_ms=1.5,
    noise_mm=1.0,
    opponent_noise_mm=1.0,
    velocity_frames=6,
    dropout=0.01,
    occlusion_mm=10,
)
"""A camera like those of robots that play air hockey against people, from values that their builders have published.

* 120 frames per second, 1 mm: the "AI Air Hockey" robot of the University of British Columbia
  (github.com/HudsonNock/Air-Hockey-Sim, README: one camera tracks the puck and the opponent's mallet at 120 frames per
  second with a mean error of about 1 mm over the table). Others: 60 Hz (JJRobots), 90 Hz (HockeyBot, RealSense D435i),
  200 Hz and 0.35 mm (github.com/misprit7/airhockey).
* 7 ms, 1.5 ms: the UBC robot takes 6 to 7 ms from frame to command, occasionally more than 8.5 ms; misprit7 measured
  at least 5.1 ms from light to program, and at most 10.3 ms including the wait for the next frame (SIM2REAL.md).
* 6 frames: misprit7's tracker fits a least-squares slope to the last 6 positions (ai/airhockey/perception.py).
* Last values kept when not seen: the UBC robot repeats the puck's previous position. How often frames are lost, and how
  close to the paddle the puck is hidden by a gantry or a hand, has not been published: 1 % and 10 mm are plausible
  values, not measured ones.
"""

SLOW = dataclasses.replace(ROBOT, camera_hz=60, delay_ms=25, noise_mm=3, opponent_noise_mm=3)
"""A camera at the slow end of what robots have: 60 frames per second as JJRobots has it, late by 25 ms, with 3 mm of
noise. The latter two are plausible for a cheap webcam, not measured; everything else is as `ROBOT` has it."""

ROBOTS = Camera(
    camera_hz=(60, 200),
    delay_ms=(5, 30),
    jitter_ms=(0, 3),
    noise_mm=(0.3, 3),
    opponent_noise_mm=(0.3, 3),
    velocity_frames=(2, 6),
    dropout=(0, 0.03),
    occlusion_mm=(0, 30),
)
"""Cameras that cover those of robots: one is drawn for each table and episode. `ROBOT` and `SLOW` are among them.

Measured limits, with the sources that `ROBOT` names:

* 60 Hz (JJRobots) to 200 Hz (misprit7).
* From 5 ms: misprit7 measured at least 5.1 ms from light to program.
* From 0.3 mm: misprit7 has 0.35 mm.
* Velocities from up to 6 frames (misprit7).

Our choice, for want of published limits: up to 30 ms, about three times the greatest delay that misprit7 measured; up
to 3 mm, three times the mean error of the UBC robot; from 2 frames, the fewest that give a velocity; jitter up to 3 ms,
twice that of `ROBOT`; up to 3 % lost frames; and hidden up to 30 mm from the opponent's paddle.
"""

LATE = dataclasses.replace(ROBOTS, camera_hz=(45, 120), delay_ms=(15, 40), jitter_ms=(0, 5), noise_mm=(0.3, 4))
"""Cameras later and slower than most of `ROBOTS`, to train for: `SLOW` is one of them. The limits are our choice."""

CAMERAS = {"robot": ROBOT, "slow": SLOW, "robots": ROBOTS, "late": LATE}
"""Cameras by name; those of `"robots"` and `"late"` are drawn anew for each table and episode."""
