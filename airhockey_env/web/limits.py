"""What a visitor may use of the server."""

from __future__ import annotations

from typing import NamedTuple


class Limits(NamedTuple):
    """Everything that is bounded. All of it holds for one session or one connection, except where it says otherwise."""

    sessions: int = 32
    """Sessions at a time, of all visitors; each has one table."""
    connections: int = 128
    """Connections at a time, of all visitors, with those that fetch pages."""
    message_bytes: int = 4096
    """The longest message."""
    messages: float = 250.0
    """Messages a second in the long run."""
    burst: float = 100.0
    """Messages that may come at once."""
    share: float = 0.25
    """The share of the processor's time that a session uses at most; its answers are delayed beyond that."""
    all_shares: float = 0.8
    """The share that all sessions use at most: of many, each may use as much of it as the others."""
    share_burst: float = 0.5
    """s of work that a session may do at once after a rest."""
    answer_seconds: float = 0.004
    """s of work after which a session that plays many steps for one answer leaves the rest for the next one."""
    idle_seconds: float = 900.0
    """s without a message after which a session ends."""
    heartbeat_seconds: float = 15.0
    """s of silence after which a visitor is asked whether it is still there, and then for which its answer may take."""
    send_seconds: float = 10.0
    """s that a visitor may take to accept an answer."""
    first_request_seconds: float = 10.0
    """s within which a new connection must have sent its first request."""
    upload_bytes: int = 8 * 2**20
    """The largest replay that may be uploaded."""
    upload_seconds: float = 20.0
    """s that an upload may take."""
    unpacked_bytes: int = 32 * 2**20
    """The size that an uploaded replay may unpack to."""
    replay_steps: int = 400_000
    """Control steps of an uploaded replay: half an hour of a match."""
    playback_seconds: float = 60.0
    """s that playing back an uploaded replay may take."""
    uploads: int = 4
    """Uploads at a time, of all visitors."""


class Allowance:
    """So much a second, and so much at once: a bucket of tokens.

    Args:
        rate: what is allowed a second.
        burst: what is allowed at once, after a rest.
    """

    def __init__(self, rate: float, burst: float) -> None:
        self._rate, self._burst = rate, burst
        self._left, self._since = burst, 0.0

    def spend(self, amount: float, now: float, rate: float | None = None) -> float:
        """Use some of it.

        Args:
            amount: how much.
            now: s, of a clock that never goes back.
            rate: what is allowed a second from now on; None: as before.

        Returns:
            s after which the allowance is not exceeded any more; 0 if it is not.
        """
        self._left = min(self._burst, self._left + (now - self._since) * self._rate) - amount
        self._since = now
        self._rate = self._rate if rate is None else rate
        return max(0.0, -self._left / self._rate)
