"""Work spread over Ray tasks: the same results, whatever happens to workers, and what signals keep."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import scripts.ladder
from agents.cluster import connect
from agents.measuring.ladder import play_ladder
from agents.sb3_files import read_model
from agents.spread import spread
from agents.training.exploit import best_responses, prepare
from agents.training.ppo import PpoArgs
from agents.training.runs import RunFolder
from tests.helpers import Call, start

ray = pytest.importorskip("ray", reason="needs Ray")
cluster_utils = pytest.importorskip("ray.cluster_utils", reason="needs Ray")

needs_signals = pytest.mark.skipif(os.name == "nt", reason="sends signals")

LONG = ("--steps", "1e9", "--seeds", "1", "--kinds", "scratch", "expert", "--points", "2")


@pytest.fixture(scope="module")
def two_workers() -> Iterator[None]:
    """A Ray of two processors, which every command of a test uses; later tests start their own."""
    with connect(None, 2):
        yield


@pytest.mark.usefixtures("two_workers")
class TestResults:
    def test_numbers_results_and_the_folder(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        taken: list[int] = []

        def items() -> Iterator[int]:
            for item in range(5):
                taken.append(item)
                yield item

        seen = {}
        for number, result in spread(lambda item: (10 * item, os.getpid(), os.getcwd()), items(), 2):
            assert len(taken) - len(seen) <= 2, "an item is taken when a worker is free, and no earlier"
            seen[number] = result
        assert [seen[k][0] for k in range(5)] == [0, 10, 20, 30, 40]
        assert os.getpid() not in {pid for _, pid, _ in seen.values()}
        assert {folder for _, _, folder in seen.values()} == {str(tmp_path)}

    def test_an_exception_is_that_of_the_function(self) -> None:
        def work(item: int) -> None:
            raise ValueError(f"item {item}")

        with pytest.raises(ValueError, match=r"^item 7$"):
            list(spread(work, [7], 2))

    def test_a_lost_worker_is_replaced(self, tmp_path: Path) -> None:
        def work(item: int) -> int:
            mark = tmp_path / "lost"
            if item == 1 and not mark.exists():
                mark.touch()
                os.kill(os.getpid(), getattr(signal, "SIGKILL", 9))
            return item

        assert sorted(spread(work, range(3), 2)) == [(0, 0), (1, 1), (2, 2)]
        assert (tmp_path / "lost").exists()

    @pytest.mark.parametrize(
        ("script", "arguments"),
        [
            ("ladder", ("--points", "20", "--only", "goalie", "striker", "expert")),
            ("evaluate", ("striker", "--opponent", "expert", "--episodes", "20")),
            ("robustness", ("goalie", "random", "--only", "named", "--points", "4")),
        ],
    )
    def test_a_command_writes_the_same_file(
        self, script: str, arguments: tuple[str, ...], call: Call, tmp_path: Path
    ) -> None:
        printed = [
            call(script, *arguments, "--json", f"{workers}.json", "--workers", str(workers)) for workers in (1, 2)
        ]
        assert printed[0] == printed[1]
        assert (tmp_path / "1.json").read_bytes() == (tmp_path / "2.json").read_bytes()

    def test_exploit_trains_the_same_agents(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        target = prepare("goalie", "target")
        args = PpoArgs(
            steps=64, num_envs=4, n_steps=4, batch_size=8, net_width=8, eval_episodes=2, report_episodes=2,
            video_seconds=0.0, table="ideal",
        )  # fmt: skip
        found = [
            dict(best_responses(target, ("scratch",), 2, f"by{workers}", args, 4, workers=workers))
            for workers in (1, 2)
        ]
        for number in range(2):
            one, two = (responses[number] for responses in found)
            assert (one.kind, one.seed) == (two.kind, two.seed) == ("scratch", number)
            assert one.result == two.result
            assert RunFolder(one.run).policy.read_bytes() == RunFolder(two.run).policy.read_bytes()


@needs_signals
class TestSignals:
    @pytest.mark.usefixtures("two_workers")
    def test_ctrl_c_keeps_the_results_before_it(self, tmp_path: Path) -> None:
        def work(item: int) -> int:
            if item:
                (tmp_path / f"begun {item}").touch()
                try:
                    for _ in range(1000):
                        time.sleep(0.1)
                except KeyboardInterrupt:
                    (tmp_path / f"ended {item}").touch()
                    raise
            return item

        seen = []
        with pytest.raises(KeyboardInterrupt):  # noqa: PT012
            for number, _ in spread(work, range(9), 2):
                seen.append(number)
                _wait_until(lambda: (tmp_path / "begun 1").exists())
                signal.raise_signal(signal.SIGINT)
        assert seen == [0]
        assert (tmp_path / "ended 1").exists()
        assert not (tmp_path / "begun 3").exists()

    @pytest.mark.usefixtures("two_workers")
    def test_ctrl_c_rates_what_was_played(self, call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def until_ctrl_c(*arguments: Any, **others: Any) -> Iterator[Any]:
            for played in play_ladder(*arguments, **others):
                yield played
                signal.raise_signal(signal.SIGINT)

        monkeypatch.setattr(scripts.ladder, "play_ladder", until_ctrl_c)
        printed = call("ladder", "--only", "idle", "random", "goalie", "--points", "4", "--workers", "2",
                       "--json", "ladder.json", fails=True)  # fmt: skip
        assert "1 of 3" in printed
        assert len(json.loads((tmp_path / "ladder.json").read_text())["matches"]) == 1

    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_training_runs_are_saved(self, number: int, tmp_path: Path) -> None:
        process = start("exploit", "goalie", *LONG, "--name", "long", "--workers", "2", folder=tmp_path)
        folders = [RunFolder(tmp_path / "runs" / f"long-{kind}-0") for kind in ("scratch", "expert")]
        try:
            _wait_until(lambda: all(map(_learns, folders)), process)
            process.send_signal(number)
            printed, _ = process.communicate(timeout=200)
        finally:
            process.kill()
            process.wait()
        assert process.returncode == 128 + number, printed
        assert "Traceback" not in printed
        for folder in folders:
            history = json.loads(folder.evaluations.read_text())
            assert history["evaluations"][0]["steps"] == 0
            assert read_model(folder.model).data["num_timesteps"] > 0
            assert bool(history["report"]) == (number == signal.SIGINT)


def test_a_lost_node_is_replaced() -> None:
    """Two nodes with a processor each; the second one is lost in the midst of its task."""

    def work(item: int) -> tuple[int, str]:
        time.sleep(2 if item < 2 else 0)
        return item, ray.get_runtime_context().get_node_id()

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")  # no ports but this machine's own
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        cluster = cluster_utils.Cluster(
            initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False}
        )
        try:
            lost = cluster.add_node(num_cpus=1)
            results = spread(work, range(4), 2, cluster.address)
            seen = [next(results)]
            cluster.remove_node(lost, allow_graceful=False)
            seen += results
        finally:
            cluster.shutdown()
    assert sorted(item for _, (item, _) in seen) == [0, 1, 2, 3]


def test_without_ray_the_extra_is_named(call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    printed = call("ladder", "--only", "idle", "goalie", "--workers", "2", fails=True)
    assert "[distributed]" in printed


def test_an_address_needs_workers(call: Call) -> None:
    assert "--address" in call("ladder", "--address", "auto", fails=True)


def _learns(folder: RunFolder) -> bool:
    """Whether the run has written its log of an update."""
    return any(path.stat().st_size > 500 for path in folder.path.glob("tensorboard/events.*"))


def _wait_until(holds: Callable[[], bool], process: subprocess.Popen[str] | None = None) -> None:
    until = time.monotonic() + 200.0
    while not holds():
        assert process is None or process.poll() is None, process.communicate()[0]
        assert time.monotonic() < until
        time.sleep(0.1)
