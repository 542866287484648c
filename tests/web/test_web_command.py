"""The command line of `python -m airhockey_env.web`."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from airhockey_env.web.__main__ import main, named_players, named_runs, reachable
from tests.helpers import ROOT, still_policy
from tests.web.conftest import Serve


def test_players_are_named_by_their_files_or_by_hand(tmp_path: Path) -> None:
    (tmp_path / "my_run").mkdir()
    still_policy().save(tmp_path / "my_run" / "policy.npz")
    still_policy().save(tmp_path / "better.npz")
    run, other = str(tmp_path / "my_run"), str(tmp_path / "better.npz")
    given = named_players([run, f"{run}x={run}", other, f"best={other}"])
    assert set(given) == {"my_run", f"{run}x", "better", "best"}
    assert set(named_players([f"{run}/policy.npz"])) == {"my_run"}
    for bad in (["nothing.npz"], [run, run], [f"striker={other}"], [str(tmp_path)]):
        with pytest.raises(ValueError, match="--player"):
            named_players(bad)


def test_runs_are_named_by_their_folders(tmp_path: Path) -> None:
    for name in ("one", "two", "two/one"):
        (tmp_path / name).mkdir()
    assert set(named_runs([str(tmp_path / "one"), str(tmp_path / "two")])) == {"one", "two"}
    for bad in ([str(tmp_path / "three")], [str(tmp_path / "one"), str(tmp_path / "two" / "one")]):
        with pytest.raises(ValueError, match="--run"):
            named_runs(bad)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--host", "0.0.0.0"], "--token"),
        (["--token", "short"], "--token"),
        (["--player", "nothing.npz"], "--player"),
        (["--run", "nothing"], "--run"),
        (["--port", "99999"], "--port"),
        (["--port", "-1"], "--port"),
    ],
)
def test_what_does_not_fit_is_one_line(arguments: list[str], named: str) -> None:
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert isinstance(stop.value.code, str) and stop.value.code.startswith("web: ") and named in stop.value.code


def test_a_port_that_is_taken_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("airhockey_env.web.__main__.SESSIONS", {})
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(SystemExit) as stop:
            main(["--port", str(taken.getsockname()[1])])
    assert isinstance(stop.value.code, str) and "--port" in stop.value.code


def test_without_aiohttp_the_extra_is_named() -> None:
    code = "import sys; sys.modules['aiohttp'] = None; from airhockey_env.web.__main__ import main; main([])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 1 and "airhockey-env[web]" in done.stderr and "Traceback" not in done.stderr


def test_the_printed_address_lets_in_and_others_do_not(serve: Serve) -> None:
    address = serve("--host", "0.0.0.0", "--token", "random")
    assert "0.0.0.0" not in address
    address = re.sub(r"//[^:/]+:", "//127.0.0.1:", address)
    page, _, token = address.partition("?token=")
    assert len(token) == 32
    opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    assert opener.open(address).status == 200
    assert opener.open(page).status == 200  # by the cookie
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(page)
    assert refused.value.code == 401
    refused.value.close()


def test_the_printed_host_can_be_reached() -> None:
    assert reachable("127.0.0.1") == "127.0.0.1" and reachable("::1") == "[::1]" and reachable("table") == "table"
    assert reachable("0.0.0.0") not in ("", "0.0.0.0") and reachable("::") not in ("", "[::]")


def test_help_is_whole_sentences() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "airhockey_env.web", "--help"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    for option in ("--host", "--port", "--token", "--open", "--player", "--run"):
        assert option in done.stdout
