"""Players: policies from Stable-Baselines3's files, and everything that a command accepts as a player."""

from __future__ import annotations

import importlib
import os
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from agents.files import read_json
from airhockey_env.actions import DIRECTIONS
from airhockey_env.drawing.pixels import CHANNELS, SIZE, Pixels
from airhockey_env.game import OBS_TYPES, Game
from airhockey_env.kernel.state import OBSERVATION_SIZE
from airhockey_env.opponents.players import NAMES
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.trained import TRAINED, trained_policy

Policy = Callable[[NDArray[np.float32]], NDArray[np.float32]]
"""Maps state observations (N, 13), each from the player's own side, to actions (N, 2)."""

PLAYERS = (
    f"{', '.join(NAMES)}, a run's folder or its name under runs/, a policy.npz, a model.zip of Stable-Baselines3, "
    "or module:function"
)
"""What a command accepts as a player."""

_FUNCTION = re.compile(r"[^\W\d][\w.]*:[^\W\d]\w*")

_AT_ONCE = 256
"""Rows per call of a network: with stacked pictures, more would need gigabytes between the layers."""


class Sight(NamedTuple):
    """The kind of observations that a player sees."""

    obs_type: str  # "state", "rgb" or "grayscale"
    frames: int = 1  # number of observations that `VecFrameStack` stacks
    stack: int = 1  # the environments' own `stack`


class ModelPlayer:
    """A model that needs PyTorch, or that sees something other than a single state observation.

    It gets the observations that it was trained with: states or pictures, stacked as Stable-Baselines3's
    `VecFrameStack` does, with zeros before the first observation of an episode, or as the environments do.

    Args:
        answer: the network. Maps observations (N, ...) to actions (N, 2) or to numbers of directions (N,).
        sight: the observations that it sees.
    """

    def __init__(self, answer: Callable[[NDArray[Any]], NDArray[Any]], sight: Sight) -> None:
        self.answer, self.sight = answer, sight


class ModelPolicy:
    """A `ModelPlayer` in one game: a `Policy` that can only be used in this game, because it remembers observations.

    Attributes:
        seen: (N, ...) the last input of the network; None before the first.
        stack: how many state observations the game has to give it at once.
    """

    def __init__(self, player: ModelPlayer) -> None:
        self.player = player
        self.seen: NDArray[Any] | None = None
        sight = player.sight
        self._pixels = Pixels(sight.obs_type) if sight.obs_type in CHANNELS else None
        self.stack = sight.stack if self._pixels is None else 1
        self._kept = sight.frames if self._pixels is None else max(sight.frames, sight.stack)
        self._game: Game | None = None

    @property
    def pictures(self) -> bool:
        """Whether the player sees pictures."""
        return self._pixels is not None

    def join(self, game: Game) -> None:
        """Start playing in this game, on all of its tables."""
        self._game, self.seen = game, None

    def __call__(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (N, 2) for the state observations (N, 13), or (N, stack, 15), of all tables.

        Call it exactly once per step.
        """
        assert self._game is not None, "join a game first"
        new = self._observed(observations, self._game)
        if self._kept == 1:
            self.seen = new
        else:
            first = np.concatenate([new] * (self._kept - 1), axis=1)  # before an episode's first observation
            if self.player.sight.stack == 1:
                first[:] = 0
            began = np.ones(len(new), np.bool_) if self.seen is None else self._game.out.began
            before = first if self.seen is None else self.seen[:, new.shape[1] :].copy()
            before[began] = first[began]
            self.seen = np.concatenate([before, new], axis=1)
        parts = [self.player.answer(self.seen[k : k + _AT_ONCE]) for k in range(0, len(new), _AT_ONCE)]
        actions = np.concatenate(parts)
        return actions.astype(np.float32) if actions.ndim == 2 else DIRECTIONS[actions]

    def _observed(self, observations: NDArray[np.float32], game: Game) -> NDArray[Any]:
        """The player's observations: states (N, 13) or (N, stack, 15), or pictures (N, channels, 84, 84)."""
        if self._pixels is None:
            return observations.copy()
        frames = self._pixels.blank(len(observations))
        background = self._pixels.background(game.parameters)
        self._pixels.draw(0, len(observations), observations, game.parameters, background, frames)
        return np.ascontiguousarray(frames.transpose(0, 3, 1, 2))


Player = Policy | ModelPlayer | str
"""A player: a policy, a model, or the name of a named opponent."""


def in_one_game(player: Player) -> Policy | str:
    """Prepare a player for one game, as `Game` accepts it. Call `join` before the game starts."""
    return ModelPolicy(player) if isinstance(player, ModelPlayer) else player


def join(game: Game, *players: Any) -> None:
    """Let players that `in_one_game` returned play in this game."""
    for player in players:
        if isinstance(player, ModelPolicy):
            player.join(game)


def export_policy(model: Any) -> MlpPolicy:
    """Convert a Stable-Baselines3 PPO, A2C, SAC, TD3 or DDPG model with an `MlpPolicy` to a policy without torch.

    The result is the deterministic policy.

    Raises:
        ValueError: the policy clips its actions (as SAC with gSDE does) but its hidden layers are not ReLU.
    """
    from torch import nn

    from agents.features import stack_of_shape

    policy = model.policy
    actor = getattr(policy, "actor", None)
    if actor is None:  # actor and critic are one network
        layers, features = [*policy.mlp_extractor.policy_net, policy.action_net], policy.features_extractor
        features = getattr(features, "seen", features)  # a student's critic has features of its own
    else:  # TD3's layers are all in `mu`; SAC's `mu` is the last of them
        layers = [*getattr(actor, "latent_pi", ()), *(actor.mu if isinstance(actor.mu, nn.Sequential) else [actor.mu])]
        features = actor.features_extractor
    linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
    weights = [layer.weight.detach().cpu().numpy() for layer in linear]
    biases = [layer.bias.detach().cpu().numpy() for layer in linear]
    activation = "relu" if any(isinstance(layer, nn.ReLU) for layer in layers) else "tanh"
    clip = layers[-1].max_val if isinstance(layers[-1], nn.Hardtanh) else None
    stack = stack_of_shape(seen_space(model).shape)
    return _folded(weights, biases, activation, features, clip, squash=actor is not None, stack=stack)


def player_of(model: Any) -> MlpPolicy | ModelPlayer:
    """The deterministic player of a PPO model that is being trained, whether it sees states or grey pictures."""
    import torch

    space = seen_space(model)
    if space.dtype != np.uint8:
        return export_policy(model)
    policy = model.policy

    @torch.no_grad()
    def answer(seen: NDArray[Any]) -> NDArray[Any]:
        features = policy.features_extractor.seen(torch.as_tensor(seen, device=policy.device))
        outputs = policy.action_net(policy.mlp_extractor.forward_actor(features))
        return _action(outputs.cpu().numpy())

    return ModelPlayer(answer, Sight("grayscale", stack=space.shape[0]))


def _folded(
    weights: list[NDArray[np.float32]],
    biases: list[NDArray[np.float32]],
    activation: str,
    features: Any,
    clip: float | None,
    squash: bool,
    stack: int,
) -> MlpPolicy:
    """Fold the feature extractor's linear layer and the clipping of the outputs, if any, into an `MlpPolicy`."""
    from agents.features import RelativeFeatures

    foresight = None
    if isinstance(features, RelativeFeatures):
        weights[0] = weights[0] @ features.matrix.cpu().numpy()
        foresight = features.foresight
    if clip is not None:
        if activation != "relu":
            raise ValueError("policy must have rectified hidden layers to be exported with clipped actions, got tanh")
        # Two ReLUs clip: low + max(x - low, 0) - max(x - high, 0).
        low, high = np.float32(-clip), np.float32(clip)
        one = np.eye(len(biases[-1]), dtype=np.float32)
        weights[-1:] = [np.concatenate([weights[-1]] * 2), np.concatenate([one, -one], axis=1)]
        biases[-1:] = [np.concatenate([biases[-1] - low, biases[-1] - high]), np.full(len(one), low)]
    return MlpPolicy(weights, biases, activation, squash, stack, foresight)


def seen_space(model: Any) -> Any:
    """The space of what the agent sees. A student's observations (`agents.training.student`) hold more than that."""
    space = model.observation_space
    if not isinstance(space, spaces.Dict):
        return space
    from agents.training.student_tables import SEEN

    return space[SEEN]


def load_player(model: str, option: str = "MODEL", *, trust: bool = False) -> Player:
    """Load a player that is named on a command line.

    Args:
        model: one of `PLAYERS`.
        option: the name of the argument in error messages.
        trust: open the pickles in a model.zip that cannot be loaded without them.

    Raises:
        FileNotFoundError: there is no such file or name.
        ValueError: the file does not contain a player of this game, or needs `trust`.
    """
    if model in NAMES:
        return trained_policy(model) if model in TRAINED else model
    path = Path(model)
    if not path.exists() and (Path("runs") / model).is_dir():
        path = Path("runs") / model
    if path.is_dir():
        path = path / ("model.zip" if (path / "model.zip").is_file() else "policy.npz")
        path = path.with_name("policy.npz") if path.with_name("policy.npz").is_file() else path
    if not path.exists():
        if _FUNCTION.fullmatch(model):
            return _function(model, option)
        if len(path.parts) > 1 or path.suffix in (".npz", ".zip"):
            raise FileNotFoundError(f"{option} must be a player's file or folder, and there is no {model}")
        raise FileNotFoundError(f"{option} must be one of {PLAYERS}; {model!r} is none of these")
    return load_model(path, trust=trust) if path.suffix == ".zip" else MlpPolicy.load(path)


def load_players(models: Sequence[str], trust: bool = False) -> dict[str, Player]:
    """Load different players, keyed by the names that tables and plots show.

    Args:
        models: players as `load_player` accepts them. A file is named after the folder of its run, or after its path if
            that is not unique.
        trust: see `load_player`.

    Raises:
        FileNotFoundError, ValueError: see `load_player`.
    """
    given = list(dict.fromkeys(models))
    players = {model: load_player(model, trust=trust) for model in given}
    short = [short_name(model) for model in given]
    return {
        name if short.count(name) == 1 else model: player
        for name, (model, player) in zip(short, players.items(), strict=True)
    }


def load_model(path: Path, *, trust: bool = False) -> MlpPolicy | ModelPlayer:
    """Load the player in a Stable-Baselines3 model file; one that sees a single state observation plays without torch.

    For pictures, the config.json beside the file says of which kind they are.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file does not contain a player of this game, or needs `trust`.
    """
    from agents.sb3_files import NeedsTrust, actor_of, read_model, trusted_policy

    try:
        actor = actor_of(read_model(path))
    except NeedsTrust as error:
        if not trust:
            raise NeedsTrust(
                f"{error}. What is missing is in its pickles, which can run any code; open them with --trust if you "
                "trust the author of the file"
            ) from error
        return _trusted_player(path, trusted_policy(path))
    sight = _sight(path, actor.shape)
    if sight.obs_type == "state" and sight.frames == 1:
        activation = {"Tanh": "tanh", "ReLU": "relu"}.get(actor.activation.__name__)
        if activation == "relu" or (activation == "tanh" and actor.clip is None):
            weights, biases = ([part.numpy() for part in parts] for parts in zip(*actor.layers, strict=True))
            return _folded(weights, biases, activation, actor.features, actor.clip, actor.squash, sight.stack)
    return ModelPlayer(lambda seen: _action(actor(seen)), sight)


def _action(outputs: NDArray[np.float32]) -> NDArray[Any]:
    """Convert the outputs of a deterministic network, (N, 2) or (N, 9), to actions (N, 2) or directions (N,)."""
    return outputs.clip(-1.0, 1.0) if outputs.shape[1] == 2 else outputs.argmax(axis=1)


def _trusted_player(path: Path, policy: Any) -> ModelPlayer:
    """Wrap a policy that was loaded with its pickles."""
    if hasattr(policy, "lstm_actor"):
        raise ValueError(f"{path} holds a recurrent policy, which cannot be played here")
    sight = _sight(path, tuple(getattr(policy.observation_space, "shape", None) or ()))
    return ModelPlayer(lambda seen: policy.predict(seen, deterministic=True)[0], sight)


def _sight(path: Path, shape: tuple[int, ...]) -> Sight:
    """The kind of observations of this shape."""
    from agents.features import stack_of_shape

    if stack := stack_of_shape(shape):
        return Sight("state", stack=stack)
    if len(shape) == 1 and shape[0] % OBSERVATION_SIZE == 0:
        return Sight("state", frames=shape[0] // OBSERVATION_SIZE)
    if len(shape) != 3 or shape[1:] != (SIZE, SIZE):
        raise ValueError(
            f"{path} plays another game: it sees observations of shape {shape}, in place of ({OBSERVATION_SIZE},) or "
            f"(channels, {SIZE}, {SIZE}), or several of these stacked"
        )
    kind, stack = _settings_of_run(path.parent / "config.json")
    if kind is None and shape[0] % CHANNELS["rgb"]:
        kind = "grayscale"
    if kind is None:
        raise ValueError(
            f"{path} sees pictures of {shape[0]} channels, which may be rgb or grayscale: write which into a "
            'config.json beside it, as {"obs_type": "rgb"}'
        )
    if shape[0] % CHANNELS[kind]:
        raise ValueError(f"{path} sees {shape[0]} channels, which are no whole number of {kind} pictures")
    number = shape[0] // CHANNELS[kind]
    return Sight(kind, stack=number) if stack == number else Sight(kind, frames=number)


def _settings_of_run(config: Path) -> tuple[str | None, Any]:
    """The kind of pictures in the config of a run and its `stack`, each None if it does not say."""
    if not config.is_file():
        return None, None
    settings = read_json(config)
    stack = settings.get("stack") if isinstance(settings, dict) else None
    section = settings.get("section") if isinstance(settings, dict) else None
    inner = section.get("env_kwargs") if isinstance(section, dict) else None
    for place in (settings, inner):
        kind = place.get("obs_type") if isinstance(place, dict) else None
        if kind not in (None, *OBS_TYPES):
            raise ValueError(f"{config}: obs_type must be one of {OBS_TYPES}, got {kind!r}")
        if kind in CHANNELS:
            return kind, stack
    return None, stack


def _function(model: str, option: str) -> Policy:
    """Import a function given as module:function. The module is the user's own code, from the current folder."""
    module, _, name = model.partition(":")
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    importlib.invalidate_caches()
    try:
        function = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError) as error:
        raise ValueError(f"{option} must name a function that can be imported, got {model!r}: {error}") from error
    if not callable(function):
        raise ValueError(f"{option} must name a function, got {model!r}, which is a {type(function).__name__}")
    return function


def short_name(model: str) -> str:
    """Short name of a player for tables and plots: the opponent's name, the run's folder, or the file's name."""
    path = Path(model)
    return path.parent.name if path.name in ("policy.npz", "model.zip") and path.parent.name else path.name or model
