"""Data sets as Minari reads them: metadata, replays to the bit, scores; and what is left when writing goes wrong."""

from __future__ import annotations

import itertools
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import minari
import numpy as np
import pytest

from agents.datasets import scores
from agents.datasets.episodes import Episode, play_episodes
from agents.datasets.replaying import check_replay
from agents.datasets.settings import Setting
from agents.datasets.storage import check_id, write_dataset
from agents.models import load_player
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.version import __version__
from tests.helpers import ROOT, Call, save_match, start
from tests.pages import DATASETS, blocks

POINT, DEFEND = Setting("point", "striker"), Setting("defend", "idle")
CAMERA = ("--camera", "robot", "--stack", "3", "--action-delay-ms", "5", "20")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Minari's folder; and scores of few episodes."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    monkeypatch.setattr(scores, "EPISODES", 20)
    return tmp_path / "datasets"


def some_episodes(number: int) -> Iterator[Episode]:
    return itertools.islice(play_episodes(load_player("expert"), DEFEND, 0), number)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("--player", "uniform", "--task", "hit"), "hit/random-v0"),
        (("--player", "adept", "--opponent", "goalie"), "point/medium-goalie-v0"),
        (("--task", "defend", "--table", "challenge"), "defend/expert-challenge-v0"),
        (("--task", "defend", "--player", "robust", "--randomize", "tables"), "defend/robust-tables-v0"),
        (("--task", "defend", *CAMERA), "defend/expert-robot-delay5_20-stack3-v0"),
    ],
)
def test_a_data_set_plays_back_to_the_bit(arguments: tuple[str, ...], name: str, call: Call) -> None:
    call("make_dataset", *arguments, "--steps", "3000", "--check")
    (found,) = minari.list_local_datasets()
    assert found == f"airhockey/{name}"
    dataset = minari.load_dataset(found)
    lengths = [len(episode) for episode in dataset]
    assert dataset.total_steps == sum(lengths) and 0 <= sum(lengths) - 3000 < lengths[-1]
    assert f"total_steps={lengths[0]}" in repr(dataset[0])
    assert dataset.action_space.contains(dataset[0].actions[0])
    assert dataset.observation_space.contains(dataset[0].observations[0])


def test_metadata(call: Call) -> None:
    call("make_dataset", "--task", "defend", "--steps", "2000", "--author", "You", "--id", "own/name-v3")
    dataset = minari.load_dataset("own/name-v3")
    assert (dataset.spec.namespace, dataset.spec.dataset_name, dataset.spec.version) == ("own", "name", 3)
    about = dataset.storage.metadata
    assert about["author"] == {"You"} and about["author_email"]
    assert about["requirements"] == [f"airhockey-env=={__version__}"]
    assert about["code_permalink"].startswith("https://") and about["algorithm_name"] and about["dataset_size"] > 0
    assert "AirHockeyDefend-v0" in about["description"] and "--author You" in about["description"]
    assert about["num_episodes_average_score"] == 20
    assert dataset.recover_environment(eval_env=True).spec == dataset.recover_environment().spec
    low, high = about["ref_min_score"], about["ref_max_score"]
    assert -1.0 <= low < high <= 0.0
    assert minari.get_normalized_score(dataset, np.array([low, high])).tolist() == [0.0, 1.0]


def test_a_persons_points(call: Call, tmp_path: Path) -> None:
    save_match(tmp_path / "match.npz", "striker", skill=0.5)
    call("make_dataset", "--replays", "match.npz", "--check")
    dataset = minari.load_dataset("airhockey/point/human-v0")
    assert dataset.total_episodes == 3
    for option in ("--steps=10", "--player=adept", "--seed=1"):
        assert option.partition("=")[0] in call("make_dataset", "--replays", "match.npz", option, fails=True)
    assert "--replays" in call("make_dataset", "--replays", "none.npz", fails=True)


def test_a_change_is_noticed() -> None:
    write_dataset("one-v0", DEFEND, {}, some_episodes(3))
    dataset = minari.load_dataset("one-v0")
    assert check_replay(dataset) == 3
    with h5py.File(dataset.storage.data_path / "main_data.hdf5", "r+") as file:
        rewards = file["episode_1/rewards"]
        rewards[2] += 1e-12
    with pytest.raises(ValueError, match="episode 1, step 3"):
        check_replay(dataset)


def test_parts_of_a_data_set_play_back() -> None:
    write_dataset("one-v0", DEFEND, {}, some_episodes(6))
    dataset = minari.load_dataset("one-v0")
    saved = dataset.filter_episodes(lambda episode: episode.rewards[-1] == 0.0)
    assert 0 < check_replay(saved) == saved.total_episodes <= 6


class TestNothingIsLost:
    def test_a_data_set_is_not_overwritten(self, call: Call, folder: Path) -> None:
        write_dataset("airhockey/defend/expert-v0", DEFEND, {}, some_episodes(2))
        before = contents(folder)
        assert "--id" in call("make_dataset", "--task", "defend", "--steps", "100", fails=True)
        with pytest.raises(FileExistsError):
            write_dataset("airhockey/defend/expert-v0", DEFEND, {}, some_episodes(1))
        assert contents(folder) == before

    @pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError, MemoryError])
    def test_what_stops_leaves_nothing(self, error: type[BaseException], folder: Path) -> None:
        def broken() -> Iterator[Episode]:
            yield from some_episodes(2)
            raise error

        with pytest.raises(error):
            write_dataset("one-v0", DEFEND, {}, broken())
        assert not list(folder.iterdir())
        write_dataset("one-v0", DEFEND, {}, some_episodes(2))

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_signals_leave_nothing(self, number: signal.Signals, folder: Path, tmp_path: Path) -> None:
        process = start("make_dataset", "--steps", "1e8", folder=tmp_path)
        deadline = time.monotonic() + 200.0
        while not list(folder.glob(".part-*/dataset/data/main_data.hdf5")):
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.05)
        process.send_signal(number)
        process.communicate(timeout=200)
        assert process.returncode == 128 + number
        assert not list(folder.iterdir())

    def test_a_full_disk_leaves_nothing(self, folder: Path, tmp_path: Path) -> None:
        done = subprocess.run(
            [sys.executable, "-m", "scripts.make_dataset", "--steps", "200k"],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2**20, 2**20)),
            capture_output=True,
            text=True,
        )
        assert done.returncode == 1 and "File too large" in done.stderr and "Traceback" not in done.stderr, done.stderr
        assert not list(folder.iterdir())

    @pytest.mark.parametrize("name", ["", "expert", "a b-v0", "/x-v0", "../x-v0", "a//b-v0", "x-v", "ä-v0"])
    def test_ids_are_checked(self, name: str) -> None:
        with pytest.raises(ValueError, match="--id"):
            check_id("--id", name)


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_page_does_what_it_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    monkeypatch.chdir(tmp_path)
    episodes = itertools.islice(play_episodes(load_player("expert"), POINT, 0), 30)
    scale = {"ref_min_score": -1.0, "ref_max_score": 0.8, "description": "A test."}
    write_dataset("airhockey/point/expert-v0", POINT, scale, episodes)
    names: dict[str, object] = {"__name__": "example"}
    for block in blocks(DATASETS):
        if block.language == "python":
            exec(compile("\n" * block.line + block.code, str(DATASETS), "exec"), names)
    assert "torch.Size([256, 13])" in capfd.readouterr().out


def test_a_clone_plays_like_the_one_it_imitates(call: Call, tmp_path: Path) -> None:
    write_dataset("one-v0", DEFEND, {}, some_episodes(1000))
    call("clone", "one-v0", "--epochs", "20")
    policy = MlpPolicy.load(tmp_path / "policy.npz")
    episodes = list(some_episodes(50))
    seen = np.concatenate([episode.observations[:-1] for episode in episodes])
    actions = np.concatenate([episode.actions for episode in episodes])
    assert np.abs(policy(seen) - actions).mean() < 0.3 * np.abs(actions.mean(axis=0) - actions).mean()
    first = (tmp_path / "policy.npz").read_bytes()
    call("clone", "one-v0", "--epochs", "20", "--out", "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == first


def test_a_clone_of_no_data_set(call: Call) -> None:
    assert "none-v0" in call("clone", "none-v0", fails=True)
