"""Workers that learn together, as two processes of torch.distributed: what they share, and what each has of its own."""

from __future__ import annotations

import dataclasses
import json
import os
import pickle
import signal
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.error import DependencyNotInstalled
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.type_aliases import RolloutBufferSamples
from torch import distributed, multiprocessing

from agents.seeding import sequence
from agents.training import checkpoints, ppo, self_play, workers
from agents.training.ppo import PpoArgs, share_of_worker
from agents.training.run import Run, learn_phases
from agents.training.runs import RunFolder
from agents.training.self_play import SelfPlayArgs
from agents.training.stopping import Stop
from agents.training.train import train
from tests.helpers import some_policy

UPDATE = 8 * 8
ARGS = SelfPlayArgs(
    steps=110 * UPDATE,
    eval_every=40 * UPDATE,
    warmup_steps=50 * UPDATE,
    warmup_success=0.0,  # practice ends when the window of episodes is full
    num_envs=8,
    n_steps=8,
    batch_size=32,
    n_epochs=1,
    net_width=8,
    opponent=("striker", "idle"),
    snapshot_every=20 * UPDATE,
    most_past_selves=2,
    eval_episodes=2,
    camera="robot",
    randomize="tables",
    stack=2,
)


class Look(BaseCallback):
    """Notes the first observations of every phase, and the opponents that are drawn there."""

    def __init__(self) -> None:
        super().__init__()
        self.first: list[Any] = []

    def _on_rollout_start(self) -> None:
        if self.n_calls == 0 or self.training_env is not self.env:
            self.env = self.training_env
            self.first.append((np.array(self.model._last_obs), torch.get_rng_state()))  # type: ignore[attr-defined]

    def _on_step(self) -> bool:
        return True


def learn(args: SelfPlayArgs, signals: Any, look: Look) -> dict[str, Any]:
    """Learn as one of the workers, and return what it has at the end."""
    folder = RunFolder.create(args.name)
    recipe = self_play.RECIPE
    setup = recipe.build(share_of_worker(args), False)
    history: dict[str, Any] = {"practice": None, "evaluations": [], "updates": [], "report": []}
    run = Run(recipe, folder, args, setup, history)
    stop = Stop()
    learn_phases(run, [look], stop, [workers.Together(stop, signals)])
    assert setup.league is not None
    return {
        "hash": workers.weights_hash(run.model),
        "steps": run.model.num_timesteps,
        "history": history,
        "members": setup.league.members,
        "asked": stop.asked,
        "first": look.first,
        "left": sorted(path.name for path in Path("shared").iterdir()),
        "files": sorted(path.name for path in folder.path.rglob("*") if path.is_file()),
    }


def average() -> list[float]:
    """The gradients (2,) of this worker after a backward pass and clipping to a norm of 1."""
    weight = torch.nn.Parameter(torch.zeros(2))
    unused = torch.nn.Parameter(torch.zeros(3))
    hooks = workers.average_gradients([weight, unused], lambda seconds: None)
    for _ in range(2):  # the second backward pass as the first
        weight.grad = None
        (weight @ (torch.tensor([3.0, 0.0]) if workers.rank() else torch.tensor([0.0, 4.0]))).backward()
    torch.nn.utils.clip_grad_norm_([weight], 1.0)
    for hook in hooks:
        hook.remove()
    assert weight.grad is not None
    return weight.grad.tolist()


def normalise() -> list[list[float]]:
    """The advantages of this worker's two minibatches, after those of both workers were normalised together."""
    rest = [torch.zeros(2)] * 4
    own = [
        RolloutBufferSamples(*rest, torch.tensor(a) + 4.0 * workers.rank(), rest[0]) for a in ([0.0, 2.0], [5.0, 5.0])
    ]
    return [samples.advantages.tolist() for samples in workers.normalised(own)]


def child(rank: int, folder: Path) -> None:
    """A worker. It writes what it has into a file."""
    os.environ["GLOO_SOCKET_IFNAME"] = "lo"
    os.chdir(folder / str(rank))
    distributed.init_process_group("gloo", (folder / "store").as_uri(), rank=rank, world_size=2)
    torch.set_num_threads(1)
    ppo.WINDOW = 4
    args = dataclasses.replace(self_play.resolve(ARGS), workers=2)
    asked = [signal.SIGINT]
    found = {
        "average": average(),
        "normalise": normalise(),
        "total": workers.total(1.0, rank),
        "gather": workers.gather(("worker", rank)),
        "whole": learn(dataclasses.replace(args, name="whole"), lambda steps: [], Look()),
        "stopped": learn(
            dataclasses.replace(args, name="stopped", warmup_steps=0, exchange=Path("shared")),
            lambda steps: asked if steps >= 3 * UPDATE else [],
            Look(),
        ),
    }
    Path("found").write_bytes(pickle.dumps(found))


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What the two workers have at the end."""
    folder = tmp_path_factory.mktemp("workers")
    for rank in range(2):
        (folder / str(rank) / "shared").mkdir(parents=True)
    some_policy().save(folder / "0" / "shared" / "somebody.npz")  # the folder of worker 0 counts
    multiprocessing.spawn(child, (folder,), nprocs=2)
    return [pickle.loads((folder / str(rank) / "found").read_bytes()) for rank in range(2)]


def test_gradients_are_averaged_and_then_clipped(both: list[dict[str, Any]]) -> None:
    for found in both:
        np.testing.assert_allclose(found["average"], np.array([1.5, 2.0]) / 2.5, rtol=1e-5)
        assert found["total"] == [2.0, 1.0]


def test_advantages_are_normalised_over_all_workers(both: list[dict[str, Any]]) -> None:
    whole = np.array([[0.0, 2.0, 4.0, 6.0], [5.0, 5.0, 9.0, 9.0]])
    expected = (whole - whole.mean(1, keepdims=True)) / whole.std(1, ddof=1, keepdims=True)
    for rank, found in enumerate(both):
        np.testing.assert_allclose(found["normalise"], expected[:, 2 * rank : 2 * rank + 2], rtol=1e-6)


def test_workers_gather(both: list[dict[str, Any]]) -> None:
    for found in both:
        assert found["gather"] == [("worker", 0), ("worker", 1)]


def test_all_hold_the_same_after_a_hundred_updates(both: list[dict[str, Any]]) -> None:
    first, second = (found["whole"] for found in both)
    assert len(first["history"]["updates"]) > 100
    for name in ("hash", "steps", "members"):
        assert first[name] == second[name], name
    assert first["history"]["practice"] == second["history"]["practice"]
    assert 0 < first["history"]["practice"] < ARGS.warmup_steps, "by its episodes"
    assert first["history"]["practice"] % UPDATE == ARGS.num_envs, "a step after the rollout that they ended in"
    assert first["steps"] == ARGS.steps + ARGS.num_envs, "of both"
    assert [member.name for member in first["members"][:3]] == ["latest self", "striker", "idle"]
    assert sum(member.points for member in first["members"]) > 0


def test_one_evaluates_and_writes(both: list[dict[str, Any]]) -> None:
    first, second = (found["whole"] for found in both)
    assert {"model.zip", "policy.npz", "evaluations.json", "league.json"} <= set(first["files"])
    assert second["files"] == []
    rows = [[row["steps"] for row in found["history"]["evaluations"]] for found in (first, second)]
    assert rows[0] == rows[1]
    assert [steps // (40 * UPDATE) for steps in rows[0]] == [0, 1, 2]
    assert second["history"]["updates"] == []
    waited = [row["averaging"] for row in first["history"]["updates"] if "averaging" in row]
    assert len(waited) == len(first["history"]["updates"]) - 1, "before the first update there was none"
    assert all(0.0 < share < 1.0 for share in waited)


def test_each_has_random_numbers_of_its_own(both: list[dict[str, Any]]) -> None:
    first, second = (found["whole"]["first"] for found in both)
    assert len(first) == len(second) == 2, "practice and points"
    for (seen, state), (other, other_state) in zip(first, second, strict=True):
        assert seen.shape == other.shape == (4, 2, 15), "half of the tables"
        assert not {row.tobytes() for row in seen} & {row.tobytes() for row in other}
        assert not torch.equal(state, other_state)


def test_all_stop_at_the_same_step(both: list[dict[str, Any]]) -> None:
    first, second = (found["stopped"] for found in both)
    assert first["asked"] == second["asked"] == [signal.SIGINT]
    assert first["steps"] == second["steps"] == 3 * UPDATE + 8, "the step after the rollout in which it arrived"
    assert first["hash"] == second["hash"]


def test_all_take_in_what_worker_0_finds(both: list[dict[str, Any]]) -> None:
    first, second = (found["stopped"] for found in both)
    names = ["latest self", "striker", "idle", "self at 0", "other somebody"]
    assert [[member.name for member in found["members"]] for found in (first, second)] == [names, names]
    assert first["left"] == ["somebody.npz", "stopped@0.npz"]
    assert second["left"] == []


def test_without_a_group_there_is_one_worker() -> None:
    assert (workers.number(), workers.rank(), workers.part()) == (1, 0, ())
    assert workers.gather("it") == ["it"]
    assert workers.total(1, 2.5) == [1.0, 2.5]


def test_the_streams_of_workers_differ() -> None:
    drawn = {tuple(sequence("training", 0, 512, *part).generate_state(4)) for part in ((), (1,), (2,), (513,))}
    assert len(drawn) == 4


def test_shares() -> None:
    share = share_of_worker(PpoArgs(num_envs=512, batch_size=2048, workers=4, learning_rate=1e-3))
    assert (share.num_envs, share.batch_size, share.n_steps, share.learning_rate) == (128, 512, 32, 1e-3)
    assert share_of_worker(PpoArgs()) == PpoArgs()


@pytest.mark.parametrize(
    ("given", "named"),
    [({"workers": 0}, "--workers must be"), ({"workers": 3}, "--num-envs must be a multiple of --workers 3"),
     ({"workers": 3, "num_envs": 6}, "--batch-size must be a multiple of --workers 3"),
     ({"workers": 2, "batch_size": 2}, "--batch-size must be a multiple of --workers 2, at least 4"),
     ({"address": "auto"}, "--address goes with --workers")],
)  # fmt: skip
def test_options(given: dict[str, Any], named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(ppo, "check_ray", lambda option: None)
    with pytest.raises(ValueError, match=named):
        train(PpoArgs(**given))
    assert not list(tmp_path.iterdir())


def test_without_ray_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(DependencyNotInstalled, match=r"--workers .*\[distributed\]"):
        train(PpoArgs(workers=2))
    assert not list(tmp_path.iterdir())


def test_callbacks_and_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="callbacks must be empty"):
        train(PpoArgs(workers=2), callbacks=[Look()])
    assert not list(tmp_path.iterdir())


def test_a_worker_whose_run_was_taken_over_writes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder = RunFolder.create("own")
    args = ppo.resolve(PpoArgs(num_envs=4, n_steps=4, batch_size=8, net_width=8, steps=32, eval_every=16))
    setup = ppo.build(args, True)
    history: dict[str, Any] = {"practice": None, "evaluations": [], "updates": [], "report": []}
    with folder.locked():
        Run(ppo.RECIPE, folder, args, setup, history, folder.owner()).save()
        checkpoint = folder.evaluations.read_bytes()
        history["practice"] = 1
        with pytest.raises(BlockingIOError, match=f"process {os.getpid()}"):
            Run(ppo.RECIPE, folder, args, setup, history, "process 1 on another machine").save()
    assert folder.evaluations.read_bytes() == checkpoint
    assert json.loads(checkpoint)["practice"] is None
    assert checkpoints.load(folder, setup)["practice"] is None
