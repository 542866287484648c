"""A match of a person, or of two players, against the clock on the wall."""

from airhockey_env.live.match import Event, LiveMatch

__all__ = ["Event", "LiveMatch"]
