"""Training with several workers, by Ray Train on a real Ray: what is the same as without it, and what is lost when."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from agents.cluster import connect
from agents.sb3_files import read_model
from agents.training import train as trainer
from agents.training.ppo import PpoArgs
from agents.training.runs import RunFolder
from agents.training.self_play import SelfPlayArgs
from agents.training.train import train
from tests.helpers import start

ray = pytest.importorskip("ray", reason="needs Ray")
cluster_utils = pytest.importorskip("ray.cluster_utils", reason="needs Ray")

TINY: dict[str, Any] = {
    "num_envs": 8, "n_steps": 8, "batch_size": 32, "net_width": 8, "eval_episodes": 2, "report_episodes": 2,
    "video_seconds": 0,
}  # fmt: skip
SMALL = ("--num-envs", "8", "--n-steps", "16", "--batch-size", "64", "--net-width", "8", "--eval-episodes", "2",
         "--report-episodes", "2", "--video-seconds", "0")  # fmt: skip
EVERY = 2_000


@pytest.fixture(autouse=True)
def _in_its_own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="class")
def one_processor() -> Iterator[None]:
    """A Ray that this process uses, and the commands in it."""
    with connect(None, 1):
        yield


@pytest.fixture
def cluster() -> Iterator[Any]:
    """A cluster of two nodes with a processor each."""
    nodes = cluster_utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        nodes.add_node(num_cpus=1)
        yield nodes
    finally:
        nodes.shutdown()


@pytest.mark.usefixtures("one_processor")
class TestOneWorker:
    def test_one_worker_is_the_run_without_ray_to_the_bit(self) -> None:
        args: dict[str, Any] = {
            **TINY, "steps": 40 * 64, "eval_every": 16 * 64, "warmup_steps": 10 * 64, "snapshot_every": 8 * 64,
            "camera": "robot", "randomize": "tables", "stack": 2,
        }  # fmt: skip
        folders = [
            train(SelfPlayArgs(name="plain", **args)),
            train(SelfPlayArgs(name="one", workers=1, **args)),
        ]
        plain, one = (json.loads(folder.evaluations.read_text()) for folder in folders)
        for rows in (*plain.values(), *one.values()):
            for row in rows if isinstance(rows, list) else []:
                for timed in ("seconds", "fps", "averaging"):
                    row.pop(timed, None)
        assert one == plain
        assert folders[0].policy.read_bytes() == folders[1].policy.read_bytes()
        states = [read_model(folder.model).params for folder in folders]
        assert str(states[0]) == str(states[1]), "the optimizer's too"
        leagues = [json.loads((folder.path / "league.json").read_text()) for folder in folders]
        assert leagues[0] == leagues[1]
        assert len(leagues[0]["members"]) > 4
        configs = [json.loads(folder.config.read_text()) for folder in folders]
        assert not {"workers", "address"} & set(configs[1])

    def test_a_worker_that_cannot_go_on_is_not_started_again(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Here it does not find the folder of the run, as on a node that does not share it."""
        monkeypatch.setattr(RunFolder, "owner", lambda self: "process 1 on another machine")
        with pytest.raises(FileNotFoundError, match=r"runs/own must be on a file system that all nodes"):
            train(PpoArgs(name="own", workers=1, steps=512, **TINY))
        train(PpoArgs(resume="own"))
        assert checkpoint() == 512


def test_no_address_is_no_run() -> None:
    with pytest.raises(ConnectionError, match=r"--address must be .*127\.0\.0\.1:1"):
        train(PpoArgs(name="own", workers=2, address="127.0.0.1:1", **TINY))
    assert not list(Path().iterdir())


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="finds processes in /proc")
def test_nothing_is_lost(cluster: Any) -> None:
    """A worker, a node and the command are killed, and training goes on; SIGTERM and Ctrl-C end it."""
    there = ("--workers", "2", "--address", cluster.address)
    process = start("train_ppo", "--name", "own", "--steps", "1e9", "--eval-every", str(EVERY), *there, *SMALL,
                    folder=Path.cwd())  # fmt: skip
    try:
        goes_on(process)
        before = processes()
        assert len(before) == 2
        os.kill(max(before), signal.SIGKILL)
        goes_on(process)
        assert not before & processes(), "both were started again"

        cluster.remove_node(max(cluster.worker_nodes, key=lambda node: node.node_id), allow_graceful=False)
        cluster.add_node(num_cpus=1)
        goes_on(process)
    finally:
        process.kill()
        process.wait()
    wait_until(lambda: not processes())
    rows = json.loads(Path("runs/own/evaluations.json").read_text())
    steps = [row["steps"] for row in rows["evaluations"]]
    assert steps == sorted(set(steps))
    assert max(steps) == checkpoint()
    update = 8 * 16
    taken = [row["steps"] for row in rows["updates"]]
    assert taken == list(range(update, len(taken) * update + 1, update)), "every update once"

    last = max(steps)
    for number, code in ((signal.SIGTERM, 128 + signal.SIGTERM), (signal.SIGINT, 0)):
        process = start("train_ppo", "--resume", "own", *there, folder=Path.cwd())
        try:
            goes_on(process)
            process.send_signal(number)
            printed, _ = process.communicate(timeout=200)
        finally:
            process.kill()
            process.wait()
        assert process.returncode == code, printed
        assert "Traceback" not in printed
        rows = json.loads(Path("runs/own/evaluations.json").read_text())
        assert checkpoint() >= rows["updates"][-1]["steps"] > last
        assert bool(rows["report"]) == (code == 0)
        last = checkpoint()
    config = json.loads(Path("runs/own/config.json").read_text())
    assert config["num_envs"] == 8, "of both workers"
    assert trainer.own_args(PpoArgs(resume="own"))[1].steps == 10**9


def checkpoint() -> int:
    """The steps of the last checkpoint, 0 before the first."""
    try:
        return read_model(Path("runs/own/model.zip")).data["num_timesteps"]
    except FileNotFoundError:
        return 0


def processes() -> set[int]:
    """The processes of the workers, which are in the current folder."""
    found = set()
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            name = (folder / "cmdline").read_bytes()
            if name.startswith(b"ray::RayTrainWorker") and (folder / "cwd").readlink() == Path.cwd():
                found.add(int(folder.name))
        except OSError:  # it has ended
            continue
    return found


def goes_on(process: subprocess.Popen[str]) -> None:
    """Wait for two new checkpoints."""
    begun = checkpoint()
    wait_until(lambda: checkpoint() >= begun + 2 * EVERY, process)


def wait_until(holds: Callable[[], bool], process: subprocess.Popen[str] | None = None) -> None:
    until = time.monotonic() + 200.0
    while not holds():
        assert process is None or process.poll() is None, process.communicate()[0]
        assert time.monotonic() < until
        time.sleep(0.2)
