"""Read Stable-Baselines3's model files without running any code in them.

Such a file is a zip of PyTorch weights and a JSON file named `data`. Stable-Baselines3 pickles everything that JSON
cannot represent, and a pickle can run any code. The functions here do not open pickles: weights are read with
`torch.load(weights_only=True)`, counters are plain JSON, and the structure of the network is inferred from the names
and shapes of its weights and from the readable text that Stable-Baselines3 stores beside each pickle. If that is not
enough, `trusted_policy` opens the pickles.
"""

from __future__ import annotations

import io
import math
import pickletools
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.save_util import recursive_getattr
from stable_baselines3.common.torch_layers import FlattenExtractor, NatureCNN
from torch import nn

from agents.features import ForesightFeatures, RelativeFeatures, SmallCnn, stack_of_shape
from agents.sight import StateFromPictures
from airhockey_env.files import check_archive, parse_json
from airhockey_env.tables import FULL_SIZE

MOST_BYTES, MOST_TIMES = 64 * 2**20, 4
"""A file may unpack to `MOST_BYTES`, or to `MOST_TIMES` its own size if that is more: Stable-Baselines3 does not
compress, and weights are hardly compressible."""

COUNTERS = ("num_timesteps", "_total_timesteps", "_num_timesteps_at_start", "_episode_num", "_n_updates")
"""The counters of a model, which are plain whole numbers in its JSON."""

LIBRARIES = ("Python", "Stable-Baselines3", "PyTorch", "Numpy", "Gymnasium")
"""What `read_versions` looks for, as Stable-Baselines3 writes it."""

MOST_VERSIONS = 2**14
"""Greatest size of the list of versions that is read, bytes."""

ACTIVATIONS: dict[str, type[nn.Module]] = {
    f"<class 'torch.nn.modules.activation.{kind.__name__}'>": kind
    for kind in (nn.Tanh, nn.ReLU, nn.ELU, nn.GELU, nn.LeakyReLU, nn.SiLU)
}
"""Activation functions by the readable text beside their pickles."""

_GLOBALS = {"collections OrderedDict", "torch._utils _rebuild_tensor_v2", "torch._utils _rebuild_parameter"}
"""The globals that weights need, besides types of storages. `weights_only` allows more, such as a bytearray of any
size."""

_STUDENT, _SEEN = "<class 'agents.training.student.StudentFeatures'>", re.compile(r"'seen': Box\([^()]*\(([\d, ]+)\)")
"""The features of a student, and in its space the shape of what it sees, as they stand beside their pickles."""

_STORAGE = re.compile(r"torch (Float|Double|Half|BFloat16|Long|Int|Short|Char|Byte|Bool)Storage")


class NeedsTrust(ValueError):
    """The file may be a model, but its network cannot be determined without opening its pickles."""


@dataclass(frozen=True)
class SavedModel:
    """The contents of a model file, without its pickles."""

    path: Path
    data: dict[str, Any]
    """The JSON data. A pickled value is a dict with ":type:" and readable fields."""
    params: dict[str, Any]
    """State dicts by their names in the model, such as "policy" and "policy.optimizer"."""
    variables: dict[str, torch.Tensor]
    """Other tensors, such as SAC's "log_ent_coef"."""


def read_model(path: Path) -> SavedModel:
    """Read a model file without unpickling anything.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is not a Stable-Baselines3 model, is damaged, or would unpack to too much data.
    """
    if not path.is_file():
        raise FileNotFoundError(f"there is no file {path}")
    try:
        with zipfile.ZipFile(path) as archive:
            check_archive(archive, max(MOST_BYTES, MOST_TIMES * path.stat().st_size))
            names = archive.namelist()
            if "data" not in names or "policy.pth" not in names:
                raise ValueError("it is a zip file of something else")
            data = parse_json(archive.read("data").decode(), constants=True)
            if not isinstance(data, dict):
                raise ValueError("its data are no JSON object")
            # The pickled text is not needed and often long.
            data = {name: _without_pickle(value) for name, value in data.items()}
            params = {name[: -len(".pth")]: _weights(archive.read(name)) for name in names if name.endswith(".pth")}
        variables = params.pop("pytorch_variables", None) or {}
        if not all(isinstance(value, torch.Tensor) for value in (*params["policy"].values(), *variables.values())):
            raise ValueError("its weights are no tensors")
    except Exception as error:  # a damaged zip, JSON or PyTorch file may raise anything
        raise ValueError(f"{path} does not hold a model of Stable-Baselines3: {error}") from error
    return SavedModel(path, data, params, variables)


def read_versions(path: Path) -> dict[str, str]:
    """The versions of Python and of the libraries that Stable-Baselines3 has noted in a model.zip, where it has."""
    try:
        with zipfile.ZipFile(path) as archive, archive.open("system_info.txt") as file:
            lines = file.read(MOST_VERSIONS).decode("utf-8", "replace").splitlines()
    except (KeyError, OSError, zipfile.BadZipFile, RuntimeError):
        return {}
    found = dict(line.removeprefix("- ").split(": ", 1) for line in lines if ": " in line)
    return {library: found[library].split()[0] for library in LIBRARIES if found.get(library, "").strip()}


def _without_pickle(value: Any) -> Any:
    if isinstance(value, dict) and ":serialized:" in value:
        return {name: part for name, part in value.items() if name != ":serialized:"}
    return value


def _weights(file: bytes) -> Any:
    """Read tensors and plain values that were written by `torch.save`.

    Raises:
        ValueError: the file contains something else, or sizes that are inconsistent.
    """
    with zipfile.ZipFile(io.BytesIO(file)) as archive:
        check_archive(archive, len(file))  # PyTorch does not compress
        pickles = [name for name in archive.namelist() if name.endswith("data.pkl")]
        if len(pickles) != 1:
            raise ValueError("weights must be a file of torch.save")
        for operation, argument, _ in pickletools.genops(archive.read(pickles[0])):
            known = argument in _GLOBALS or _STORAGE.fullmatch(str(argument))
            if operation.name in ("STACK_GLOBAL", "INST") or (operation.name == "GLOBAL" and not known):
                raise ValueError(f"weights must be tensors alone, and there is {argument!r} among them")
        records = sorted(info.file_size for info in archive.infolist() if "/data/" in info.filename and info.file_size)
    loaded = torch.load(io.BytesIO(file), map_location="cpu", weights_only=True)
    # PyTorch takes the sizes of storages from the pickle without checking them against the file.
    tensors = list(_tensors(loaded))
    storages = {tensor.untyped_storage().data_ptr(): tensor.untyped_storage().nbytes() for tensor in tensors}
    if sorted(size for size in storages.values() if size) != records:
        raise ValueError("its tensors are not of the sizes that they are said to be")
    if any(tensor.numel() * tensor.element_size() > tensor.untyped_storage().nbytes() for tensor in tensors):
        raise ValueError("its tensors are larger than what they hold")
    if not all(bool(torch.isfinite(tensor).all()) for tensor in tensors):
        raise ValueError("its tensors hold what is no finite number")
    return loaded


def _tensors(value: Any, depth: int = 0) -> Any:
    """Yield all tensors in the state dict of a model or an optimizer.

    Raises:
        ValueError: it contains something else, or is nested too deeply.
    """
    if depth > 4:
        raise ValueError("weights must be a state dict")
    if isinstance(value, torch.Tensor):
        yield value
    elif isinstance(value, dict):
        for part in value.values():
            yield from _tensors(part, depth + 1)
    elif isinstance(value, (list, tuple)):
        for part in value:
            yield from _tensors(part, depth + 1)
    elif not (value is None or isinstance(value, (bool, int, float, str))):
        raise ValueError(f"weights must be a state dict, and there is {value!r} in it")


def load_weights(model: BaseAlgorithm, path: Path) -> None:
    """Load weights, optimizer states and counters from a file into a newly built model of the same architecture.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file is not a model, or a model of another architecture. The model may be partly changed.
    """
    saved = read_model(path)
    names, variables = model._get_torch_save_params()
    try:
        if set(saved.params) != set(names) or set(saved.variables) != set(variables):
            raise ValueError(
                f"it must have {sorted((*names, *variables))}, and it has {sorted((*saved.params, *saved.variables))}"
            )
        counters = {name: saved.data.get(name) for name in COUNTERS}
        for name, count in counters.items():
            if type(count) is not int or not 0 <= count < 2**63:
                raise ValueError(f"{name} must be a whole number from 0 up, got {count!r}")
        for name in names:
            own = recursive_getattr(model, name)
            if isinstance(own, torch.optim.Optimizer):
                _check_optimiser(own, saved.params[name])
        model.set_parameters(saved.params, exact_match=True, device=model.device)
        for name, value in saved.variables.items():
            own = recursive_getattr(model, name)
            if own.shape != value.shape:
                raise ValueError(f"{name} must be of shape {tuple(own.shape)}, got {tuple(value.shape)}")
            own.data.copy_(value)
    except (ValueError, RuntimeError, KeyError, TypeError, AttributeError, IndexError) as error:
        raise ValueError(f"{path} does not hold a model as this one: {error}") from error
    model.__dict__.update(counters)


def _check_optimiser(own: torch.optim.Optimizer, saved: Any) -> None:
    """Check that a state matches an optimizer, which would accept any state and fail in its first step.

    Raises:
        ValueError: it does not match.
    """
    state, groups = saved["state"], saved["param_groups"]
    for group, mine in zip(groups, own.state_dict()["param_groups"], strict=True):
        odd = [name for name, value in group.items() if name not in mine or _kind(value) != _kind(mine[name])]
        if odd or group["params"] != mine["params"]:
            raise ValueError(f"an optimiser's groups are other ones: {odd or 'params'}")
    parameters = [parameter for group in own.param_groups for parameter in group["params"]]
    for number, values in state.items():
        shapes = ((), parameters[number].shape)
        if not all(isinstance(value, torch.Tensor) and value.shape in shapes for value in values.values()):
            raise ValueError(f"an optimiser's state of parameter {number} is not of the parameter's shape")


def _kind(value: Any) -> type:
    return float if type(value) is int else type(value)


@dataclass(frozen=True)
class Actor:
    """The network of a deterministic player."""

    features: nn.Module  # before the layers
    layers: tuple[tuple[torch.Tensor, torch.Tensor], ...]  # (out, in) weights and (out,) biases
    activation: type[nn.Module]  # between the layers
    clip: float | None  # of the outputs: SAC's with gSDE
    squash: bool  # whether tanh comes last
    shape: tuple[int, ...]  # of one observation, as the network takes it

    @torch.no_grad()
    def __call__(self, observations: NDArray[Any]) -> NDArray[np.float32]:
        """Return the outputs (N, 2) or (N, 9) for observations (N, *shape), before clipping to the action space."""
        x = self.features(torch.as_tensor(observations).float())
        activation = self.activation()
        for number, (weight, bias) in enumerate(self.layers, 1):
            x = nn.functional.linear(x, weight, bias)
            x = activation(x) if number < len(self.layers) else x
        if self.clip is not None:
            x = nn.functional.hardtanh(x, -self.clip, self.clip)
        return (torch.tanh(x) if self.squash else x).numpy()


class _Divided(nn.Module):
    """Divides pictures by 255, as Stable-Baselines3 does unless `normalize_images=False`."""

    def __init__(self, features: nn.Module) -> None:
        super().__init__()
        self.features = features

    def forward(self, pictures: torch.Tensor) -> torch.Tensor:
        return self.features(pictures / 255.0)


class _Kind(NamedTuple):
    """The structure of a kind of policy, given by the names of its weights."""

    mark: str  # a name that no other kind has
    layers: tuple[str, ...]  # of the deterministic player, in order
    features: str  # the feature extractor before them
    others: tuple[str, ...]  # weights that the player does not need
    activation: type[nn.Module]  # unless `policy_kwargs` name another
    squash: bool = False
    twins: tuple[str, ...] = ()  # other names of the features


_SAC = "actor.latent_pi.0.weight"
_KINDS = (
    _Kind(  # PPO, A2C, TRPO
        "action_net.weight", ("mlp_extractor.policy_net", "action_net"), "pi_features_extractor",
        ("mlp_extractor.value_net.", "value_net.", "log_std"), nn.Tanh,
        twins=("features_extractor.", "vf_features_extractor."),
    ),
    _Kind(  # SAC, TQC
        _SAC, ("actor.latent_pi", "actor.mu"), "actor.features_extractor",
        ("actor.log_std", "critic.", "critic_target."), nn.ReLU, squash=True,
    ),
    _Kind(  # TD3, DDPG
        "actor.mu.0.weight", ("actor.mu",), "actor.features_extractor",
        ("actor_target.", "critic.", "critic_target."), nn.ReLU, squash=True,
    ),
    _Kind("q_net.q_net.0.weight", ("q_net.q_net",), "q_net.features_extractor", ("q_net_target.",), nn.ReLU),  # DQN
)  # fmt: skip


def actor_of(saved: SavedModel) -> Actor:
    """Build the deterministic player of a model file.

    Supports policies of PPO, A2C, TRPO, SAC, TQC, TD3, DDPG and DQN with the networks of Stable-Baselines3 and of this
    project (`agents.features`).

    Raises:
        NeedsTrust: the network is of another kind, or only a pickle says of which kind.
        ValueError: the weights are inconsistent.
    """
    try:
        return _actor(saved)
    except NeedsTrust as error:
        raise NeedsTrust(f"{saved.path}: {error}") from error
    except Exception as error:  # inconsistent weights may raise anything
        raise ValueError(f"{saved.path} does not hold a player of this game: {error}") from error


def _actor(saved: SavedModel) -> Actor:
    weights, kwargs = dict(saved.params["policy"]), saved.data.get("policy_kwargs", {})
    shape = _shape(saved.data.get("observation_space"))
    if not isinstance(kwargs, dict) or shape is None:
        raise NeedsTrust("its data do not tell in plain text what the network sees")
    known = [kind for kind in _KINDS if kind.mark in weights]
    if not known:
        raise NeedsTrust(f"its network is of another kind than those known here (it has {sorted(weights)[:3]})")
    kind = known[0]
    # SAC with gSDE clips the outputs before tanh; its last layer then has a number in its name.
    clip = float(kwargs.get("clip_mean", 2.0)) if kind.mark == _SAC and "actor.mu.0.weight" in weights else None
    squash = kind.squash or kwargs.get("squash_output", False) is True
    prefix, twins = kind.features, kind.twins

    layers: list[tuple[torch.Tensor, torch.Tensor]] = []
    for part in kind.layers:
        number = 0
        while (name := next((n for n in (f"{part}.{number}", part) if f"{n}.weight" in weights), None)) is not None:
            layers.append((weights.pop(f"{name}.weight").float(), weights.pop(f"{name}.bias").float()))
            number += 2  # an activation comes in between
    features = {name[len(prefix) + 1 :]: weights.pop(name) for name in list(weights) if name.startswith(f"{prefix}.")}
    if not features and twins:  # a file of Stable-Baselines3 before 1.7
        features = {n[len(twins[0]) :]: weights.pop(n) for n in list(weights) if n.startswith(twins[0])}
    unknown = [name for name in weights if not name.startswith((*kind.others, *twins))]
    if unknown:
        raise NeedsTrust(f"its network has parts that are not known here: {unknown[:3]}")

    activation = kind.activation if "activation_fn" not in kwargs else ACTIVATIONS.get(str(kwargs["activation_fn"]))
    if activation is None:
        raise NeedsTrust(f"its activation function is not known here: {kwargs['activation_fn']!r}")
    if not shape or min(shape) < 1 or max(shape) > 4096 or len(shape) > 3:
        raise ValueError(f"observations of shape {shape}")
    module, width = _features(features, shape, kwargs)
    for weight, bias in layers:
        if weight.ndim != 2 or weight.shape[1] != width or bias.shape != weight.shape[:1]:
            raise ValueError(
                f"a layer after {width} units has weights {tuple(weight.shape)}, biases {tuple(bias.shape)}"
            )
        width = weight.shape[0]
    if width not in (2, 9):
        raise ValueError(f"it must have 2 or 9 outputs, got {width}")
    return Actor(module, tuple(layers), activation, clip, squash, shape)


def _shape(space: Any) -> tuple[int, ...] | None:
    """The shape of one observation, as the text of a model file's space tells it; None if it does not."""
    if not isinstance(space, dict):
        return None
    if isinstance(space.get("_shape"), list):
        return tuple(int(side) for side in space["_shape"])
    seen = _SEEN.search(str(space.get("spaces")))
    return tuple(int(side) for side in seen[1].split(",") if side.strip()) if seen else None


def _features(
    weights: dict[str, torch.Tensor], shape: tuple[int, ...], kwargs: dict[str, Any]
) -> tuple[nn.Module, int]:
    """The feature extractor before the layers, and its number of outputs."""
    named = kwargs.get("features_extractor_class")
    pictures = len(shape) == 3
    if named == _STUDENT:
        weights = {name.removeprefix("seen."): part for name, part in weights.items() if name.startswith("seen.")}
        named = str(StateFromPictures if pictures else RelativeFeatures)
    module: nn.Module
    if not weights and named in (None, str(FlattenExtractor)):
        module, width = nn.Flatten(), math.prod(shape)
    elif "matrix" in weights and named == str(RelativeFeatures) and stack_of_shape(shape):
        module = RelativeFeatures(spaces.Box(-1.0, 1.0, shape))
        width = module.features_dim
    elif "table" in weights and named == str(ForesightFeatures) and stack_of_shape(shape) == 1:
        module = ForesightFeatures(spaces.Box(-1.0, 1.0, shape))
        width = module.features_dim
    elif pictures and ("patches.weight" in weights and named == str(SmallCnn)):
        width = len(weights["layers.4.bias"])
        module = SmallCnn(spaces.Box(0, 255, shape, np.uint8), width)
    elif pictures and "centres.empty" in weights and named == str(StateFromPictures):
        widths = (len(weights[name]) for name in ("centres.weigh.0.bias", "state.0.bias"))
        module = StateFromPictures(spaces.Box(0, 255, shape, np.uint8), FULL_SIZE, *widths)
        width = module.features_dim
    elif pictures and "cnn.0.weight" in weights and named in (None, str(NatureCNN)):
        width = len(weights["linear.0.bias"])
        module = NatureCNN(spaces.Box(0, 255, shape, np.uint8), width)
    else:
        raise NeedsTrust(f"what its network makes of observations is not known here: {named or sorted(weights)[:3]}")
    module.load_state_dict(weights)
    if isinstance(module, ForesightFeatures):
        _ = module.foresight  # raises for the fields of no table
    if pictures and kwargs.get("normalize_images", True) is not False:
        module = _Divided(module)
    return module, width


def trusted_policy(path: Path) -> Any:
    """Load the Stable-Baselines3 policy in a file with its pickles. This can run any code that is in the file.

    Raises:
        ValueError: the file does not contain a policy.
    """
    from stable_baselines3.common.save_util import load_from_zip_file

    try:
        data, params, _ = load_from_zip_file(path, device="cpu")
        assert data is not None
        policy = data["policy_class"](
            data["observation_space"], data["action_space"], lambda _: 0.0, **data["policy_kwargs"],
            **({} if "use_sde" in data["policy_kwargs"] else {"use_sde": True} if data.get("use_sde") else {}),
        )  # fmt: skip
        policy.load_state_dict(params["policy"])
        policy.set_training_mode(False)
    except Exception as error:  # the code in the file may raise anything
        raise ValueError(f"{path} does not hold a model of Stable-Baselines3: {error}") from error
    return policy
