"""Cameras, where they were imported from before environments took a `camera` argument."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

from airhockey_env.cameras import ROBOT, Camera

__all__ = ["ROBOT", "Camera", "sense"]


def sense(env: Any, camera: str | Camera | Mapping[str, Any]) -> Any:
    """Put a camera between an environment of this package, wrapped or not, and its player. Reset it afterwards.

    Deprecated: make the environment with `camera=` instead.

    Returns:
        The same environment.
    """
    warnings.warn("sense is deprecated: make the environment with camera=...", DeprecationWarning, stacklevel=2)
    env.unwrapped._game.set_camera((camera, None))
    return env
