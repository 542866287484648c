"""`Renderer`, under the name that users import it by; it stands in `airhockey_env.drawing.render`."""

from airhockey_env.drawing.render import Renderer

__all__ = ["Renderer"]
