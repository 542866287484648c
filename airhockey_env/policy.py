"""`MlpPolicy`, under the name that users import it by; it stands in `airhockey_env.opponents.policy`."""

from airhockey_env.opponents.policy import ACTIVATIONS, MlpPolicy

__all__ = ["ACTIVATIONS", "MlpPolicy"]
