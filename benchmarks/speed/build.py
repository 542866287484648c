"""Build the game in C (airhockey.c) with any C compiler, so that it computes the same numbers with each.

A fused multiply-add rounds once where a product and a sum round twice. Where a compiler uses them depends on the
compiler and the processor, so the object code must not contain any; `fused` finds them.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sysconfig
import tempfile
from collections.abc import Sequence
from pathlib import Path

from gymnasium.error import DependencyNotInstalled

SOURCE = Path(__file__).with_name("airhockey.c")
NATIVE = ("-march=native", "-mcpu=native")  # not every compiler supports the first one on every processor
EXACT = "-ffp-contract=off"
NO_SLP = "-fno-tree-slp-vectorize"  # with AVX-512, gcc's SLP vectorizer still makes one fused operation (vfmaddsub)
FAST = "-fno-math-errno"  # nothing reads errno, and Numba's square roots do not set it either
FLAGS = (EXACT, NO_SLP, FAST)
DISASSEMBLERS = ("objdump", "llvm-objdump", "aarch64-linux-gnu-objdump")

_FUSED = re.compile(r"^\s*[0-9a-f]+:\s+(v?f[cn]?m(?:a[^x\s]|l|s)\S*)", re.MULTILINE)  # of x86-64, ARM and RISC-V


def compiler() -> tuple[str, ...] | None:
    """Command of the C compiler: the environment variable CC, or else `cc`, or else the one that built Python.

    Returns:
        The words of the command, or None if there is no compiler.

    Raises:
        DependencyNotInstalled: CC names a command that does not exist.
    """
    named = shlex.split(os.environ.get("CC", ""))
    if named:
        if shutil.which(named[0]) is None:
            raise DependencyNotInstalled(f"the environment variable CC names no command that exists: {named[0]!r}")
        return tuple(named)
    built = shlex.split(sysconfig.get_config_var("CC") or "")
    return next(((name,) for name in ("cc", *built[:1]) if shutil.which(name)), None)


def compilers() -> list[tuple[str, ...]]:
    """All compilers that work here: the one that `compiler` chooses, gcc and clang, each once."""
    found: dict[str, tuple[str, ...]] = {}
    for command in filter(None, (compiler(), ("gcc",), ("clang",))):
        path = shutil.which(command[0])
        if path is not None and knows(command, "-include", "math.h"):
            found.setdefault(os.path.realpath(path), command)
    return list(found.values())


def flags(command: Sequence[str]) -> list[str]:
    """The flags to build with: fast, exact, and supported by the compiler."""
    native = [flag for flag in NATIVE if knows(command, flag)][:1]
    return ["-O3", *native, *(flag for flag in FLAGS if knows(command, flag))]


def knows(command: Sequence[str], *options: str) -> bool:
    """Whether the compiler supports these options."""
    with tempfile.TemporaryDirectory(prefix="airhockey") as folder:
        empty, made = Path(folder) / "empty.c", Path(folder) / "empty.o"
        empty.touch()
        return subprocess.run([*command, *options, "-c", empty, "-o", made], capture_output=True).returncode == 0


def build(command: Sequence[str], options: Sequence[str], path: Path, link: bool = True) -> Path:
    """Build the shared library `path`, or with `link=False` the object file, which a cross-compiler can build too.

    Returns:
        The path.

    Raises:
        DependencyNotInstalled: the compiler or something that it needs is missing.
    """
    kind: list[str | Path] = ["-shared", "-fPIC", SOURCE, "-lm"] if link else ["-c", "-fPIC", SOURCE]
    done = subprocess.run(
        [*command, *options, *kind, "-o", path], capture_output=True, encoding="utf-8", errors="replace"
    )
    if done.returncode:
        raise DependencyNotInstalled(
            f"the game in C could not be built by {shlex.join(command)}: {done.stderr.strip()}"
        )
    return path


def fused(path: Path) -> list[str] | None:
    """Mnemonics of the fused multiply-adds in an object file; None if no installed disassembler can read it."""
    for tool in filter(None, map(shutil.which, DISASSEMBLERS)):
        read: list[str | Path] = [tool, "-d", "--no-show-raw-insn", path]
        done = subprocess.run(read, capture_output=True, encoding="utf-8", errors="replace")
        if done.returncode == 0 and "Disassembly" in done.stdout:  # otherwise it does not know the processor
            return _FUSED.findall(done.stdout)
    return None
