"""The machine-code cache is never stale, and never in the way."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from airhockey_env.compiled import PLAIN_ROOMS
from tests.helpers import ROOT

CALLEE = "from airhockey_env.compiled import compiled\n\n@compiled\ndef callee(x):\n    return {value} * x\n"
CALLER = (
    "from airhockey_env.compiled import compiled\nfrom airhockey_env.callee import callee\n\n"
    "@compiled\ndef caller(x):\n    return callee(x) + 1.0\n"
)
RUN = (
    "from airhockey_env.caller import caller\n"
    "print(caller(10.0), sum(caller.stats.cache_hits.values()), sum(caller.stats.cache_misses.values()))"
)


@pytest.fixture
def package(tmp_path):
    """A package of the same name with the real `compiled` and `parts`, and a caller and a callee in two files."""
    root = tmp_path / "site"
    (root / "airhockey_env").mkdir(parents=True)
    (root / "airhockey_env" / "__init__.py").touch()
    for name in ("compiled.py", "parts.py"):
        shutil.copy(ROOT / "airhockey_env" / name, root / "airhockey_env")
    (root / "airhockey_env" / "caller.py").write_text(CALLER)
    (root / "airhockey_env" / "callee.py").write_text(CALLEE.format(value=2.0))
    return root


def run(root, **environment):
    """What a fresh process prints: result, hits and misses of the cache."""
    inherited = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    result = subprocess.run(
        [sys.executable, "-c", RUN],
        cwd=root,
        env=inherited | {"PYTHONPATH": str(root), "HOME": str(root / "home")} | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    value, hits, misses = result.stdout.split()
    return float(value), int(hits), int(misses)


@pytest.mark.parametrize("where", ["beside the files", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME"])
def test_a_change_to_a_callee_in_another_file_reaches_its_callers(package, where):
    """And one back again; also in the user-wide cache, which serves where the package's folder cannot be written."""
    environment = {} if where == "beside the files" else {where: str(package / "cache")}
    if where == "XDG_CACHE_HOME":
        (package / "airhockey_env" / "__pycache__").write_text("in the way")
        environment["PYTHONDONTWRITEBYTECODE"] = "1"
    callee = package / "airhockey_env" / "callee.py"
    for value, result in ((2.0, 21.0), (3.0, 31.0)):
        callee.write_text(CALLEE.format(value=value))
        assert run(package, **environment) == (result, 0, 1)
        assert run(package, **environment) == (result, 1, 0)  # from the cache
    callee.write_text(CALLEE.format(value=2.0))
    assert run(package, **environment)[0] == 21.0
    assert any((package / "cache").rglob("*.nbi")) == bool(environment)


def test_a_package_that_moves_takes_its_cache_along_or_compiles_anew(package, tmp_path):
    run(package)
    moved = tmp_path / "elsewhere"
    shutil.move(package, moved)
    (moved / "airhockey_env" / "callee.py").write_text(CALLEE.format(value=5.0))
    assert run(moved)[0] == 51.0


def test_without_a_folder_to_write_to_it_still_works(package):
    """Files stand where the cache folders would have to be made: no one, not even root, can write there."""
    (package / "airhockey_env" / "__pycache__").write_text("in the way")
    (package / "home").write_text("in the way")
    environment = {"PYTHONDONTWRITEBYTECODE": "1", "XDG_CACHE_HOME": str(package / "home" / "cache")}
    assert run(package, **environment)[0] == 21.0
    (package / "airhockey_env" / "callee.py").write_text(CALLEE.format(value=3.0))
    assert run(package, **environment)[0] == 31.0


def test_a_terminal_is_told_why_the_first_step_takes_so_long(package):
    pty = pytest.importorskip("pty")
    environment = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}

    def told():
        ours, theirs = pty.openpty()
        subprocess.run(
            [sys.executable, "-c", RUN],
            cwd=package,
            env=environment | {"PYTHONPATH": str(package)},
            stdout=subprocess.DEVNULL,
            stderr=theirs,
            check=True,
        )
        os.write(theirs, b"\n")  # so that there is something to read
        os.close(theirs)
        said = os.read(ours, 1000).decode()
        os.close(ours)
        return said.strip()

    assert "compiling" in told()
    assert told() == ""


def test_a_change_to_what_is_not_compiled_leaves_the_cache_valid(package):
    for room in PLAIN_ROOMS:
        (package / "airhockey_env" / room).mkdir()
        (package / "airhockey_env" / room / "page.py").write_text("size = 1\n")
    assert run(package) == (21.0, 0, 1)
    for room in PLAIN_ROOMS:
        (package / "airhockey_env" / room / "page.py").write_text("size = 2\n")
    assert run(package) == (21.0, 1, 0)


def test_nothing_is_compiled_in_the_plain_rooms():
    for room in PLAIN_ROOMS:
        for path in (ROOT / "airhockey_env" / room).rglob("*.py"):
            assert "airhockey_env.compiled" not in path.read_text(), path
