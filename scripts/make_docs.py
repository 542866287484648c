"""Write docs/environments.md from the docstrings: python -m scripts.make_docs"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium

from agents.options import make_folder
from airhockey_env import AirHockeyEnv
from benchmarks import page
from scripts._command import run_command

DOCS = Path(__file__).parents[1] / "docs"
ENVIRONMENTS = "environments.md"

HEAD = """\
<!-- `python -m scripts.make_docs` writes this page from the docstrings of the environments: edit those. -->

# Environments

Units are m, s, kg and m/s. The table is centred on the origin, with x along its length.

```python
import gymnasium as gym
import airhockey_env  # registers

env = gym.make("AirHockeyMatch-v0", opponent="goalie")
envs = gym.make_vec("AirHockeyDefend-v0", num_envs=1024)
observations, infos = envs.reset(seed=0)
observations, rewards, terminations, truncations, infos = envs.step(envs.action_space.sample())
```

[The batch](batch.md) describes what `make_vec` offers beyond this specification.
"""


@dataclass(frozen=True)
class MakeDocsArgs:
    """Write docs/environments.md from the docstrings of the environments and from the registered ids."""

    out: Path = DOCS
    """Write the page into this folder, which is made if needed."""


def make_docs(args: MakeDocsArgs) -> None:
    """Write the page.

    Raises:
        OSError: it cannot be written there.
        DependencyNotInstalled: PettingZoo is missing.
    """
    make_folder("out", args.out)
    page.write(args.out / ENVIRONMENTS, environments_page())
    print(args.out / ENVIRONMENTS)


def environments_page() -> str:
    """The page: a section for each class, which is its docstring below a table of ids and spaces.

    Raises:
        DependencyNotInstalled: PettingZoo is missing.
    """
    from airhockey_env.parallel_env import AirHockeyParallelEnv, parallel_env

    entry = f"{AirHockeyEnv.__module__}:{AirHockeyEnv.__name__}"
    ids = [spec.id for spec in gymnasium.registry.values() if spec.entry_point == entry]
    single, two = AirHockeyEnv(), AirHockeyParallelEnv()
    agent = two.possible_agents[0]
    return "\n".join(
        (
            HEAD,
            section(
                AirHockeyEnv,
                ("made by", code(f'gymnasium.make("{name}")' for name in ids)),
                *spaces(single.action_space, single.observation_space),
            ),
            section(
                AirHockeyParallelEnv,
                ("made by", code([f"{parallel_env.__module__}.{parallel_env.__name__}()"])),
                ("agents", code(two.possible_agents)),
                *spaces(two.action_space(agent), two.observation_space(agent)),
            ),
        )
    )


def section(kind: type, *rows: tuple[str, str]) -> str:
    """The section about a class: a table of facts, then its docstring, whose headings go one level down."""
    text = re.sub(r"^## ", "### ", inspect.getdoc(kind) or "", flags=re.MULTILINE)
    return f"## {kind.__name__}\n\n{page.markdown([('', ''), *rows])}\n{text}\n"


def spaces(action: Any, observation: Any) -> list[tuple[str, str]]:
    """Rows for the spaces of an environment with the default arguments."""
    return [("action space", code([action])), ("observation space", code([observation]))]


def code(values: Iterable[object]) -> str:
    """Values as code."""
    return ", ".join(f"`{value}`" for value in values)


def main() -> None:
    """Read the command line and write."""
    run_command("make_docs", MakeDocsArgs, make_docs)


if __name__ == "__main__":
    main()
