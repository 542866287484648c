"""The server as people start it, and a browser."""

from __future__ import annotations

import contextlib
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from gymnasium.error import DependencyNotInstalled

from airhockey_env.live import LiveMatch
from benchmarks.web.browser import Browser, open_chromium
from tests.helpers import ROOT

Serve = Callable[..., str]
"""The fixture `serve`: from a command line to the address that the server prints."""


@pytest.fixture(scope="session")
def serve() -> Iterator[Serve]:
    """Start `python -m airhockey_env.web` on a free port; all servers are stopped in the end."""
    with contextlib.ExitStack() as stack:

        def start(*arguments: str) -> str:
            process = subprocess.Popen(
                [sys.executable, "-m", "airhockey_env.web", "--port", "0", *arguments],
                env=os.environ | {"PYTHONPATH": str(ROOT)},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            stack.enter_context(process)  # waits for it, and closes the pipe
            stack.callback(process.terminate)
            assert process.stdout is not None
            said = []
            for line in process.stdout:
                said.append(line)
                if match := re.search(r"http://\S+", line):
                    return match[0]
            raise AssertionError("".join(said))

        yield start


@pytest.fixture(scope="session")
def address(serve: Serve) -> str:
    """The address of a server without options."""
    return serve().rstrip("/")


@pytest.fixture(scope="session")
def driver() -> Iterator[Any]:
    """A headless Chromium."""
    try:
        driver = open_chromium()
    except DependencyNotInstalled as error:
        pytest.skip(str(error))
    yield driver
    driver.quit()


@pytest.fixture
def browser(driver: Any, tmp_path: Path) -> Iterator[Browser]:
    """A page of 1280 x 720 px, with downloads in `tmp_path`. It has to load without errors, from the server alone."""
    browser = Browser(driver, tmp_path)
    browser.resize(1280, 720)
    browser.forget()
    yield browser
    browser.leave()
    browser.check()


@pytest.fixture(scope="session")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The replay of a short match that the expert wins."""
    match = LiveMatch("expert", points=2, recorded=True, seed=2)
    now = 0.0
    while not match.over:
        now += 1 / 60
        assert now < 300.0
        match.advance(now, (-0.9 + 0.25 * math.sin(3.0 * now), 0.35 * math.cos(2.2 * now)))
    path = tmp_path_factory.mktemp("replay") / "match.npz"
    match.replay().save(path)
    return path
