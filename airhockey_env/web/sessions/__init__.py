"""The kinds of sessions, by the last part of their address: /session/NAME."""

from airhockey_env.web.sessions.air import AirSession
from airhockey_env.web.sessions.base import Session
from airhockey_env.web.sessions.play import PlaySession
from airhockey_env.web.sessions.watch import WatchSession

SESSIONS: dict[str, type[Session]] = {"play": PlaySession, "watch": WatchSession, "air": AirSession}

__all__ = ["SESSIONS", "Session"]
