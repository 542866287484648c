"""What the commands have in common: reading the command line, and one clear message for what goes wrong."""

from __future__ import annotations

import io
import os
import sys
import textwrap
from collections.abc import Callable
from typing import TypeVar

import tyro
from gymnasium.error import DependencyNotInstalled

from agents.options import check_resumed

Args = TypeVar("Args")

COLUMNS = 80
"""Width of the lines of an error, characters."""


def run_command(
    name: str,
    arguments: type[Args],
    act: Callable[[Args], object],
    own_args: Callable[[Args], tuple[object, Args]] | None = None,
) -> None:
    """Read the command line of `python -m scripts.NAME` into `arguments` and act on it.

    Args:
        own_args: of a command with --resume: the folder and the arguments of the run that it names. Options that were
            given are then told from defaults by reading the command line with the run's own arguments as defaults.

    Whatever a user can set right (a wrong argument, a file that is missing or damaged, a full disk) ends the process
    with one message, in lines of 80 columns, and exit code 1; Ctrl-C ends it with 130. When what reads the output has
    ended, as `head` does after its lines, the process ends without a message, with exit code 1.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")  # a terminal that has no µ gets a ?
    prog = f"python -m scripts.{name}"
    try:
        try:
            args = tyro.cli(arguments, prog=prog)
            if own_args is not None and getattr(args, "resume", None) is not None:
                _, kept = own_args(args)
                check_resumed(tyro.cli(arguments, prog=prog, default=kept), kept)
            act(args)
        finally:
            sys.stdout.flush()  # Python's own flush, at exit, would fail with a traceback
    except KeyboardInterrupt:
        print("\nStopped.", file=sys.stderr)
        sys.exit(130)
    except MemoryError as error:
        sys.exit(in_lines(f"{name}: not enough memory: {error}"))
    except (ValueError, OSError, DependencyNotInstalled) as error:
        broken_pipe = isinstance(error, BrokenPipeError)
        unread = output_fails(probe="\n" if broken_pipe else "") and broken_pipe
        sys.exit(1 if unread else in_lines(f"{name}: {error}"))


def output_fails(probe: str) -> bool:
    """Whether standard output takes no more text, tried with `probe`; if so, what it still holds is discarded.

    A broken pipe need not be that of the output: commands have pipes to processes of their own, too. The way to discard
    is that of https://docs.python.org/3/library/signal.html#note-on-sigpipe.
    """
    try:
        print(probe, end="", flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return True
    return False


def in_lines(message: str) -> str:
    """A message in lines of at most 80 columns; longer words, such as paths, are never broken."""
    return textwrap.fill(message, COLUMNS, break_long_words=False, break_on_hyphens=False)
