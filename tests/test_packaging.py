"""What pip installs: the one package, with base dependencies alone."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import airhockey_env

ROOT = Path(__file__).parents[1]


def run_python(code: str, folder: Path) -> str:
    """Run code in a process of its own, outside the checkout."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_holds_the_package_and_nothing_else() -> None:
    setuptools = pytest.importorskip("setuptools")
    tomllib = pytest.importorskip("tomllib")  # from Python 3.11
    with open(ROOT / "pyproject.toml", "rb") as file:
        project = tomllib.load(file)
    include = project["tool"]["setuptools"]["packages"]["find"]["include"]
    found = setuptools.find_namespace_packages(str(ROOT), include=include)
    folders = {
        path.parent.relative_to(ROOT).as_posix().replace("/", ".") for path in ROOT.glob("airhockey_env/**/*.py")
    }
    assert set(found) - {name for name in found if name.endswith("__pycache__")} == folders
    data = project["tool"]["setuptools"]["package-data"]["airhockey_env"]
    assert "py.typed" in data
    assert all(list((ROOT / "airhockey_env").glob(pattern)) for pattern in data)


def test_base_dependencies_are_three() -> None:
    tomllib = pytest.importorskip("tomllib")
    with open(ROOT / "pyproject.toml", "rb") as file:
        project = tomllib.load(file)["project"]
    assert sorted(requirement.partition(">")[0] for requirement in project["dependencies"]) == [
        "gymnasium",
        "numba",
        "numpy",
    ]
    every = set().union(*(requirements for name, requirements in project["optional-dependencies"].items()))
    constrained = {
        line.partition("==")[0] for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line
    }
    named = {requirement.partition(">")[0] for requirement in every if not requirement.startswith("airhockey-env")}
    assert named <= constrained, "constraints.txt must pin what the extras name"


def test_importing_takes_the_base_dependencies_alone(tmp_path: Path) -> None:
    heavy = ("torch", "stable_baselines3", "matplotlib", "pygame", "pettingzoo", "PIL", "tyro", "rich", "tensorboard")
    code = (
        "import sys, gymnasium, airhockey_env, airhockey_env.policy\n"
        "for name in ('AirHockey-v0', 'airhockey_env:AirHockey-v0'):\n"
        "    gymnasium.make(name).reset(seed=0)\n"
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    assert run_python(code, tmp_path).strip() == "[]"


def test_importing_only_registers(tmp_path: Path) -> None:
    code = (
        "import gymnasium, warnings; before = set(gymnasium.registry); filters = list(warnings.filters)\n"
        "import airhockey_env; print(sorted(set(gymnasium.registry) - before)); assert warnings.filters == filters\n"
    )
    registered = run_python(code, tmp_path).strip()
    assert "AirHockey-v0" in registered
    assert all(name.startswith("AirHockey") for name in registered.strip("[]").replace("'", "").split(", "))
    assert not list(tmp_path.iterdir())


def test_a_missing_extra_is_named(tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "for name in ('stable_baselines3', 'pygame'):\n"
        "    sys.modules[name] = None\n"
        "import airhockey_env, gymnasium\n"
        "from gymnasium.error import DependencyNotInstalled\n"
        "env = gymnasium.make('AirHockey-v0', render_mode='human')\n"
        "for work in (lambda: __import__('airhockey_env.sb3_vec_env'), lambda: env.reset(seed=0)):\n"
        "    try:\n"
        "        work()\n"
        "    except DependencyNotInstalled as error:\n"
        "        print(error)\n"
    )
    printed = run_python(code, tmp_path)
    assert "airhockey-env[train]" in printed
    assert "airhockey-env[human]" in printed


def test_the_version_stands_in_one_place() -> None:
    assert airhockey_env.__version__ in (ROOT / "CHANGELOG.md").read_text()
    assert f"version: {airhockey_env.__version__}\n" in (ROOT / "CITATION.cff").read_text()
