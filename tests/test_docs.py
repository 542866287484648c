"""Documentation: its examples run, its links lead somewhere, and it says what the docstrings and the registry say."""

from __future__ import annotations

import contextlib
import functools
import inspect
import io
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import gymnasium
import pytest

from agents.onnx_files import to_onnx
from airhockey_env import AirHockeyEnv, Game
from airhockey_env.kernel.tasks import TASKS
from airhockey_env.opponents.players import NAMES
from airhockey_env.parallel_env import AirHockeyParallelEnv
from scripts.make_docs import pages
from tests.helpers import IDS, ROOT, still_policy
from tests.pages import DATASETS, WORKS_WITH, Block, blocks

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
EXTENDING = ROOT / "docs" / "extending.md"


def examples(page: Path, changed: bool = False) -> list[Block]:
    """The Python blocks of a page for the package as it is, or those for the one that the page's diffs change.

    The latter stand under a heading with a diff.
    """
    every = blocks(page)
    with_diff = {block.section for block in every if block.language == "diff"}
    return [block for block in every if block.language == "python" and (block.section in with_diff) == changed]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder to work in, with a run in it; and what an example registers is forgotten afterwards."""
    run = tmp_path / "runs" / "baseline"
    run.mkdir(parents=True)
    still_policy().save(run / "policy.npz")
    monkeypatch.chdir(tmp_path)
    registered = dict(gymnasium.registry)
    yield tmp_path
    gymnasium.registry.clear()
    gymnasium.registry.update(registered)


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page not in (DATASETS, WORKS_WITH)], ids=lambda page: page.name
)
def test_python_blocks_run(page: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names: dict[str, object] = {"__name__": "example"}
    if page.name == "robot.md":
        (folder / "robot.onnx").write_bytes(to_onnx(still_policy()))
    for block in examples(page):
        exec(compile("\n" * block.line + block.code, str(page), "exec"), names)
    printed = capsys.readouterr().out
    if page.name == "kiss_study.md":
        lines = [line for line in printed.splitlines() if "the target leaves at" in line]
        exact = [line for line in lines if line.startswith(("kiss ", "continuous "))]
        assert len(lines) == 12 and len(exact) == 8
        assert all(line.endswith("-22.0243 degrees") for line in exact)
        assert not any("-22.0243" in line for line in lines if line not in exact)


def apply(diff: str, root: Path) -> None:
    """Change a file as a diff block says. Its context has to be there once: line numbers are not needed."""
    name, *hunks = diff.removeprefix("--- ").split("@@\n")
    path = root / name.strip()
    text = path.read_text(encoding="utf-8")
    for hunk in hunks:
        lines = hunk.splitlines(keepends=True)
        before = "".join(line[1:] for line in lines if line[0] in " -")
        after = "".join(line[1:] for line in lines if line[0] in " +")
        assert text.count(before) == 1, f"in {name.strip()} these lines stand {text.count(before)} times:\n{before}"
        text = text.replace(before, after)
    path.write_text(text, encoding="utf-8")


CHECK = """
expected = 0.01 * 0.1 * 0.3 / (0.5 * env.unwrapped.table.width)  # (0.99 - 1) times what the potential is lower
assert abs(earned[1] - earned[0] - expected) < 1e-12, earned

env = gym.make("AirHockey-v0", opponent="chaser").unwrapped
env.reset(seed=0, options={"serve": "right"})
before = abs(env.positions[1] - env.positions[2]).sum()
for _ in range(8):
    env.step(np.zeros(2, np.float32))
assert abs(env.positions[1] - env.positions[2]).sum() < before

clear = gym.make_vec("AirHockeyClear-v0", num_envs=400, autoreset_mode="SameStep")
clear.reset(seed=0)
ended, won = 0, 0
for _ in range(100):
    _, _, terminated, truncated, infos = clear.step(clear.action_space.sample())
    if "final_info" in infos:
        ended += (terminated | truncated).sum()
        won += infos["final_info"]["is_success"].sum()
assert ended >= 400 and 0 < won < ended, (ended, won)
"""


def test_changes_inside_the_package_work(folder: Path) -> None:
    shutil.copytree(ROOT / "airhockey_env", folder / "airhockey_env", ignore=shutil.ignore_patterns("__pycache__"))
    for block in blocks(EXTENDING):
        if block.language == "diff":
            apply(block.code, folder)
    code = "".join(block.code for block in examples(EXTENDING, changed=True)) + CHECK
    inherited = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=folder,
        env=inherited | {"PYTHONPATH": str(folder), "NUMBA_OPT": "1"},  # it is compiled but once
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def anchors(page: Path) -> set[str]:
    """The names under which GitHub links to the headings of a page."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if link.startswith(("http://", "https://")):
            continue
        path, _, anchor = link.partition("#")
        target = page.parent / path if path else page
        assert target.exists(), f"{link} leads nowhere"
        assert not anchor or anchor in anchors(target), f"{link}: no such heading"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_exist(page: Path) -> None:
    for name in re.findall(r"python -m scripts\.(\w+)", page.read_text(encoding="utf-8")):
        assert (ROOT / "scripts" / f"{name}.py").exists(), f"there is no scripts.{name}"


def commands(page: Path) -> Iterator[tuple[str, set[str]]]:
    """The commands of `scripts` that a page calls, in blocks of code and in running text, with their options."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    fenced = re.compile(r"^ *```\w*\n(.*?)^ *```", flags=re.MULTILINE | re.DOTALL)
    lines = [line for block in fenced.findall(text) for line in block.splitlines()]
    lines += [" ".join(code.split()) for code in re.findall(r"`([^`]+)`", fenced.sub("", text))]
    for line in lines:
        for part in re.split(r"&&|;|-- (?=train)|\s#", line):  # after -- stands a command that tune repeats
            called = re.search(r"(?:-m scripts\.|^(?=train))(\w+)(.*)", part)
            if called and (ROOT / "scripts" / f"{called[1]}.py").exists():
                yield called[1], set(re.findall(r"(?<!\S)(--[a-z][\w-]*)", called[2]))


@functools.cache
def options_of(command: str) -> frozenset[str]:
    """The options in the help of a command."""
    printed = io.StringIO()
    main = import_module(f"scripts.{command}").main
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.setattr(sys, "argv", [command, "--help"])
        patch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit):
            main()
    return frozenset(re.findall(r"--[a-z][\w-]*", printed.getvalue()))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_options_exist(page: Path) -> None:
    for command, options in commands(page):
        assert options <= options_of(command), f"scripts.{command} has no {sorted(options - options_of(command))}"


def test_commands_are_found_with_their_options(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "Call `python -m scripts.evaluate x\n--table y`.\n\n```bash\nfor a in 1; do python -m scripts.ladder \\\n"
        "    --points 2; done\npython -m scripts.tune --trials 5 -- train_ppo --steps 3M  # --no\n```\n",
        encoding="utf-8",
    )
    assert list(commands(page)) == [
        ("ladder", {"--points"}),
        ("tune", {"--trials"}),
        ("train_ppo", {"--steps"}),
        ("evaluate", {"--table"}),
    ]


def test_the_pages_of_the_environments_are_those_of_their_docstrings() -> None:
    for name, text in pages().items():
        assert (ROOT / "docs" / name).read_text(encoding="utf-8") == text, "python -m scripts.make_docs"


def test_every_environment_has_a_page_with_a_moving_picture() -> None:
    titles = {re.findall("^# (.*)$", text, flags=re.MULTILINE)[0]: text for text in pages().values()}
    for name in IDS:
        (picture,) = re.findall(r"\((env_\w+\.gif)\)", titles[name])
        assert (ROOT / "docs" / picture).exists()


@pytest.mark.parametrize("environment", [AirHockeyEnv, AirHockeyParallelEnv])
def test_docstrings_have_every_argument_with_its_default(environment: type) -> None:
    table = (environment.__doc__ or "").split("## Arguments")[1]
    rows = re.findall(r"^ *\| `(\w+)` \| .* \| (.*) \|$", table, flags=re.MULTILINE)
    shown = [(name, default.strip("`").replace('"', "'")) for name, default in rows]
    assert shown == [(name, repr(given.default)) for name, given in inspect.signature(environment).parameters.items()]


@pytest.mark.parametrize("documented", [AirHockeyEnv, Game])
def test_docstrings_name_every_opponent(documented: type) -> None:
    assert not [name for name in NAMES if f'`"{name}"`' not in (documented.__doc__ or "")]


def test_table_of_ids_is_that_of_the_registry() -> None:
    pattern = r"\| `(AirHockey\w*-v\d+)` \| `\"(\w+)\"` \| .*? \| `\"(\w+)\"` \| (\d+) steps \|"
    rows = re.findall(pattern, AirHockeyEnv.__doc__ or "")
    assert sorted(row[0] for row in rows) == IDS
    default = inspect.signature(AirHockeyEnv).parameters["opponent"].default
    for name, task, opponent, steps in rows:
        spec = gymnasium.spec(name)
        assert spec.kwargs.get("task", "point") == task
        assert spec.kwargs.get("opponent", default) == opponent == TASKS[task].opponent
        assert spec.max_episode_steps == int(steps) == TASKS[task].max_episode_steps
