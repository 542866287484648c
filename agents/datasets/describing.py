"""What a data set says of itself: its id and its metadata, with Minari's names."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from agents.datasets.scores import Scores
from agents.datasets.settings import Setting
from agents.models import short_name
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.version import __version__

REPOSITORY = "https://github.com/airhockey-env/airhockey-env"

UNIFORM, HUMAN = "uniform", "human"
"""Players besides those of `agents.models`: uniformly random actions, and a person whose replays are given."""

QUALITIES = {UNIFORM: "random", "adept": "medium"}
"""What data sets of these players are called, by D4RL's convention; those of others are called after their players."""

ALGORITHMS = {
    UNIFORM: "uniformly random actions",
    HUMAN: "a person with a mouse or a finger",
    "adept": "PPO, cut short",
    "expert": "PPO against a mixture of players",
    "robust": "DAgger, then PPO",
}
"""Algorithms behind the players that have names; docs/trained.md has their model cards."""


def default_id(player: str, setting: Setting, others: Iterable[str] = ()) -> str:
    """The id of a data set by Minari's convention, (namespace/)(environment/)name-version.

    Args:
        player: who plays, as on a command line.
        setting: the environment.
        others: further parts of the name, for options that differ from their defaults.
    """
    parts = [QUALITIES.get(player, short_name(player).removesuffix(".npz"))]
    if setting.opponent != TASKS[setting.task].opponent:
        parts.append(short_name(setting.opponent).removesuffix(".npz"))
    name = "-".join(re.sub(r"\W+", "_", part, flags=re.ASCII) for part in (*parts, *others))
    return f"airhockey/{setting.task}/{name}-v0"


def metadata_of(player: str, setting: Setting, scores: Scores, author: tuple[str, str], command: str) -> dict[str, Any]:
    """Minari's fields that are not facts about the files.

    Args:
        player: who plays.
        setting: the environment.
        scores: the reference scores.
        author: a name, and an address or another place where the author can be reached.
        command: what made the data set.
    """
    spec = setting.spec
    arguments = ", ".join(f"{name}={value!r}" for name, value in spec.kwargs.items())
    return {
        "algorithm_name": ALGORITHMS.get(player, f"the policy {short_name(player)}"),
        "description": f"{player} in {spec.id}({arguments}). Made by `{command}` of airhockey-env {__version__}.",
        "author": {author[0]},
        "author_email": {author[1]},
        "code_permalink": f"{REPOSITORY}/tree/{_revision()}",
        "requirements": [f"airhockey-env=={__version__}"],
        "ref_min_score": scores.random,
        "ref_max_score": scores.expert,
        "num_episodes_average_score": scores.episodes,
    }


def _revision() -> str:
    """The commit of the checkout; outside of a repository the version's tag."""
    try:
        done = subprocess.run(
            ["git", "rev-parse", "HEAD"], cwd=Path(__file__).parent, capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return f"v{__version__}"
    return done.stdout.strip()
