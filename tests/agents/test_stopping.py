"""Runs that are stopped by signals, fail, meet a full disk or a second process: nothing that was learned is lost."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from stable_baselines3.common.callbacks import BaseCallback

from agents.files import replace_together
from agents.measuring.evaluation import OPPONENTS
from agents.sb3_files import read_model
from agents.training import checkpoints, ppo
from agents.training.ppo import PpoArgs
from agents.training.recipe import TrainArgs
from agents.training.runs import RunFolder, check_name
from agents.training.self_play import SelfPlayArgs
from agents.training.stopping import Stop, Stopped, stopping
from agents.training.train import own_args, train
from agents.training.zoo import ALGORITHMS, ZooArgs
from tests.helpers import start

TINY: dict[str, Any] = {
    "steps": 32, "num_envs": 4, "n_steps": 4, "batch_size": 8, "net_width": 8, "eval_episodes": 2, "report_episodes": 2,
    "video_seconds": 0,
}  # fmt: skip
SMALL = ("--num-envs", "8", "--n-steps", "16", "--batch-size", "64", "--net-width", "8", "--eval-episodes", "2")
LONG = ("--name", "long", "--steps", "1e9", "--eval-every", "1e9", "--report-episodes", "1M", "--video-seconds", "0")
needs_signals = pytest.mark.skipif(os.name == "nt", reason="sends signals")


@pytest.fixture(autouse=True)
def _in_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@contextmanager
def running(script: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A command that has begun to learn, in the current folder; it is gone afterwards."""
    process = start(script, *arguments, folder=Path.cwd())
    try:
        until = time.monotonic() + 300.0
        while not any(path.stat().st_size > 500 for path in Path("runs/long").glob("tensorboard/events.*")):
            assert process.poll() is None, process.communicate()[0]
            assert time.monotonic() < until
            time.sleep(0.1)
        yield process
    finally:
        process.kill()
        process.wait()


def steps_of(folder: Path) -> int:
    return read_model(folder / "model.zip").data["num_timesteps"]


@needs_signals
@pytest.mark.parametrize(
    ("script", "number", "resumed"),
    [("train_ppo", signal.SIGTERM, PpoArgs), ("train_self_play", getattr(signal, "SIGHUP", 1), SelfPlayArgs)],
)
def test_a_signal_saves_and_ends(script: str, number: int, resumed: type[TrainArgs]) -> None:
    with running(script, *LONG, *SMALL) as process:
        with pytest.raises(BlockingIOError, match=f"process {process.pid}"):
            train(resumed(resume="long"))
        process.send_signal(signal.SIGINT)
        process.send_signal(number)
        printed, _ = process.communicate(timeout=300)
    assert process.returncode == 128 + number, printed
    assert f"python -m scripts.{script} --resume runs/long" in " ".join(printed.split())
    assert "Traceback" not in printed
    history = json.loads(Path("runs/long/evaluations.json").read_text())
    assert [row["steps"] for row in history["evaluations"]] == [0], "the first checkpoint was the only one"
    assert history["report"] == []
    assert steps_of(Path("runs/long")) >= history["updates"][-1]["steps"] > 0
    assert not list(Path("runs").rglob("*part*"))


@needs_signals
@pytest.mark.parametrize(("points", "again"), [("2", False), ("1M", True)])
def test_ctrl_c_loses_nothing_and_a_second_one_leaves_out_the_report(points: str, again: bool) -> None:
    with running("train_ppo", *LONG, *SMALL, "--report-episodes", points) as process:
        assert process.stdout is not None
        process.send_signal(signal.SIGINT)
        printed = ""
        while "Continue with: python -m scripts.train_ppo --resume runs/long" not in " ".join(printed.split()):
            printed += (line := process.stdout.readline())
            assert line, printed
        if again:
            process.send_signal(signal.SIGINT)
        printed, _ = process.communicate(timeout=300)
    assert process.returncode == (130 if again else 0), printed
    assert "Traceback" not in printed
    history = json.loads(Path("runs/long/evaluations.json").read_text())
    assert len(history["report"]) == (0 if again else len(OPPONENTS))
    assert Path("runs/long/training.png").exists() != again
    assert steps_of(Path("runs/long")) >= history["updates"][-1]["steps"] > 0


@needs_signals
def test_nohup_holds_and_off_policy_runs_are_saved() -> None:
    Path("tiny.yml").write_text(
        "AirHockeyHit-v0: {policy: MlpPolicy, n_timesteps: 60, n_envs: 4, learning_starts: 20, batch_size: 8,"
        " buffer_size: 400, train_freq: 50, gradient_steps: 1, policy_kwargs: 'dict(net_arch=[8])'}"
    )
    arguments = ("--algo", "sac", "--hyperparams", "tiny.yml", *LONG, "--eval-episodes", "2")
    ignored = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # the command inherits it, as from nohup
    try:
        with running("train", *arguments) as process:
            process.send_signal(signal.SIGHUP)
            process.send_signal(signal.SIGTERM)
            printed, _ = process.communicate(timeout=300)
    finally:
        signal.signal(signal.SIGHUP, ignored)
    assert process.returncode == 128 + signal.SIGTERM, printed
    assert "python -m scripts.train --resume runs/long" in " ".join(printed.split())
    kept = own_args(ZooArgs(resume="long"))[1]
    assert (kept.algo, kept.steps) == ("sac", 10**9)
    assert ALGORITHMS["sac"].load("runs/long/model.zip", device="cpu").num_timesteps > 20


@needs_signals
class TestStop:
    @pytest.fixture(autouse=True)
    def _as_in_a_terminal(self) -> Iterator[None]:
        """A shell lets its background jobs ignore Ctrl-C, and so would the tests."""
        usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
        before = {number: signal.signal(number, handler) for number, handler in usual.items()}
        yield
        for number, handler in before.items():
            signal.signal(number, handler)

    def test_signals_are_noted_and_break_into_nothing(self) -> None:
        before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
        with stopping() as stop:
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
            assert stop.asked == [signal.SIGINT, signal.SIGINT]
            stop.forget_ctrl_c()
            with pytest.raises(KeyboardInterrupt):
                stop.check()
            signal.raise_signal(signal.SIGTERM)
            with pytest.raises(Stopped) as stopped:
                list(stop.between([1, 2]))
            assert stopped.value.code == 128 + signal.SIGTERM
        assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before

    def test_nothing_was_asked(self) -> None:
        stop = Stop()
        stop.check()
        stop.observe(None, 0)(None)
        stop.forget_ctrl_c()
        assert list(stop.between("abc")) == ["a", "b", "c"]

    def test_in_another_thread_signals_stay_as_they_are(self) -> None:
        seen: list[Any] = []

        def look() -> None:
            with stopping():
                seen.append(signal.getsignal(signal.SIGTERM))

        thread = threading.Thread(target=look)
        thread.start()
        thread.join()
        assert seen == [signal.getsignal(signal.SIGTERM)]

    def test_signals_while_saving_and_evaluating(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """One comes in the midst of the first evaluation, one while the run is saved for that."""
        points, together = ppo.play_points, checkpoints.replace_together

        def evaluate(*arguments: Any, observer: Callable[..., Any], **others: Any) -> Any:
            signal.raise_signal(signal.SIGINT)
            return points(*arguments, observer=observer, **others)

        def save(writes: Any) -> None:
            together({path: lambda part, write=write: (signal.raise_signal(signal.SIGTERM), write(part))
                      for path, write in writes.items()} if saves else writes)  # fmt: skip
            saves.append(len(writes))

        saves: list[int] = []
        monkeypatch.setattr(ppo, "play_points", evaluate)
        monkeypatch.setattr(checkpoints, "replace_together", save)
        with pytest.raises(Stopped) as stopped:
            train(PpoArgs(name="own", warmup_steps=0, **TINY))
        assert stopped.value.code == 128 + signal.SIGTERM
        assert saves == [3, 3]
        assert json.loads(Path("runs/own/evaluations.json").read_text())["evaluations"] == []


class _Fails(BaseCallback):
    """A tracker that loses its server, or what else goes wrong."""

    def _on_step(self) -> bool:
        if self.num_timesteps >= 24:
            raise RuntimeError("the server is gone")
        return True


def test_a_callback_that_fails_loses_nothing() -> None:
    with pytest.raises(RuntimeError, match="the server is gone"):
        train(PpoArgs(name="own", warmup_steps=0, **TINY), callbacks=[_Fails()])
    assert steps_of(Path("runs/own")) == 24
    train(PpoArgs(resume="own"))
    assert steps_of(Path("runs/own")) >= 32


def test_a_full_disk_leaves_the_last_checkpoint(monkeypatch: pytest.MonkeyPatch) -> None:
    train(PpoArgs(name="own", **TINY))
    folder = Path("runs/own")
    names = ("model.zip", "policy.npz", "evaluations.json")
    before = {name: (folder / name).read_bytes() for name in names}

    def full(path: Path, data: Any) -> None:
        path.write_text("{")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    with monkeypatch.context() as patch:
        patch.setattr(checkpoints, "write_json", full)  # the last of a checkpoint's files
        with pytest.raises(OSError, match=r"runs.own could not be saved, its last checkpoint is intact: .*No space"):
            train(PpoArgs(resume="own", steps=64))
    assert {name: (folder / name).read_bytes() for name in names} == before
    assert not list(folder.rglob("*part*"))
    train(PpoArgs(resume="own", steps=64))
    assert steps_of(folder) == 64


@pytest.mark.parametrize(
    ("name", "value"),
    [("steps", "many"), ("steps", 10**400), ("gamma", "1"), ("gamma", 7), ("opponent", "striker"), ("opponent", [1]),
     ("opponent", ["nobody"]), ("seed", True), ("seed", 0.5), ("seed", -1), ("threads", [1]), ("wind", 1),
     ("command", "train"), ("command", ["rm"]), ("name", 5)],
)  # fmt: skip
def test_a_forged_config_is_refused(name: str, value: Any, forged: Path) -> None:
    config = json.loads((forged / "config.json").read_text())
    (forged / "config.json").write_text(json.dumps({**config, name: value}))
    before = (forged / "model.zip").read_bytes()
    with pytest.raises(ValueError, match=r"runs.own"):
        train(PpoArgs(resume="own"))
    assert (forged / "model.zip").read_bytes() == before


def test_a_run_of_another_version_is_refused(forged: Path) -> None:
    """Options had other names until 0.1.0."""
    config = json.loads((forged / "config.json").read_text())
    old = {"opponents": config.pop("opponent"), "opponent": config.pop("eval_opponent"), **config}
    (forged / "config.json").write_text(json.dumps(old))
    with pytest.raises(ValueError, match=r"runs.own.config\.json: 'opponents' is no option of this version"):
        train(PpoArgs(resume="own"))


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("finished"))
        return train(PpoArgs(name="own", **TINY)).path.absolute()


@pytest.fixture
def forged(finished: Path, tmp_path: Path) -> Path:
    """A copy of a run, to be changed."""
    return Path(shutil.copytree(finished, tmp_path / "runs" / "own"))


def test_files_replace_together_or_not_at_all(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_text("old")

    def fail(part: Path) -> None:
        part.write_text("half")
        raise OSError("full")

    with pytest.raises(OSError, match="full"):
        replace_together({one: lambda part: part.write_text("new"), other: fail})
    assert one.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["one"]


class TestLock:
    def test_one_at_a_time(self) -> None:
        folder = RunFolder.create("own")
        with folder.locked(), pytest.raises(BlockingIOError, match=f"process {os.getpid()}"), folder.locked():
            pass
        with folder.locked():
            pass

    def test_the_lock_of_a_dead_process_does_not_hold(self) -> None:
        folder = RunFolder.create("own")
        (folder.path / ".lock").write_text("process 1 on another machine")
        with folder.locked(new=True):
            pass

    def test_a_run_that_began_meanwhile_is_not_overwritten(self) -> None:
        folder = RunFolder.create("own")
        folder.config.write_text("{}")
        with pytest.raises(FileExistsError), folder.locked(new=True):
            pass

    def test_two_runs_without_a_name_in_one_second(self) -> None:
        assert len({RunFolder.create(None, "sac").path for _ in range(5)}) == 5


class TestNames:
    @pytest.mark.parametrize("name", ["own", "a.b", "run-3", "Lauf_ä", "2026", "lr=3e-4+x@home", "x" * 200, "COM"])
    def test_names(self, name: str) -> None:
        assert check_name(name) == name

    @pytest.mark.parametrize(
        "name",
        ["", ".", "..", "a/b", "/tmp", "a\\b", "-x", ".x", "a b", "a\n", "a\nb", "\0", "a\0", "x" * 201, "ä" * 101,
         "con", "NUL.txt", "COM1", "lpt0.x", "a.", "a:b", "a*", "\udcff", "~"],
    )  # fmt: skip
    def test_what_is_none(self, name: str) -> None:
        with pytest.raises(ValueError, match="--name must be"):
            train(PpoArgs(name=name))
        assert not Path("runs").exists()

    @pytest.mark.parametrize("name", ["", ".", "..", "/", "\0", "a\nb", "x" * 5000, "-x", "none", "file", "\udcff"])
    def test_only_a_runs_folder_is_resumed(self, name: str) -> None:
        Path("file").write_text("")
        with pytest.raises(FileNotFoundError, match="--resume must be a run's folder"):
            train(PpoArgs(resume=name))
        assert [path.name for path in Path().iterdir()] == ["file"]
