"""Replays that are uploaded, and runs that are followed."""

from __future__ import annotations

import asyncio
import io
import json
import zipfile
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from airhockey_env.replay import Replay, play_back, play_back_game
from airhockey_env.web.catalogue import Catalogue
from airhockey_env.web.limits import Limits
from airhockey_env.web.replays import read_replay, trajectory
from airhockey_env.web.runs import MOST_ROWS, Run
from tests.web.serving import Running, serving


def unpacked(content: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """What a page makes of an answer to an upload."""
    line, _, rest = content.partition(b"\n")
    head, arrays, at = json.loads(line), {}, 0
    for name, dtype, shape in head["arrays"]:
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        arrays[name] = np.frombuffer(rest[at : at + size], dtype).reshape(shape)
        at += size
    assert at == len(rest)
    return head, arrays


def test_a_trajectory_has_every_state_and_contact(replay: Path) -> None:
    head, arrays = unpacked(trajectory(replay.read_bytes(), Limits()))
    states = np.concatenate(list(play_back(replay)))
    np.testing.assert_array_equal(arrays["positions"], states["position"].astype(np.float32))
    np.testing.assert_array_equal(arrays["scores"], states["score"])
    assert np.abs(arrays["clocks"]).max() <= 1.0 and (np.sign(arrays["clocks"]) * states["side"] >= 0).all()
    contacts = [
        (k - 1 + time * 200.0, *contact)
        for k, game in enumerate(play_back_game(replay))
        for time, *contact in game.contacts_of(0).tolist()
    ]
    assert len(contacts) > 3
    np.testing.assert_array_equal(arrays["contacts"], np.array(contacts, np.float32))
    assert arrays["starts"].tolist() == [0]
    assert head["control_hz"] == 200.0 and head["opponent"] is None and head["table"]["length"] == 2.362


def test_what_is_no_replay_is_refused_without_the_servers_paths(replay: Path, tmp_path: Path) -> None:
    good = replay.read_bytes()
    bomb = io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("replay.npy", bytes(64 * 2**20))
    damaged = Replay.load(replay)
    damaged.actions[-20:] += 0.5
    damaged.save(replay.with_name("damaged.npz"))
    for content in (
        b"",
        b"PK",
        good[:1000],
        b"x" + good,
        bomb.getvalue(),
        replay.with_name("damaged.npz").read_bytes(),
    ):
        with pytest.raises(ValueError) as refused:  # noqa: PT011
            trajectory(content, Limits())
        assert "/" not in str(refused.value) and "replay" in str(refused.value)


def test_long_replays_are_refused(replay: Path) -> None:
    content = replay.read_bytes()
    with pytest.raises(ValueError, match="at most 100 steps"):
        read_replay(content, Limits(replay_steps=100))
    with pytest.raises(ValueError, match="unpack"):
        read_replay(content, Limits(unpacked_bytes=1000))
    with pytest.raises(ValueError, match="too long"):
        trajectory(content, Limits(playback_seconds=0.0))


def run(test: Callable[[Running], Awaitable[None]], **arguments: Any) -> None:
    async def all_of_it() -> None:
        async with serving(**arguments) as running:
            await asyncio.wait_for(test(running), 60.0)

    asyncio.run(all_of_it())


def test_uploads_over_http(replay: Path) -> None:
    async def test(running: Running) -> None:
        origin = {"Origin": running.address}
        async with running.client.post(
            f"{running.address}/replay", data=replay.read_bytes(), headers=origin
        ) as response:
            assert response.status == 200
            assert unpacked(await response.read())[0]["control_hz"] == 200.0
        async with running.client.post(f"{running.address}/replay", data=b"nothing", headers=origin) as response:
            assert response.status == 422 and "replay" in await response.text()
        async with running.client.post(f"{running.address}/replay", data=bytes(2**17 + 1), headers=origin) as response:
            assert response.status == 413
        async with running.client.post(f"{running.address}/replay", data=b"nothing") as response:
            assert response.status == 403

    run(test, upload_bytes=2**17)


def test_uploads_are_few_at_a_time_and_bounded_in_time() -> None:
    async def test(running: Running) -> None:
        head = f"POST /replay HTTP/1.1\r\nHost: localhost\r\nOrigin: {running.address}\r\nContent-Length: 1000\r\n\r\n"
        head = head.replace("localhost", running.address.removeprefix("http://"))
        slow = [await asyncio.open_connection("127.0.0.1", running.port) for _ in range(2)]
        for _, writer in slow:
            writer.write(head.encode())
        await asyncio.sleep(0.2)
        origin = {"Origin": running.address}
        async with running.client.post(f"{running.address}/replay", data=b"nothing", headers=origin) as response:
            assert response.status == 503
        for reader, writer in slow:
            assert b" 408 " in await reader.readline()
            writer.close()
        async with running.client.post(f"{running.address}/replay", data=b"nothing", headers=origin) as response:
            assert response.status == 422

    run(test, uploads=2, upload_seconds=1.0)


# Runs


def test_records_are_read_again_when_they_have_changed(tmp_path: Path) -> None:
    watched = Run(tmp_path)
    assert watched.records() == {"goal": None, "evaluations": [], "updates": []}
    (tmp_path / "config.json").write_text('{"steps": 5000}')
    row = {"steps": 100, "win_rate": 0.25, "win_rate_95": [0.2, 0.3], "opponent": "striker", "kl": float("nan")}
    (tmp_path / "evaluations.json").write_text(json.dumps({"evaluations": [row], "updates": [7, row]}))
    plain = {"steps": 100, "win_rate": 0.25, "win_rate_95": [0.2, 0.3]}
    assert watched.records() == {"goal": 5000, "evaluations": [plain], "updates": [plain]}
    (tmp_path / "evaluations.json").write_text('{"evaluations": [')  # half of a file
    assert watched.records()["evaluations"] == [plain]


@pytest.mark.parametrize("text", ["[]", "7", "null", '{"evaluations": 7, "updates": {"a": [1]}}', "[" * 10_000, "\x00"])
def test_files_of_another_kind_leave_no_records(text: str, tmp_path: Path) -> None:
    (tmp_path / "evaluations.json").write_text(text)
    (tmp_path / "config.json").write_text(text)
    assert Run(tmp_path).records() == {"goal": None, "evaluations": [], "updates": []}


def test_of_many_records_some_are_given_and_the_last_one(tmp_path: Path) -> None:
    rows = [{"steps": k} for k in range(3 * MOST_ROWS + 7)]
    (tmp_path / "evaluations.json").write_text(json.dumps({"updates": rows}))
    given = Run(tmp_path).records()["updates"]
    assert len(given) == MOST_ROWS and given[-1] == rows[-1] and len({row["steps"] for row in given}) == MOST_ROWS


def test_records_over_http(tmp_path: Path) -> None:
    (tmp_path / "config.json").write_text('{"steps": 5000}')

    async def test(running: Running) -> None:
        async with running.client.get(f"{running.address}/run/my%20run") as response:
            assert (await response.json())["goal"] == 5000
        for name in ("other", "%2Fetc", "my run/policy.npz"):
            async with running.client.get(f"{running.address}/run/{name}") as response:
                assert response.status == 404

    run(test, catalogue=Catalogue(runs={"my run": tmp_path}))
