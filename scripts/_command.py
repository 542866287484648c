"""What the commands have in common: reading the command line, and one clear line for what goes wrong."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from typing import TypeVar

import tyro
from gymnasium.error import DependencyNotInstalled

Args = TypeVar("Args")


def run_command(name: str, arguments: type[Args], act: Callable[[Args], object]) -> None:
    """Read the command line of `python -m scripts.NAME` into `arguments` and act on it.

    Whatever a user can set right (a wrong argument, a file that is missing or damaged, a full disk) ends the process
    with one line and exit code 1; Ctrl-C ends it with 130.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that has no µ gets a ?
    args = tyro.cli(arguments, prog=f"python -m scripts.{name}")
    try:
        act(args)
    except KeyboardInterrupt:
        print("\nStopped.", file=sys.stderr)
        sys.exit(130)
    except MemoryError as error:
        sys.exit(f"{name}: not enough memory: {error}")
    except (ValueError, OSError, DependencyNotInstalled) as error:
        sys.exit(f"{name}: {error}")
