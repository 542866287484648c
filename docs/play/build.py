"""Build the game for browsers: python -m docs.play.build

It needs clang and its linker for WebAssembly (on Debian: apt-get install clang lld) and no library: of the C library,
the game uses only functions that are instructions of WebAssembly (math.h). WebAssembly has no fused multiply-adds apart
from its relaxed vector operations, and clang may not contract expressions, so all numbers are those of airhockey_env.
The result is committed, so that the site can be built without a compiler.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path

from gymnasium.error import DependencyNotInstalled

FOLDER = Path(__file__).parent
SOURCES = (FOLDER / "match.c", FOLDER / "policy.c")
WASM = FOLDER / "game.wasm"
COMMAND = ("clang", "--target=wasm32", "-nostdlib", "-Wl,--no-entry,--strip-all")
FLAGS = ("-std=c11", "-O2", "-ffp-contract=off", "-ffreestanding", "-mbulk-memory", "-Wall", "-Wextra", "-Werror")


def check_compiler() -> None:
    """See whether clang and its linker can build an empty program.

    Raises:
        DependencyNotInstalled: they cannot.
    """
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "empty.c"
        source.touch()
        try:
            done = subprocess.run([*COMMAND, source, "-o", Path(folder) / "empty.wasm"], capture_output=True, text=True)
        except FileNotFoundError as error:
            raise DependencyNotInstalled("the game for browsers needs clang: apt-get install clang lld") from error
    if done.returncode:
        raise DependencyNotInstalled(f"clang cannot build for WebAssembly (apt-get install lld): {done.stderr.strip()}")


def build(path: Path = WASM) -> Path:
    """Build the game.

    Args:
        path: the file to write.

    Returns:
        The path.

    Raises:
        DependencyNotInstalled: clang or its linker is missing.
        RuntimeError: the source has mistakes; the message is the compiler's.
    """
    check_compiler()
    done = subprocess.run([*COMMAND, *FLAGS, f"-I{FOLDER}", *SOURCES, "-o", path], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr.strip())
    path.chmod(0o644)
    return path


if __name__ == "__main__":
    argparse.ArgumentParser(description="Build docs/play/game.wasm, the game for browsers.").parse_args()
    print(build())
