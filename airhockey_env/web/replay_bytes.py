"""Replays as the bytes of their files."""

from __future__ import annotations

import tempfile
from pathlib import Path

from airhockey_env.replay.file import Replay


def replay_bytes(replay: Replay) -> bytes:
    """What `Replay.save` would write."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "replay.npz"
        replay.save(path)
        return path.read_bytes()
