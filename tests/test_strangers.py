"""Files from strangers: nothing in them runs, and none takes more memory than its format allows."""

from __future__ import annotations

import base64
import io
import json
import pickle
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import DDPG, DQN, PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecFrameStack

from agents.features import ForesightFeatures, RelativeFeatures, SmallCnn
from agents.models import ModelPlayer, load_player
from agents.sb3_files import NeedsTrust, actor_of, load_weights, read_model
from agents.training.hyperparameters import read_kwargs
from agents.training.zoo import ZooArgs, parsed, resolve
from airhockey_env.actions import DIRECTIONS
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.replay import Replay
from airhockey_env.sb3_vec_env import AirHockeySB3VecEnv

OFF = {"buffer_size": 100, "learning_starts": 4, "batch_size": 4, "device": "cpu", "seed": 3}
ON = {"n_steps": 4, "batch_size": 8, "n_epochs": 1, "device": "cpu", "seed": 3}
RELU = {"net_arch": [8, 6], "activation_fn": torch.nn.ReLU}
NARROW = {"features_extractor_kwargs": {"features_dim": 8}}
RELATIVE = {**RELU, "features_extractor_class": RelativeFeatures}

MODELS: dict[str, Callable[[], BaseAlgorithm]] = {
    "ppo": lambda: PPO("MlpPolicy", tables(), **ON, policy_kwargs={"net_arch": [8, 8]}),
    "ppo, its own features": lambda: PPO("MlpPolicy", tables(), **ON, use_sde=True, policy_kwargs={**RELATIVE}),
    "ppo, foresight": lambda: PPO(
        "MlpPolicy", tables(), **ON, policy_kwargs={**RELU, "features_extractor_class": ForesightFeatures}
    ),
    "ppo, one layer": lambda: PPO("MlpPolicy", tables(), **ON, policy_kwargs={"net_arch": []}),
    "ppo, directions": lambda: PPO("MlpPolicy", tables(continuous=False), **ON),
    "ppo, elu": lambda: PPO(
        "MlpPolicy", tables(), **ON, policy_kwargs={"net_arch": [8], "activation_fn": torch.nn.ELU}
    ),
    "ppo, stacked": lambda: PPO("MlpPolicy", VecFrameStack(tables(), 3), **ON),
    "ppo, pictures": lambda: PPO(
        "CnnPolicy", tables(obs_type="grayscale"), **ON, policy_kwargs={**NARROW}
    ),
    "ppo, small pictures": lambda: PPO(
        "CnnPolicy", VecFrameStack(tables(obs_type="grayscale"), 2), **ON,
        policy_kwargs={**RELU, "features_extractor_class": SmallCnn, "normalize_images": False},
    ),
    "ppo, flat pictures": lambda: PPO(
        "MlpPolicy", tables(obs_type="grayscale"), **ON, policy_kwargs={"net_arch": [4]}
    ),
    "sac": lambda: SAC("MlpPolicy", tables(), **OFF, policy_kwargs={"net_arch": [8, 8]}),
    "sac, gSDE": lambda: SAC("MlpPolicy", tables(), **OFF, use_sde=True, policy_kwargs={**RELATIVE}),
    "td3": lambda: TD3("MlpPolicy", tables(), **OFF, policy_kwargs={**RELATIVE}),
    "ddpg": lambda: DDPG("MlpPolicy", tables(), **OFF, policy_kwargs={"net_arch": [8]}),
    "dqn": lambda: DQN("MlpPolicy", tables(continuous=False), **OFF, policy_kwargs={"net_arch": [8]}),
}  # fmt: skip


def tables(**arguments: Any) -> AirHockeySB3VecEnv:
    return AirHockeySB3VecEnv(2, task="hit", opponent="idle", max_episode_steps=5, **arguments)


def moving(model: BaseAlgorithm) -> BaseAlgorithm:
    """With weights that make it move."""
    with torch.no_grad():
        for weights in model.policy.parameters():
            weights.add_(0.1 * torch.randn(weights.shape, generator=torch.Generator().manual_seed(1)))
    return model


class Evil:
    """What a pickle can do."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.marker,)


@pytest.fixture
def marker(tmp_path: Path) -> Path:
    """A file that is there if a stranger's code has run."""
    return tmp_path / "it-ran"


def rewritten(path: Path, members: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> None:
    """Put other contents into some members of a zip file."""
    with zipfile.ZipFile(path) as file:
        contents = {name: file.read(name) for name in file.namelist()}
    with zipfile.ZipFile(path, "w", compression) as file:
        for name, content in {**contents, **members}.items():
            file.writestr(name, content)


def with_pickles(path: Path, marker: Path) -> None:
    """Put code into every pickle of a model's file, and one more."""
    with zipfile.ZipFile(path) as file:
        data = json.loads(file.read("data"))
    payload = base64.b64encode(pickle.dumps(Evil(marker))).decode()
    for value in data.values():
        if isinstance(value, dict) and ":serialized:" in value:
            value[":serialized:"] = payload
    data["extra"] = {":type:": "<class 'int'>", ":serialized:": payload}
    rewritten(path, {"data": json.dumps(data).encode()})


@pytest.mark.parametrize("name", MODELS)
def test_a_model_plays_as_it_does_in_stable_baselines3(name: str, tmp_path: Path, marker: Path) -> None:
    model = moving(MODELS[name]())
    path = tmp_path / "model.zip"
    model.save(path)
    with_pickles(path, marker)
    actor = actor_of(read_model(path))
    shape = model.observation_space.shape
    assert actor.shape == shape
    random = np.random.default_rng(0)
    seen = random.uniform(-1.0, 1.0, (40, *shape)) if len(shape) == 1 else random.integers(0, 256, (5, *shape))
    seen = seen.astype(model.observation_space.dtype)
    expected, _ = model.predict(seen, deterministic=True)
    outputs = actor(seen)
    answer = outputs.argmax(axis=1) if expected.ndim == 1 else outputs.clip(-1.0, 1.0)
    np.testing.assert_allclose(answer, expected, atol=1e-6)
    assert np.std(expected) > 0.01
    player = load_player(str(path))
    if shape == (13,) and "elu" not in name:
        assert isinstance(player, MlpPolicy)
        np.testing.assert_allclose(
            player(seen), DIRECTIONS[expected] if expected.ndim == 1 else expected, atol=2e-6
        )  # fmt: skip
    else:
        assert isinstance(player, ModelPlayer)
        assert player.sight.frames == {"ppo, stacked": 3, "ppo, small pictures": 2}.get(name, 1)
    assert not marker.exists()


@pytest.mark.parametrize("name", ["ppo, its own features", "sac", "td3", "dqn"])
def test_a_built_model_takes_up_what_was_learned(name: str, tmp_path: Path, marker: Path) -> None:
    first, second = MODELS[name](), MODELS[name]()
    first.learn(20)
    path = tmp_path / "model.zip"
    first.save(path)
    with_pickles(path, marker)
    load_weights(second, path)
    for key, expected in first.get_parameters().items():
        _assert_same(second.get_parameters()[key], expected)
    assert second.num_timesteps == first.num_timesteps > 0
    assert second._n_updates == first._n_updates > 0
    assert second._episode_num == first._episode_num
    if name == "sac":
        assert second.log_ent_coef.item() == first.log_ent_coef.item() != 0.0
    second.learn(8, reset_num_timesteps=False)
    assert second.num_timesteps == first.num_timesteps + 8
    assert not marker.exists()


def _assert_same(ours: Any, theirs: Any) -> None:
    if isinstance(theirs, dict):
        assert ours.keys() == theirs.keys()
        for key in theirs:
            _assert_same(ours[key], theirs[key])
    elif isinstance(theirs, torch.Tensor):
        assert torch.equal(ours, theirs)
    else:
        assert ours == theirs


def test_another_models_weights_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.zip"
    MODELS["ppo"]().save(path)
    for name in ("ppo, one layer", "ppo, its own features", "sac"):
        with pytest.raises(ValueError, match=r"model\.zip"):
            load_weights(MODELS[name](), path)


@pytest.mark.parametrize("value", [-1, 1.5, "7", None, True, 2**70, [1]])
def test_counters_of_another_kind_are_refused(value: Any, tmp_path: Path) -> None:
    path = tmp_path / "model.zip"
    MODELS["ppo"]().save(path)
    with zipfile.ZipFile(path) as file:
        data = json.loads(file.read("data"))
    rewritten(path, {"data": json.dumps({**data, "num_timesteps": value}).encode()})
    with pytest.raises(ValueError, match=r"model\.zip .* num_timesteps"):
        load_weights(MODELS["ppo"](), path)


class Doubled(torch.nn.ReLU):
    """An activation function of somebody's own."""


def test_what_needs_trust_says_so(tmp_path: Path, marker: Path) -> None:
    path = tmp_path / "model.zip"
    model = moving(PPO("MlpPolicy", tables(), **ON, policy_kwargs={"net_arch": [8], "activation_fn": Doubled}))
    model.save(path)
    with pytest.raises(NeedsTrust, match=r"model\.zip.*Doubled.*--trust"):
        load_player(str(path))
    player = load_player(str(path), trust=True)
    assert isinstance(player, ModelPlayer)
    seen = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 13)).astype(np.float32)
    np.testing.assert_array_equal(player.answer(seen), model.predict(seen, deterministic=True)[0])
    with_pickles(path, marker)
    with pytest.raises(NeedsTrust, match="--trust"):
        load_player(str(path))
    assert not marker.exists()
    with pytest.raises(ValueError, match=r"model\.zip"):
        load_player(str(path), trust=True)
    assert marker.exists(), "or this test would show nothing"


def saved(value: Any) -> bytes:
    buffer = io.BytesIO()
    torch.save(value, buffer)
    return buffer.getvalue()


def forged(weights: bytes, change: Callable[[str, bytes], bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(weights)) as file, zipfile.ZipFile(buffer, "w", compression) as other:
        for name in file.namelist():
            other.writestr(name, change(name, file.read(name)))
    return buffer.getvalue()


def weights_of(kind: str, good: bytes, marker: Path) -> bytes:
    """A file of weights that is none, or that lies."""
    if kind == "code":
        return saved(Evil(marker))
    if kind == "code among weights":
        return saved({**torch.load(io.BytesIO(good), weights_only=True), "more": Evil(marker)})
    if kind == "an old pickle":
        return pickle.dumps(Evil(marker))
    if kind == "a huge array":  # allowed by weights_only
        return saved({"action_net.weight": bytearray(5)})
    if kind == "storage beyond its end":
        plain = torch.zeros(4)
        # A storage's number of elements stands in the pickle: 4 becomes 100.
        return forged(saved({"w": plain}), lambda name, data: data.replace(b"K\x04t", b"K\x64t", 1))
    if kind == "a view of one number":
        return saved({"action_net.weight": torch.zeros(1).expand(2**40, 2**20)})
    if kind == "compressed":
        return forged(
            saved({"w": torch.zeros(2**20)}), lambda name, data: data, zipfile.ZIP_DEFLATED
        )  # fmt: skip
    if kind == "a list":
        return saved([torch.zeros(2)])
    return b"PK" + bytes(100)


@pytest.mark.parametrize(
    "kind",
    [
        *("code", "code among weights", "an old pickle", "a huge array", "storage beyond its end"),
        *("a view of one number", "compressed", "a list", "nothing"),
    ],
)
def test_weights_that_are_none(kind: str, tmp_path: Path, marker: Path) -> None:
    path = tmp_path / "model.zip"
    MODELS["ppo"]().save(path)
    with zipfile.ZipFile(path) as file:
        good = file.read("policy.pth")
    rewritten(path, {"policy.pth": weights_of(kind, good, marker)})
    for read in (read_model, lambda path: load_weights(MODELS["ppo"](), path), lambda path: load_player(str(path))):
        with pytest.raises(ValueError, match=r"model\.zip"):
            read(path)
    assert not marker.exists()


@pytest.mark.parametrize("read", [MlpPolicy.load, Replay.load])
def test_arrays_of_objects_are_not_unpickled(read: Callable[[Path], Any], tmp_path: Path, marker: Path) -> None:
    path = tmp_path / "game.npz"
    names = ("activation", "weight_0", "bias_0", "replay", "starts", "states", "ends", "actions", "others")
    np.savez(path, **{name: np.array([Evil(marker)], object) for name in names}, allow_pickle=True)
    with pytest.raises(ValueError, match=r"game\.npz"):
        read(path)
    assert not marker.exists()
    with np.load(path, allow_pickle=True) as file:
        file["starts"]
    assert marker.exists(), "or this test would show nothing"


def test_hyperparameters_run_no_code(tmp_path: Path, marker: Path) -> None:
    path = tmp_path / "evil.yml"
    code = f"dict(net_arch=[__import__('pathlib').Path({str(marker)!r}).touch() or 8])"
    path.write_text(f'AirHockeyHit-v0: {{n_timesteps: 8, policy: MlpPolicy, policy_kwargs: "{code}"}}')
    with pytest.raises(ValueError, match=r"evil\.yml.*--trust"):
        resolve(ZooArgs(hyperparams=path))
    path.with_name("tag.yml").write_text(f"!!python/object/apply:pathlib.Path.touch [{str(marker)!r}]")
    with pytest.raises(ValueError, match=r"tag\.yml"):
        resolve(ZooArgs(hyperparams=path.with_name("tag.yml")))
    assert not marker.exists()
    assert parsed(resolve(ZooArgs(hyperparams=path, trust=True))).model["policy_kwargs"] == {"net_arch": [8]}
    assert marker.exists(), "or this test would show nothing"


DOUBLED = ", ".join(f"a{k + 1}: &a{k + 1} [*a{k}, *a{k}]" for k in range(20))


@pytest.mark.parametrize("section", ["&a {n_timesteps: 8, b: *a}", f"{{a0: &a0 [x], {DOUBLED}}}"])
def test_hyperparameters_that_multiply(section: str, tmp_path: Path) -> None:
    (tmp_path / "laughs.yml").write_text(f"AirHockeyHit-v0: {section}")
    with pytest.raises(ValueError, match=r"laughs\.yml.*10,000"):
        resolve(ZooArgs(hyperparams=tmp_path / "laughs.yml"))


@pytest.mark.parametrize("damage", ["shape", "lr", "group", "nan"])
def test_an_optimisers_state_that_does_not_fit(damage: str, tmp_path: Path) -> None:
    model = MODELS["ppo"]()
    model.learn(8)
    path = tmp_path / "model.zip"
    model.save(path)
    state = model.policy.optimizer.state_dict()
    if damage == "shape":
        state["state"][0]["exp_avg"] = torch.zeros(5, 5)
    elif damage == "nan":
        state["state"][0]["exp_avg"][:] = torch.nan
    elif damage == "lr":
        state["param_groups"][0]["lr"] = "fast"
    else:
        state["param_groups"][0]["more"] = 1.0
    rewritten(path, {"policy.optimizer.pth": saved(state)})
    with pytest.raises(ValueError, match=r"model\.zip"):
        load_weights(MODELS["ppo"](), path)


def test_policy_kwargs() -> None:
    text = "dict(net_arch=dict(pi=[64, 32], vf=[]), activation_fn=nn.ReLU, log_std_init=-2.5, ortho_init=False)"
    expected = {"net_arch": {"pi": [64, 32], "vf": []}, "activation_fn": torch.nn.ReLU, "log_std_init": -2.5}
    assert read_kwargs(text) == {**expected, "ortho_init": False}
    calls = ("dict(**{})", "dict([(1, 2)])", "open('x')", "nn.Module", "[x for x in ()]")
    for other in (*calls, "(" * 300, "dict(", "1 + 1"):
        with pytest.raises(ValueError, match="policy_kwargs"):
            read_kwargs(other)
    assert read_kwargs("dict(a=th.nn.ReLU)") == {"a": torch.nn.ReLU}
    assert read_kwargs("dict(a=[2 * 4])", trust=True) == {"a": [8]}


def test_a_function_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    Path("my_players.py").write_text("def chaser(seen):\n    return 5 * (seen[:, 8:10] - seen[:, 0:2])\nnumber = 5\n")
    seen = np.ones((3, 13), np.float32)
    assert load_player("my_players:chaser")(seen).shape == (3, 2)
    for name in ("my_players:number", "my_players:nobody", "no_such_module_here:chaser"):
        with pytest.raises(ValueError, match=f"MODEL .*{name}"):
            load_player(name)
