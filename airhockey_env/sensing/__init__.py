"""What a camera sees of the game: wrappers that put one between an environment and its player.

`sense(env, ROBOT)` does it for one table or for a batch; `docs/sensing.md` tells the whole.
"""

from airhockey_env.sensing.camera import ROBOT, Camera
from airhockey_env.sensing.wrappers import CameraObservation, CameraVectorObservation, sense

__all__ = ["ROBOT", "Camera", "CameraObservation", "CameraVectorObservation", "sense"]
