"""Replays as bytes: files to download, and what is in uploaded ones."""

from __future__ import annotations

import io
import json
import tempfile
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from airhockey_env.files import check_archive
from airhockey_env.replay import Replay, play_back_game
from airhockey_env.web.catalogue import dimensions
from airhockey_env.web.limits import Limits


def replay_bytes(replay: Replay) -> bytes:
    """What `Replay.save` would write."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "replay.npz"
        replay.save(path)
        return path.read_bytes()


def read_replay(content: bytes, limits: Limits) -> Replay:
    """The replay in an uploaded file.

    Raises:
        ValueError: it holds none, or more than the limits allow.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            check_archive(archive, limits.unpacked_bytes)
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError) as error:
        raise ValueError(f"the file does not hold a replay: {error}") from error
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "replay.npz"
        path.write_bytes(content)
        try:
            replay = Replay.load(path)
        except ValueError as error:
            raise ValueError(str(error).replace(str(path), "the file")) from error
    if len(replay) > limits.replay_steps:
        raise ValueError(f"the replay must have at most {limits.replay_steps:,} steps, got {len(replay):,}")
    return replay


def trajectory(content: bytes, limits: Limits) -> bytes:
    """An uploaded replay, played back, as a page draws it.

    Returns:
        One line of JSON, and after it the arrays that its `arrays` names, one after the other, in little-endian order;
        docs/web.md lists them.

    Raises:
        ValueError: the file holds no replay, or one that does not play back the same, or takes too long.
    """
    replay = read_replay(content, limits)
    ends = time.monotonic() + limits.playback_seconds
    positions, scores, clocks, contacts = [], [], [], []
    game = None
    for number, game in enumerate(_bounded(replay, ends)):
        positions.append(game.states["position"][0].astype("<f4"))
        scores.append(game.states["score"][0].astype("<i4"))
        clocks.append(float(game.side[0]) * float(game.shot_clock[0]))
        for time_, *contact in game.contacts_of(0).tolist():
            contacts.append((number - 1 + time_ * replay.control_hz, *contact))
    assert game is not None  # a replay has a segment, and so a state
    arrays = {
        "positions": np.array(positions, "<f4"),
        "scores": np.array(scores, "<i4"),
        "clocks": np.array(clocks, "<f4"),
        "contacts": np.array(contacts, "<f4").reshape(-1, 8),
        "starts": (replay.starts + np.arange(len(replay.starts))).astype("<i4"),  # a start is a state without a step
    }
    head: dict[str, Any] = {
        "version": replay.version,
        "control_hz": replay.control_hz,
        "opponent": replay.arguments["opponent"],
        "table": dimensions(game.spec),
        "arrays": [[name, array.dtype.str, array.shape] for name, array in arrays.items()],
    }
    return json.dumps(head).encode() + b"\n" + b"".join(array.tobytes() for array in arrays.values())


def _bounded(replay: Replay, ends: float) -> Iterator[Any]:
    """The game at the states of a replay, until a time."""
    try:
        for game in play_back_game(replay):
            if time.monotonic() > ends:
                raise ValueError("the replay takes too long to play back")
            yield game
    except ValueError as error:
        raise ValueError(str(error).replace(replay.name, "the replay")) from error
