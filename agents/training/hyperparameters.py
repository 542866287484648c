"""Hyperparameters from files in RL-Zoo's format, whose Python strings are read without running them."""

from __future__ import annotations

import ast
import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.noise import NormalActionNoise, OrnsteinUhlenbeckActionNoise

from agents import features
from agents.files import read_yaml
from agents.training.learning import Falling
from airhockey_env.files import replace

NOISES = {"normal": NormalActionNoise, "ornstein-uhlenbeck": OrnsteinUhlenbeckActionNoise}
"""Noise on actions, by RL-Zoo's names."""

ACTIVATIONS = ("ReLU", "Tanh", "ELU", "GELU", "LeakyReLU", "SiLU")

_OBJECTS: dict[str, Any] = {
    **{f"{torch_nn}.{name}": getattr(torch.nn, name) for torch_nn in ("nn", "th.nn") for name in ACTIVATIONS},
    **{
        f"importlib.import_module('agents.features').{name}": getattr(features, name)
        for name in ("ForesightFeatures", "RelativeFeatures", "SmallCnn")
    },
}
"""The objects that `policy_kwargs` may name, by how they are written."""


@dataclass(frozen=True)
class Hyperparameters:
    """A section of a file in RL-Zoo's format."""

    n_timesteps: int
    n_envs: int
    frame_stack: int | None
    env_kwargs: dict[str, Any]
    model: dict[str, Any]
    """Arguments of the algorithm's class."""


def read_section(path: Path, env_id: str) -> dict[str, Any]:
    """Return the section of an environment in a file in RL-Zoo's format, unchanged.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: the file has no section for the environment.
    """
    if not path.is_file():
        raise FileNotFoundError(f"--hyperparams must name a file that exists, got {path}")
    sections = read_yaml(path)
    env_id = env_id.rpartition(":")[2]  # of "airhockey_env:AirHockeyHit-v0"
    if not isinstance(sections, dict) or not isinstance(sections.get(env_id), dict):
        has = sorted(map(str, sections)) if isinstance(sections, dict) else "none"
        raise ValueError(f"--env must have a section in {path}, got {env_id!r}; it has {has}")
    return sections[env_id]


def write_section(path: Path, env_id: str, section: dict[str, Any]) -> None:
    """Write a file in RL-Zoo's format with the section of one environment, as `read_section` reads it.

    Raises:
        OSError: it cannot be written.
    """
    import yaml

    text = yaml.safe_dump({env_id.rpartition(":")[2]: section}, sort_keys=False)
    replace(path, lambda part: part.write_text(text, encoding="utf-8"))


def parse_section(section: Any, where: str, trust: bool = False) -> Hyperparameters:
    """Read a section in RL-Zoo's format.

    Args:
        section: plain values, from a YAML or a JSON file.
        where: the name of the section in errors.
        trust: as for `read_kwargs`.

    Raises:
        ValueError: the section is not in this format.
    """
    try:
        section = dict(section)
        n_timesteps, n_envs = int(section.pop("n_timesteps")), int(section.pop("n_envs", 1))
        frame_stack, env_kwargs = section.pop("frame_stack", None), dict(section.pop("env_kwargs", {}))
        if isinstance(section.get("policy_kwargs"), str):
            section["policy_kwargs"] = read_kwargs(section["policy_kwargs"], trust)
        for name in ("learning_rate", "clip_range"):
            if isinstance(section.get(name), str):
                kind, start = section[name].split("_")
                if kind != "lin":
                    raise ValueError(f"{name} must be a number or lin_ and a number, got {section[name]!r}")
                section[name] = Falling(float(start))
        noise, deviation = section.pop("noise_type", None), section.pop("noise_std", 0.0)
        if noise is not None and noise not in NOISES:
            raise ValueError(f"noise_type must be one of {tuple(NOISES)}, got {noise!r}")
        if noise is not None:
            section["action_noise"] = NOISES[noise](np.zeros(2), np.full(2, float(deviation)))
    except Exception as error:  # trusted Python can raise anything
        raise ValueError(f"{where}: it is not in RL-Zoo's format: {error!r}") from error
    return Hyperparameters(n_timesteps, n_envs, frame_stack, env_kwargs, section)


def read_kwargs(text: str, trust: bool = False) -> Any:
    """Read `policy_kwargs` such as `dict(net_arch=[64, 64], activation_fn=nn.ReLU)` without running it.

    Args:
        text: `dict(...)` of numbers, strings, True, False, None, lists, tuples, dicts and the names in `_OBJECTS`.
        trust: run any other text as Python, as RL-Zoo does.

    Raises:
        ValueError: the text contains anything else and is not trusted, or it is not Python.
    """
    try:
        return _value(ast.parse(text.strip(), mode="eval").body)
    except (ValueError, SyntaxError, RecursionError, MemoryError) as error:
        if not trust:
            raise ValueError(
                f"policy_kwargs must be dict(...) of plain values and of {', '.join(_OBJECTS)}; got {error}. Anything "
                "else is code: run it with --trust if you trust whoever wrote the file"
            ) from error
    return eval(text, {"nn": torch.nn, "th": torch, "importlib": importlib})


def _value(node: ast.expr) -> Any:
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "dict" and not node.args:
        if all(word.arg is not None for word in node.keywords):
            return {word.arg: _value(word.value) for word in node.keywords}
    elif isinstance(node, ast.List):
        return [_value(part) for part in node.elts]
    elif isinstance(node, ast.Tuple):
        return tuple(_value(part) for part in node.elts)
    elif isinstance(node, ast.Dict) and all(key is not None for key in node.keys):
        return {ast.literal_eval(key): _value(part) for key, part in zip(node.keys, node.values, strict=True) if key}
    elif isinstance(node, (ast.Constant, ast.UnaryOp)):
        return ast.literal_eval(node)
    elif ast.unparse(node) in _OBJECTS:
        return _OBJECTS[ast.unparse(node)]
    raise ValueError(ast.unparse(node))
