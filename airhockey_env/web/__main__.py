"""The game in the browser: python -m airhockey_env.web"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import secrets
import signal
import socket
import sys
import webbrowser
from pathlib import Path

from gymnasium.error import DependencyNotInstalled

from airhockey_env.checks import check_whole
from airhockey_env.opponents.players import NAMES, Player, resolve_player
from airhockey_env.web.access import Access
from airhockey_env.web.catalogue import Catalogue
from airhockey_env.web.sessions import SESSIONS

PORT = 8020
SWITCH_SECONDS = 0.0005
"""s that a thread with long work keeps the interpreter for itself: a tenth of Python's own, for the sessions' sake."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    result = argparse.ArgumentParser(
        prog="python -m airhockey_env.web",
        description="Serve the game to browsers: play against any opponent, watch players and training runs, and try "
        "the air table. The address is printed; Ctrl-C stops the server.",
    )
    add = result.add_argument
    add(
        "--host",
        default="127.0.0.1",
        help="The address to listen on. The default is reached from this machine only; any other needs --token.",
    )
    add("--port", type=int, default=PORT, help=f"The port to listen on, 0 for any that is free. Default: {PORT}.")
    add(
        "--token",
        help="What a visitor must know to get in: at least 12 letters and digits, or 'random' for a new one. It is "
        "part of the address that is printed.",
    )
    add("--open", action="store_true", help="Open the page in this machine's browser.")
    add(
        "--player",
        action="append",
        default=[],
        metavar="[NAME=]PATH",
        help="A policy.npz, or the folder of a training run, that visitors may choose as a player beside the named "
        "ones. It may be given several times.",
    )
    add(
        "--run",
        action="append",
        default=[],
        metavar="FOLDER",
        help="The folder of a training run to watch while it learns. It may be given several times.",
    )
    return result


def named_players(given: list[str]) -> dict[str, Player]:
    """The players that `--player` names, by what visitors call them.

    Raises:
        ValueError: a file holds no policy, or two players have the same name.
    """
    players: dict[str, Player] = {}
    for text in given:
        name, _, path = text.rpartition("=")
        file = Path(path)
        name = name or (file.parent.name if file.name == "policy.npz" else file.stem) or str(file)
        if name in players or name in NAMES:
            raise ValueError(f"--player must give every player a name of its own, NAME=PATH; {name!r} is taken")
        players[name] = resolve_player("--player", file)
    return players


def named_runs(given: list[str]) -> dict[str, Path]:
    """The runs that `--run` names, by the names of their folders.

    Raises:
        ValueError: there is no such folder, or two have the same name.
    """
    runs: dict[str, Path] = {}
    for text in given:
        folder = Path(text)
        if not folder.is_dir():
            raise ValueError(
                f"--run must be the folder of a training run, got {text}, which does not exist; a run makes its folder "
                "when it starts"
            )
        if folder.resolve().name in runs:
            raise ValueError(f"--run must name folders with different names, got two of the name {folder.name}")
        runs[folder.resolve().name] = folder
    return runs


def reachable(host: str) -> str:
    """The part of an address that leads to a host: in place of "all addresses", the one that others see us under."""
    if host in ("", "0.0.0.0", "::"):
        family, outside = (socket.AF_INET6, "2001:db8::1") if host == "::" else (socket.AF_INET, "192.0.2.1")
        try:
            with socket.socket(family, socket.SOCK_DGRAM) as probe:
                probe.connect((outside, 9))  # of documentation (RFC 5737, RFC 3849); nothing is sent
                host = probe.getsockname()[0]
        except OSError:
            host = "localhost"
    return f"[{host}]" if ":" in host else host


async def serve(args: argparse.Namespace) -> None:
    """Serve until the process is told to stop.

    Raises:
        ValueError, OSError: an argument does not fit, or the address cannot be listened on.
    """
    try:
        from airhockey_env.web.server import Server
    except ImportError as error:
        raise DependencyNotInstalled('the pages need aiohttp: pip install "airhockey-env[web]"') from error

    check_whole("--port", args.port, 0, 65_535)
    token = secrets.token_hex(16) if args.token == "random" else args.token
    access = Access(args.host, args.port, token)
    catalogue = Catalogue(named_players(args.player), named_runs(args.run))
    print("Getting ready; the first time takes a while.", flush=True)
    for session in SESSIONS.values():
        session.prepare()
    sys.setswitchinterval(SWITCH_SECONDS)
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):  # on Windows Ctrl-C raises KeyboardInterrupt
            loop.add_signal_handler(number, stop.set)
    server = Server(access, catalogue)
    try:
        port = await server.start(args.host, args.port)
    except OSError as error:
        raise OSError(f"--host and --port must be free to listen on: {error.strerror or error}") from error
    try:
        page = "/watch" if args.run else "/"
        address = f"http://{reachable(args.host)}:{port}{page}" + ("" if token is None else f"?token={token}")
        print(address, flush=True)
        if args.open:
            webbrowser.open(address)
        await stop.wait()
    finally:
        await server.stop()


def main(arguments: list[str] | None = None) -> None:
    """Read the command line and serve."""
    args = parser().parse_args(arguments)
    try:
        try:
            import aiohttp  # noqa: F401
        except ImportError as error:
            raise DependencyNotInstalled(
                'the browser\'s pages need aiohttp: pip install "airhockey-env[web]"'
            ) from error
        asyncio.run(serve(args))
    except KeyboardInterrupt:
        pass
    except (ValueError, OSError, DependencyNotInstalled) as error:
        sys.exit(f"web: {error}")


if __name__ == "__main__":
    main()
