"""Messages between a page and its session: JSON objects with a `type`, checked field by field before they are used."""

from __future__ import annotations

import json
import math
from collections.abc import Collection
from typing import Any

from airhockey_env.checks import as_float, as_whole
from airhockey_env.files import parse_json


class Refused(ValueError):
    """A message that a session does not accept. Its text is the reason that the visitor is told."""


_REQUIRED: Any = object()


class Message:
    """What a page sent.

    Each field is taken once, by the method that says what it must be; `finish` refuses what nobody took. All methods
    raise `Refused`, which names the field, what was given and what is allowed.

    Args:
        text: JSON.

    Raises:
        Refused: it is no JSON, no object, or has no `type`.
    """

    type: str

    def __init__(self, text: str) -> None:
        try:
            content = parse_json(text)
        except ValueError as error:
            raise Refused(f"a message must be JSON: {error}") from error
        if not isinstance(content, dict) or not isinstance(content.get("type"), str):
            raise Refused("a message must be an object with a type")
        self.type = content.pop("type")
        self._fields: dict[str, Any] = content

    def has(self, name: str) -> bool:
        """Whether there is such a field; one that is null counts as missing, and as taken."""
        if self._fields.get(name) is None:
            self._fields.pop(name, None)
            return False
        return True

    def number(self, name: str, low: float, high: float, default: float = _REQUIRED) -> float:
        """A finite number from `low` to `high`."""
        value = self._take(name, default)
        number = as_float(value)
        if number is None or math.isinf(number) or not low <= number <= high:
            raise Refused(f"{name} must be a number from {low:g} to {high:g}, got {_shown(value)}")
        return number

    def whole(self, name: str, low: int, high: int, default: int = _REQUIRED) -> int:
        """A whole number from `low` to `high`."""
        value = self._take(name, default)
        number = as_whole(value)
        if number is None or not low <= number <= high:
            raise Refused(f"{name} must be a whole number from {low} to {high}, got {_shown(value)}")
        return number

    def numbers(self, name: str, count: int, bound: float) -> tuple[float, ...]:
        """A tuple of `count` numbers, each from -bound to bound."""
        value = self._take(name, _REQUIRED)
        numbers = [as_float(one) for one in value] if isinstance(value, list) else []
        within = tuple(number for number in numbers if number is not None and abs(number) <= bound)
        if len(within) != count or len(numbers) != count:
            raise Refused(f"{name} must be {count} numbers from {-bound:g} to {bound:g}, got {_shown(value)}")
        return within

    def choice(self, name: str, options: Collection[str], default: str = _REQUIRED) -> str:
        """One of some texts."""
        value = self._take(name, default)
        if not isinstance(value, str) or value not in options:
            raise Refused(f"{name} must be one of {', '.join(options)}; got {_shown(value)}")
        return value

    def text(self, name: str, longest: int) -> str:
        """A text of at most so many characters."""
        value = self._take(name, _REQUIRED)
        if not isinstance(value, str) or len(value) > longest:
            raise Refused(f"{name} must be a text of at most {longest} characters, got {_shown(value)}")
        return value

    def flag(self, name: str, default: bool = _REQUIRED) -> bool:
        """True or false."""
        value = self._take(name, default)
        if not isinstance(value, bool):
            raise Refused(f"{name} must be true or false, got {_shown(value)}")
        return value

    def finish(self) -> None:
        """Refuse the fields that were not taken."""
        if self._fields:
            raise Refused(f"a message of type {_shown(self.type)} has no field {_shown(next(iter(self._fields)))}")

    def _take(self, name: str, default: Any) -> Any:
        value = self._fields.pop(name, default)
        if value is _REQUIRED:
            raise Refused(f"a message of type {_shown(self.type)} must have a field {name}")
        return value


def encode(content: dict[str, Any]) -> str:
    """The text of an answer.

    Raises:
        ValueError: a number is not finite, which JSON cannot say.
    """
    return json.dumps(content, separators=(",", ":"), allow_nan=False)


def _shown(value: Any) -> str:
    """A value for a reason: on one line, and short."""
    text = json.dumps(value)
    return text if len(text) <= 40 else f"{text[:39]}…"
