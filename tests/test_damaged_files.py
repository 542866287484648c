"""Whatever is in a file, reading it works or is a ValueError that names the file, and takes no more memory than it may.

The damage is drawn at random, from fixed seeds.
"""

from __future__ import annotations

import copy
import io
import json
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3 import PPO

import airhockey_env  # noqa: F401  registers
from agents.files import read_json
from agents.models import load_player
from agents.sb3_files import read_model
from agents.training.checkpoints import HISTORY
from agents.training.curves import read_runs
from agents.training.league import League
from agents.training.ppo import PpoArgs
from agents.training.self_play import SelfPlayArgs
from agents.training.train import own_args
from agents.training.zoo import ZooArgs, resolve
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.replay import RecordReplay, Replay, play_back
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv
from tests.torture.cases import Case

Read = Callable[[Path], Any]

ODD = (None, True, -1, 0, 10**400, 1e300, 0.5, "", "7", "../../x", [], [1], {}, {"a": 1}, [[]], float("nan"))
"""To be put in the place of a value of JSON."""


def outcome(read: Read, path: Path) -> bool:
    """Whether a file is read; if not, it has to be for a ValueError with the file's name, or its folder's."""
    message = None
    try:
        read(path)
    except ValueError as error:
        message = str(error)
    assert message is None or path.name in message or str(path.parent) in message
    return message is None


def league_of(path: Path) -> None:
    League(SelfPlayArgs(opponent=("striker",))).load(path.parent)


def config_of(path: Path) -> None:
    own_args(PpoArgs(resume=str(path.parent)))


def replayed(path: Path) -> None:
    for _ in play_back(path):
        pass


def run_of(path: Path) -> None:
    read_runs([str(path.parent)])


def hyperparameters_of(path: Path) -> None:
    resolve(ZooArgs(hyperparams=path))


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of files that are as they should be."""
    folder = tmp_path_factory.mktemp("good")
    policy = MlpPolicy([np.ones((4, 13)), np.ones((2, 4))], [np.zeros(4), np.zeros(2)], "relu")
    policy.save(folder / "policy.npz")
    for name, arguments in (
        ("game.npz", {"opponent": "striker"}),
        ("drawn.npz", {"randomize": {"puck_mass": (0.01, 0.02)}, "continuous": False}),
    ):
        env = RecordReplay(gym.make("AirHockey-v0", max_episode_steps=8, **arguments), folder / name)
        env.action_space.seed(0)
        for seed in range(2):
            env.reset(seed=seed)
            for _ in range(8):
                env.step(env.action_space.sample())
        env.close()
    PPO("MlpPolicy", AirHockeySB3VecEnv(1), policy_kwargs={"net_arch": [4]}, device="cpu").save(folder / "model.zip")
    row = {"steps": 8, "seconds": 1.5, "opponent": "striker", "wins": 1, "losses": 1, "draws": 0, "points": 2,
           "win_rate": 0.5, "decided_win_rate": None,
           "win_rate_95": [0.1, 0.9], "decided_win_rate_95": [0.1, 0.9]}  # fmt: skip
    update = {"steps": 4, "seconds": 0.5, "kl": None}
    history = {"practice": None, "evaluations": [row], "updates": [update], "report": [row]}
    (folder / "evaluations.json").write_text(json.dumps(history))
    (folder / "config.json").write_text(json.dumps({"opponent": ["striker"], "eval_opponent": "striker", "seed": 3}))
    member = {"points": 3, "won": 0.5, "drawn": 0.0, "file": None}
    members = [{"name": name, **member} for name in ("latest self", "striker")]
    members.append({**member, "name": "self at 5", "file": "5.npz"})
    (folder / "league").mkdir()
    policy.save(folder / "league" / "5.npz")
    responses = {"due": 9, "at": None}
    (folder / "league.json").write_text(json.dumps({"due": 8, "responses": responses, "members": members}))
    Case("gym", {"task": "hit"}, [{"do": "reset", "seed": 1}]).save(folder / "case.json")
    (folder / "tiny.yml").write_text(
        "AirHockeyHit-v0: {n_timesteps: 8, policy: MlpPolicy, policy_kwargs: 'dict(net_arch=[4])', clip_range: lin_0.2}"
    )
    return folder


READERS: list[tuple[str, Read]] = [
    ("policy.npz", MlpPolicy.load),
    ("policy.npz", lambda path: load_player(str(path))),
    ("game.npz", replayed),
    ("drawn.npz", replayed),
    ("model.zip", lambda path: load_player(str(path))),
    ("evaluations.json", lambda path: read_json(path, HISTORY)),
    ("evaluations.json", run_of),
    ("config.json", config_of),
    ("config.json", run_of),
    ("league.json", league_of),
    ("tiny.yml", hyperparameters_of),
    ("case.json", Case.load),
]


@pytest.fixture
def spoilt(good: Path, tmp_path: Path) -> Path:
    """A copy of the good files, to be spoilt."""
    for path in good.rglob("*"):
        if path.is_file():
            copied = tmp_path / path.relative_to(good)
            copied.parent.mkdir(exist_ok=True)
            copied.write_bytes(path.read_bytes())
    return tmp_path


@pytest.mark.parametrize(("name", "read"), READERS)
def test_bytes_cut_off_and_changed(name: str, read: Read, spoilt: Path) -> None:
    random = np.random.default_rng(1)
    path = spoilt / name
    whole = path.read_bytes()
    assert outcome(read, path)
    read_all = True
    for _ in range(40):
        data = bytearray(whole)
        if random.random() < 0.4:
            del data[random.integers(len(data)) :]
        for place in random.integers(len(data), size=random.integers(1, 4)) if data else ():
            data[place] = random.integers(256)
        path.write_bytes(data)
        read_all &= outcome(read, path)
    assert not read_all


def places(data: Any, before: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The ways to every value in JSON."""
    yield before
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        yield from places(value, (*before, key))


def changed(data: Any, place: tuple[Any, ...], value: Any, remove: bool = False) -> Any:
    """A copy with another value in a place, or with nothing there."""
    if not place:
        return value
    other = copy.deepcopy(data)
    inner = other
    for key in place[:-1]:
        inner = inner[key]
    if remove:
        del inner[place[-1]]
    else:
        inner[place[-1]] = value
    return other


def texts(data: Any) -> Iterator[str]:
    """JSON with one thing changed."""
    random = np.random.default_rng(2)
    for place in places(data):
        if place:
            yield json.dumps(changed(data, place, None, remove=True))
        for k in random.choice(len(ODD), 3, replace=False):
            yield json.dumps(changed(data, place, ODD[k]))
        if place:
            yield json.dumps(changed(data, place, 0)).replace("0", "[" * 50_000, 1)
    yield '{"a": ' * 50_000
    yield json.dumps(data)[:-1] + ', "a": [' + "[]," * 1_000_000 + "0]}"
    yield json.dumps(data)[:-1] + ', "a": 1, "a": 2}'


@pytest.mark.parametrize(("name", "read"), [case for case in READERS if case[0].endswith(".json")])
def test_other_json(name: str, read: Read, spoilt: Path) -> None:
    path = spoilt / name
    good, read_all = json.loads(path.read_text()), True
    for text in texts(good):
        path.write_text(text)
        read_all &= outcome(read, path)
    assert not read_all


def rewritten(path: Path, change: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
    with np.load(path) as file:
        arrays = dict(file)
    np.savez(path, **change(arrays))


@pytest.mark.parametrize("name", ["game.npz", "drawn.npz"])
def test_other_notes_of_a_replay(name: str, spoilt: Path) -> None:
    path = spoilt / name
    whole = path.read_bytes()
    with np.load(path) as file:
        notes = json.loads(str(file["replay"]))
    cases = list(texts(notes))
    for k in np.random.default_rng(4).choice(len(cases), 60, replace=False):
        path.write_bytes(whole)
        rewritten(path, lambda arrays, k=k: {**arrays, "replay": np.array(cases[k])})
        outcome(replayed, path)


@pytest.mark.parametrize("name", ["game.npz", "drawn.npz"])
def test_other_states_and_actions(name: str, spoilt: Path) -> None:
    """Single bytes of arrays, in a file that is sound otherwise."""
    random = np.random.default_rng(3)
    path = spoilt / name
    whole, refused = path.read_bytes(), 0

    def flip(arrays: dict[str, Any]) -> dict[str, Any]:
        key = random.choice(["starts", "states", "ends", "actions"])
        data = bytearray(arrays[key].tobytes())
        data[random.integers(len(data))] = random.integers(256)
        return {**arrays, key: np.frombuffer(bytes(data), arrays[key].dtype).reshape(arrays[key].shape)}

    for _ in range(60):
        path.write_bytes(whole)
        rewritten(path, flip)
        refused += not outcome(replayed, path)
    assert refused > 20


def test_games_that_are_over_or_never_began(spoilt: Path) -> None:
    path = spoilt / "game.npz"
    replay = Replay.load(path)
    for name, value in (("done", True), ("side", 0), ("steps", -1), ("clock", -5), ("score", -1)):
        states = replay.states.copy()
        states[name] = value
        rewritten(path, lambda arrays, states=states: {**arrays, "states": states})
        with pytest.raises(ValueError, match=r"game\.npz"):
            replayed(path)


@pytest.mark.parametrize(("name", "read"), [case for case in READERS if case[0].endswith(".npz")])
def test_other_arrays(name: str, read: Read, spoilt: Path) -> None:
    path = spoilt / name
    whole = path.read_bytes()
    with np.load(path) as file:
        names = list(file.files)
    for key in names:
        for other in (
            np.array(5), np.array("text"), np.array([1 + 2j]), np.zeros((0, 13)), np.zeros((2, 2, 2)),
            np.zeros(3, "M8[s]"),
            np.array([b"7"]), np.full((2, 13), np.nan), np.full((2, 13), 1e300), np.zeros(1, [("a", "f8")]),
        ):  # fmt: skip
            path.write_bytes(whole)
            rewritten(path, lambda arrays, key=key, other=other: {**arrays, key: other})
            outcome(read, path)
        path.write_bytes(whole)
        rewritten(path, lambda arrays, key=key: {k: v for k, v in arrays.items() if k != key})
        outcome(read, path)


def header(shape: tuple[int, ...], descr: str) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": descr, "fortran_order": False, "shape": shape})
    return buffer.getvalue()


@pytest.mark.parametrize("shape", [(2**40,), (2**31, 2**31), (2**62, 4), (-1,), (True, 13)])
@pytest.mark.parametrize(("name", "read"), [READERS[0], READERS[2]])
def test_sizes_that_are_not_there(name: str, read: Read, shape: tuple[int, ...], spoilt: Path) -> None:
    path = spoilt / name
    with zipfile.ZipFile(path) as file:
        members = {member: file.read(member) for member in file.namelist()}
    with zipfile.ZipFile(path, "w") as file:
        for k, (member, data) in enumerate(members.items()):
            file.writestr(member, header(shape, "<f4") + bytes(16) if k == len(members) - 1 else data)
    assert not outcome(read, path)


@pytest.mark.parametrize(("name", "read"), [READERS[0], READERS[2]])
def test_names_that_stand_twice(name: str, read: Read, spoilt: Path) -> None:
    path = spoilt / name
    with zipfile.ZipFile(path, "a") as file:
        first = file.namelist()[0]
        data = file.read(first)
        with pytest.warns(UserWarning, match="Duplicate name"):
            file.writestr(first, data)
    assert not outcome(read, path)


@pytest.mark.parametrize(("module", "name", "read"), [
    ("airhockey_env.opponents.policy", "policy.npz", MlpPolicy.load),
    ("airhockey_env.replay.file", "game.npz", Replay.load),
    ("agents.sb3_files", "model.zip", read_model),
])  # fmt: skip
def test_files_that_would_unpack_to_much(
    module: str, name: str, read: Read, spoilt: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A thousandfold, in a member that nobody asks for; refused by what the file says of itself."""
    path = spoilt / name
    monkeypatch.setattr(f"{module}.MOST_BYTES", 10**6)
    assert outcome(read, path)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as file:
        file.writestr("more.npy", header((10**6,), "<f8") + bytes(8 * 10**6))
    assert path.stat().st_size < 10**5

    def never(*_: Any) -> None:
        raise AssertionError("it was expanded")

    monkeypatch.setattr(zipfile.ZipExtFile, "read", never)
    assert not outcome(read, path)


def test_a_league_writes_and_reads_in_its_own_folder(spoilt: Path) -> None:
    path = spoilt / "league.json"
    good = json.loads(path.read_text())
    for change in ({"name": "self at ../../x"}, {"file": "../policy.npz"}, {"file": str(spoilt / "policy.npz")}):
        members = [*good["members"][:2], {**good["members"][2], **change}]
        path.write_text(json.dumps({**good, "members": members}))
        assert not outcome(league_of, path)


def test_text_files_that_are_too_large(spoilt: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("agents.files.MOST_BYTES", 100)
    assert not outcome(read_json, spoilt / "evaluations.json")
