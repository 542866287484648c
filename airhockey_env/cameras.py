"""Cameras as frozen, validated data, in the units of their data sheets: Hz, ms, mm."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from airhockey_env.checks import check_number, check_whole, fault


@dataclass(frozen=True)
class Camera:
    """How a camera above the table sees the puck and the opponent's paddle. The defaults are a perfect camera.

    The player's own paddle, which has encoders, and the shot clock, which belongs to the referee, stay exact. Derive a
    variant with `dataclasses.replace(ROBOT, delay_ms=20)`.

    Raises:
        ValueError: a field is not a finite number or is out of range. The message names the field, what was given
            and what is allowed.
    """

    camera_hz: float | None = None
    """Frames per second, 1 to 1000; None: one per control step. The first is taken at the start of an episode. Below
    the control rate, the last values are kept in between; above it, frames are also taken between control steps."""
    delay_ms: float = 0.0
    """Time from taking a frame until the player has its result, 0 to 1000 ms."""
    jitter_ms: float = 0.0
    """0 to `delay_ms`: the delay of each frame is uniform in `delay_ms` ± `jitter_ms`. Frames stay in order: one that
    would overtake another arrives together with it."""
    noise_mm: float = 0.0
    """Standard deviation of the Gaussian noise on the puck's x and y in each frame, 0 to 100 mm."""
    opponent_noise_mm: float = 0.0
    """Standard deviation of the Gaussian noise on the x and y of the opponent's paddle in each frame, 0 to 100 mm."""
    velocity_frames: int | None = None
    """Number of frames from which velocities are estimated, 2 to 64: the slope of the least-squares line through the
    positions that were seen last, over the times of their frames. With 2 it is the finite difference; more frames
    reduce the noise and add delay. None: the true velocities at the time of the frame."""
    dropout: float = 0.0
    """Probability, 0 to 1, that a frame is lost; the last values are kept."""
    occlusion_mm: float = 0.0
    """0 to 1000 mm: the puck is hidden, and its last values are kept, while the gap between its rim and the rim of the
    opponent's paddle is smaller than this."""

    def __post_init__(self) -> None:
        if self.camera_hz is not None:
            self._set("camera_hz", check_number("camera_hz", self.camera_hz, 1, 1000, also="None"))
        for name, most in (
            ("delay_ms", 1000),
            ("jitter_ms", 1000),
            ("noise_mm", 100),
            ("opponent_noise_mm", 100),
            ("dropout", 1),
            ("occlusion_mm", 1000),
        ):
            self._set(name, check_number(name, getattr(self, name), 0, most))
        if self.jitter_ms > self.delay_ms:
            raise fault("jitter_ms", f"a number from 0 to delay_ms, which is {self.delay_ms}", self.jitter_ms)
        if self.velocity_frames is not None:
            self._set("velocity_frames", check_whole("velocity_frames", self.velocity_frames, 2, 64, also="None"))

    def _set(self, name: str, value: float) -> None:
        object.__setattr__(self, name, value)

    def fields(self) -> dict[str, Any]:
        """The fields by name: the arguments that make this camera."""
        return dataclasses.asdict(self)


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
            if name not in Camera.__dataclass_fields__:
                raise fault("camera", f"a mapping whose keys are among {tuple(Camera.__dataclass_fields__)}", name)
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

CAMERAS = {"robot": ROBOT}
"""Cameras by name."""
