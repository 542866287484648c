"""A server in a process of its own, for the browser and the visitors of a benchmark."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from airhockey_env.web.access import Access
from airhockey_env.web.catalogue import Catalogue
from airhockey_env.web.limits import Limits
from airhockey_env.web.server import Server
from airhockey_env.web.sessions import SESSIONS

ROOT = Path(__file__).parents[2]


@contextlib.contextmanager
def serving(*, core: int | None = None, runs: tuple[str, ...] = ()) -> Iterator[str]:
    """Run a server; yields its address.

    Args:
        core: the processor that it may use; None: all of them.
        runs: folders of training runs.
    """
    command = [sys.executable, "-m", "benchmarks.web.serving", *runs]
    if core is not None:
        command += ["--core", str(core)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


async def serve(runs: list[str]) -> None:
    """Serve on a free port with room for many, until the process ends."""
    for session in SESSIONS.values():
        session.prepare()
    many = Limits(sessions=10_000, connections=20_000, share=1.0, all_shares=1e9)
    catalogue = Catalogue(runs={Path(run).name: Path(run) for run in runs})
    server = Server(Access("127.0.0.1", 0, None), catalogue, many)
    port = await server.start("127.0.0.1", 0)
    print(f"http://127.0.0.1:{port}", flush=True)
    await asyncio.Event().wait()


def main() -> None:
    """Read the command line and serve."""
    parser = argparse.ArgumentParser(description="Run the server of a benchmark.")
    parser.add_argument("--core", type=int, help="Use this processor only.")
    parser.add_argument("runs", nargs="*", help="Offer these training runs.")
    args = parser.parse_args()
    if args.core is not None and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {args.core})
    asyncio.run(serve(args.runs))


if __name__ == "__main__":
    main()
