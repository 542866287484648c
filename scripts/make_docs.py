"""Write the pages about the environments from their docstrings: python -m scripts.make_docs"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium

from agents.options import make_folder
from agents.pictures import observation_kinds
from airhockey_env import AirHockeyEnv
from benchmarks import page
from scripts._command import run_command
from scripts.record_video import RecordArgs, record

DOCS = Path(__file__).parents[1] / "docs"
ENVIRONMENTS = "environments.md"
OBSERVATIONS = "observations.png"
SPECIFICATION = inspect.getdoc(AirHockeyEnv) or ""


class Film(NamedTuple):
    """Who is filmed on the page of a task."""

    player: str
    opponent: str | None
    seed: int
    caption: str


FILMS = {
    "point": Film("expert", "striker", 3, "The trained expert (left) plays the scripted striker"),
    "match": Film("expert", "adept", 2, "The trained expert (left) plays the trained adept"),
    "hit": Film("expert", None, 0, "The trained expert puts a resting puck into an unguarded goal"),
    "defend": Film("expert", None, 0, "The trained expert keeps shots out"),
}

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

[The batch](batch.md) describes what `make_vec` offers beyond this specification. The environments also have a page
each: {pages}.

![One moment of play: drawn, as 13 numbers, as an RGB picture and as a grayscale picture]({picture})

*One moment as a player can be given to see it: `python -m scripts.make_docs --pictures`.*

```{{toctree}}
:hidden:

{toctree}
```
"""

PAGE = """\
<!-- `python -m scripts.make_docs` writes this page from the docstring of `AirHockeyEnv`: edit that. -->

# {name}

{episode}.

![{caption}](env_{task}.gif)

*{caption}: `python -m scripts.make_docs --pictures`.*

```python
import gymnasium as gym
import airhockey_env  # registers

env = gym.make("{name}", render_mode="rgb_array")
envs = gym.make_vec("{name}", num_envs=1024)
```

{facts}
## Starting state

{start}

## Episode end

{end}

## Rewards

{rewards}

The [specification](environments.md) describes actions, observations, rules, infos and all arguments.
"""


@dataclass(frozen=True)
class MakeDocsArgs:
    """Write docs/environments.md and docs/env_*.md from the docstrings of the environments and the registered ids."""

    out: Path = DOCS
    """Write the pages into this folder, which is made if needed."""
    pictures: bool = False
    """Make the pictures on these pages again as well, which takes a minute."""


def make_docs(args: MakeDocsArgs) -> None:
    """Write the pages.

    Raises:
        OSError: they cannot be written there.
        DependencyNotInstalled: PettingZoo is missing.
    """
    make_folder("out", args.out)
    for name, text in pages().items():
        page.write(args.out / name, text)
        print(args.out / name)
    if args.pictures:
        names = re.findall(r"^\| \d+ \| (.*?)(?::.*)? \|", SPECIFICATION, flags=re.MULTILINE)
        observation_kinds(args.out / OBSERVATIONS, names)
        for task, film in FILMS.items():
            out = args.out / f"env_{task}.gif"
            record(
                RecordArgs(film.player, film.opponent, task, out, seconds=6.0, width=420, height=228, seed=film.seed)
            )


def pages() -> dict[str, str]:
    """All pages, keyed by the names of their files.

    Raises:
        DependencyNotInstalled: PettingZoo is missing.
    """
    return {ENVIRONMENTS: environments_page()} | {f"env_{task}.md": environment_page(task) for task in FILMS}


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
            HEAD.format(
                pages=", ".join(f"[{registered(task)[0]}](env_{task}.md)" for task in FILMS),
                picture=OBSERVATIONS,
                toctree="\n".join(f"env_{task}" for task in FILMS),
            ),
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


def environment_page(task: str) -> str:
    """The page of the environment with a task: what the docstring of `AirHockeyEnv` says about it."""
    name, episode, opponent, limit = registered(task)
    env = AirHockeyEnv(task=task)
    facts: page.Rows = [
        ("", ""),
        ("task", f'`"{task}"`'),
        ("opponent, unless you name another one", opponent),
        ("truncated after", f"{limit} ({int(limit.split()[0]) / 50:g} s at 50 Hz)"),
        *spaces(env.action_space, env.observation_space),
    ]
    return PAGE.format(
        name=name,
        task=task,
        episode=capitalized(episode),
        caption=FILMS[task].caption,
        facts=page.markdown(facts),
        start=about("Starting state", task),
        end=about("Episode end", task),
        rewards=about("Rewards", task),
    )


def registered(task: str) -> tuple[str, str, str, str]:
    """Return the row of a task in the docstring's table of ids: id, what an episode is, opponent, steps."""
    row = re.search(rf'^\| `(.*?)` \| `"{task}"` \| (.*?) \| (.*?) \| (.*?) \|$', SPECIFICATION, flags=re.MULTILINE)
    if row is None:
        raise ValueError(f"the docstring of AirHockeyEnv has no row for the task {task!r}")
    name, episode, opponent, limit = row.groups()
    return name, episode, opponent, limit


def about(heading: str, task: str) -> str:
    """Return the paragraphs of a section of the docstring that are about a task.

    Those about some tasks only begin with their names: "Point, match: ...".
    """
    (text,) = re.findall(rf"^## {heading}\n(.*?)(?=^## |\Z)", SPECIFICATION, flags=re.MULTILINE | re.DOTALL)
    names = "|".join(FILMS)
    found = []
    for paragraph in text.strip().split("\n\n"):
        label = re.match(rf"({names})(, ({names}))*: ", paragraph, flags=re.IGNORECASE)
        if label is None:
            found.append(paragraph)
        elif task in label[0].lower():
            found.append(capitalized(paragraph[label.end() :]))
    return "\n\n".join(found)


def capitalized(text: str) -> str:
    """Return a text with a capital letter at its start."""
    return text[0].upper() + text[1:]


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
