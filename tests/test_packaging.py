"""What pip installs: the one package, with base dependencies alone."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

import airhockey_env
from tests.helpers import IDS, ROOT, still_policy


def run_python(code: str, folder: Path) -> str:
    """Run code in a process of its own, outside the checkout."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


CHILD = """
import importlib.util, sys
import gymnasium, airhockey_env
from gymnasium.utils.env_checker import check_env

assert airhockey_env.__file__.startswith(sys.prefix), airhockey_env.__file__
heavy = "torch stable_baselines3 pettingzoo pygame PIL matplotlib agents scripts benchmarks tests"
assert not [name for name in heavy.split() if importlib.util.find_spec(name)]
from airhockey_env.opponents.policy import MlpPolicy
from airhockey_env.opponents.trained import trained_policy

mine = MlpPolicy.load("policy.npz")
assert isinstance(trained_policy("probe"), MlpPolicy)
for name in sorted(name for name in gymnasium.registry if name.startswith("AirHockey")):
    for opponent in ("striker", mine):
        env = gymnasium.make(name, opponent=opponent, max_episode_steps=50, disable_env_checker=True)
        check_env(env.unwrapped, skip_render_check=True)
        env.reset(seed=0)
        for step in range(50):
            done = env.step([1.0, 0.2])[2:4]
            if any(done):
                break
        envs = gymnasium.make_vec(name, num_envs=3, opponent=opponent)
        envs.reset(seed=0)
        envs.step(envs.action_space.sample())
        print(name)
"""


def test_the_wheel_plays_in_an_empty_environment(tmp_path: Path) -> None:
    """Installed outside the checkout, with the base dependencies and nothing else beside it."""
    pytest.importorskip("setuptools", "77")  # reads the licence's new form
    source = tmp_path / "source"
    ignored = shutil.ignore_patterns("__pycache__")
    for name in ("airhockey_env", "agents", "scripts"):
        shutil.copytree(ROOT / name, source / name, ignore=ignored)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    policy = still_policy()
    policy.save(source / "airhockey_env" / "opponents" / "trained" / "probe.npz")  # package data
    policy.save(tmp_path / "policy.npz")
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check"]
    build = [*pip, "wheel", "-q", "--no-deps", "--no-build-isolation", "--no-index", "-w", str(tmp_path), str(source)]
    subprocess.run(build, check=True, cwd=tmp_path)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as file:
        names = file.namelist()
    assert {name.split("/")[0] for name in names} == {"airhockey_env", wheel.name.rsplit("-", 3)[0] + ".dist-info"}
    assert {path.relative_to(ROOT).as_posix() for path in ROOT.glob("airhockey_env/**/*.py")} <= set(names)
    assert {"airhockey_env/py.typed", "airhockey_env/opponents/trained/probe.npz"} <= set(names)
    pages = {
        path.relative_to(ROOT).as_posix() for path in (ROOT / "airhockey_env/web/static").rglob("*") if path.is_file()
    }
    assert {name for name in names if "/web/static/" in name} == pages

    venv.create(tmp_path / "empty", symlinks=os.name != "nt")
    python = next(path for path in (tmp_path / "empty").glob("[bS]*/python*") if path.name in ("python", "python.exe"))
    where = "import sysconfig; print(sysconfig.get_paths()['purelib'])"
    done = subprocess.run([python, "-c", where], capture_output=True, text=True, check=True)
    site = Path(done.stdout.strip())
    install = [*pip, "--python", str(python), "install", "-q", "--no-deps", "--no-index", str(wheel)]
    subprocess.run(install, check=True, cwd=tmp_path)
    for name in ("numpy", "numba", "llvmlite", "gymnasium", "cloudpickle", "farama-notifications", "typing_extensions"):
        distribution = importlib.metadata.distribution(name)
        for top in {path.parts[0] for path in distribution.files or ()} - {"..", "__pycache__"}:
            if not (site / top).exists():
                (site / top).symlink_to(Path(str(distribution.locate_file(top))))
    for cache in ROOT.glob("airhockey_env/**/__pycache__/*.nb[ic]"):  # of the same sources: or it compiles for long
        target = site / cache.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(cache, target)
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    played = subprocess.run([python, "-c", CHILD], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert played.returncode == 0, played.stderr
    assert sorted(set(played.stdout.split())) == IDS


def test_an_editable_install_has_the_commands(tmp_path: Path) -> None:
    """The whole checkout is on the path, so that `python -m scripts.evaluate` works from every folder."""
    pytest.importorskip("setuptools", "77")
    source = tmp_path / "source"
    for name in ("airhockey_env", "agents", "scripts"):
        (source / name).mkdir(parents=True)
        (source / name / "__init__.py").touch()
    shutil.copy(ROOT / "airhockey_env" / "version.py", source / "airhockey_env")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    code = f"from setuptools.build_meta import build_editable; print(build_editable({str(tmp_path)!r}))"
    subprocess.run([sys.executable, "-c", code], cwd=source, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as file:
        (path,) = (name for name in file.namelist() if name.endswith(".pth"))
        assert Path(file.read(path).decode().strip()) == source


def test_base_dependencies_are_three() -> None:
    tomllib = pytest.importorskip("tomllib")
    with open(ROOT / "pyproject.toml", "rb") as file:
        project = tomllib.load(file)["project"]
    assert sorted(requirement.partition(">")[0] for requirement in project["dependencies"]) == [
        "gymnasium",
        "numba",
        "numpy",
    ]
    for extra, requirements in project["optional-dependencies"].items():
        name = f"constraints-{extra}.txt" if extra in ("ecosystem", "distributed") else "constraints.txt"
        lines = (ROOT / name).read_text(encoding="utf-8").splitlines()
        constrained = {line.partition("==")[0] for line in lines if "==" in line}
        named = {re.split(r"[>\[]", requirement)[0] for requirement in requirements} - {"airhockey-env"}
        assert named <= constrained, f"{name} must pin what the extra {extra} names"


def test_importing_takes_the_base_dependencies_alone(tmp_path: Path) -> None:
    heavy = ("torch", "stable_baselines3", "matplotlib", "pygame", "pettingzoo", "PIL", "tyro", "rich", "tensorboard")
    code = (
        "import sys, gymnasium, airhockey_env, airhockey_env.opponents.policy\n"
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
        "human = lambda: gymnasium.make('AirHockey-v0', render_mode='human')\n"
        "for work in (lambda: __import__('airhockey_env.sb3_vec_env'), human):\n"
        "    try:\n"
        "        work()\n"
        "    except DependencyNotInstalled as error:\n"
        "        print(error)\n"
    )
    printed = run_python(code, tmp_path)
    assert "airhockey-env[train]" in printed
    assert "airhockey-env[human]" in printed


@pytest.mark.parametrize("extra", ["study", "fit", "onnx", "data"])
def test_commands_of_other_extras_do_without_torch(extra: str, tmp_path: Path) -> None:
    """Regression: every command asked for the extra "train" first."""
    commands = {"study": "kiss_study", "fit": "fit_table", "onnx": "export", "data": "make_dataset"}
    code = (
        "import sys\n"
        "for name in ('stable_baselines3', 'torch', 'tensorboard'):\n"
        "    sys.modules[name] = None\n"
        f"import scripts.{commands[extra]}\n"
        "try:\n"
        "    import scripts.train_ppo\n"
        "except SystemExit as stop:\n"
        "    print(stop)\n"
    )
    printed = run_python(code, tmp_path)
    assert all(told in printed for told in ("torch", "stable_baselines3", "[train]"))
    tomllib = pytest.importorskip("tomllib")
    with open(ROOT / "pyproject.toml", "rb") as file:
        needed = tomllib.load(file)["project"]["optional-dependencies"][extra]
    assert {"tyro", "rich", "tqdm"} <= {requirement.split(">=")[0] for requirement in needed}


def test_the_version_is_the_same_everywhere() -> None:
    assert airhockey_env.__version__ in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"version: {airhockey_env.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"{{{airhockey_env.__version__}}}" in (ROOT / "docs" / "cite.md").read_text(encoding="utf-8")


def test_the_address_is_the_same_everywhere() -> None:
    tomllib = pytest.importorskip("tomllib")
    with open(ROOT / "pyproject.toml", "rb") as file:
        urls = tomllib.load(file)["project"]["urls"]
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"repository-code: {urls['Repository']}\n" in citation
    assert f"url: {urls['Homepage']}\n" in citation
    assert f"{{{urls['Repository']}}}" in (ROOT / "docs" / "cite.md").read_text(encoding="utf-8")
    assert f"{urls['Repository']}/actions" in (ROOT / "README.md").read_text(encoding="utf-8")
