"""Hyperparameters from files in RL-Zoo's format."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from stable_baselines3.common.noise import NormalActionNoise, OrnsteinUhlenbeckActionNoise

from agents.training.learning import Falling
from agents.training.literals import read_kwargs

NOISES = {"normal": NormalActionNoise, "ornstein-uhlenbeck": OrnsteinUhlenbeckActionNoise}
"""By RL-Zoo's names."""


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
    """The section of an environment in a file in RL-Zoo's format, as it stands there.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it has no section for the environment.
    """
    if not path.is_file():
        raise FileNotFoundError(f"--hyperparams must name a file that exists, got {path}")
    try:
        if path.stat().st_size > 2**20:
            raise ValueError("it has more than a megabyte")
        sections = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError, ValueError, TypeError, RecursionError) as error:
        raise ValueError(f"{path} is not a YAML file: {error}") from error
    env_id = env_id.rpartition(":")[2]  # of "airhockey_env:AirHockeyHit-v0"
    if not isinstance(sections, dict) or not isinstance(sections.get(env_id), dict):
        has = sorted(map(str, sections)) if isinstance(sections, dict) else "none"
        raise ValueError(f"--env must have a section in {path}, got {env_id!r}; it has {has}")
    return sections[env_id]


def parse_section(section: Any, where: str, trust: bool = False) -> Hyperparameters:
    """What a section in RL-Zoo's format says.

    Args:
        section: plain values, as a YAML or a JSON file has them.
        where: names the section in errors.
        trust: run `policy_kwargs` as Python, as RL-Zoo does, where it is more than plain values (see `read_kwargs`).

    Raises:
        ValueError: it is not in this format.
    """
    try:
        section = dict(section)
        _check_size(section)
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
    except Exception as error:  # whatever the Python in it does
        raise ValueError(f"{where}: it is not in RL-Zoo's format: {error!r}") from error
    return Hyperparameters(n_timesteps, n_envs, frame_stack, env_kwargs, section)


def _check_size(section: dict[str, Any]) -> None:
    """Raises ValueError for a section whose aliases, YAML's `*name`, multiply it beyond all use, or hold itself."""
    parts: list[Any] = [section]
    for _ in range(10_000):
        if not parts:
            return
        part = parts.pop()
        parts += part.values() if isinstance(part, dict) else part if isinstance(part, list) else ()
    raise ValueError("a section must have fewer than 10,000 values")
