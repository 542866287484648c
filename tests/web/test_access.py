"""Who may talk to the server."""

from __future__ import annotations

import pytest

from airhockey_env.web.access import Access, is_loopback

TOKEN = "abcdefghijkl"


@pytest.mark.parametrize(
    ("host", "loopback"),
    [
        ("127.0.0.1", True), ("127.8.8.8", True), ("::1", True), ("localhost", True),
        ("0.0.0.0", False), ("::", False), ("192.168.0.2", False), ("", False), ("localhost.example.org", False),
    ],
)  # fmt: skip
def test_other_hosts_than_the_loopback_address_need_a_token(host: str, loopback: bool) -> None:
    assert is_loopback(host) is loopback
    Access(host, 80, TOKEN)
    if loopback:
        Access(host, 80, None)
    else:
        with pytest.raises(ValueError, match="--token"):
            Access(host, 80, None)


@pytest.mark.parametrize("token", ["", "short", "abcdefghijk", "abcdefghijk!", "ab cdefghijkl", "äbcdefghijklm"])
def test_tokens_that_are_none(token: str) -> None:
    with pytest.raises(ValueError, match="--token"):
        Access("127.0.0.1", 80, token)


def test_a_stranger_s_name_for_this_machine_is_refused() -> None:
    access = Access("127.0.0.1", 80, None)
    for host in ("localhost:80", "127.0.0.1", "[::1]:80", "LOCALHOST"):
        assert access.host_allowed(host)
    for host in ("evil.example", "evil.example:80", "", "[", "127.0.0.1.evil.example", "localhost@evil.example"):
        assert not access.host_allowed(host)
    assert Access("0.0.0.0", 80, TOKEN).host_allowed("my-laptop.local:80")


def test_origins() -> None:
    access = Access("127.0.0.1", 8020, None)
    assert access.origin_allowed("http://127.0.0.1:8020", "127.0.0.1:8020")
    assert access.origin_allowed("https://Table.example", "table.example")
    for origin in (
        None,
        "",
        "null",
        "http://127.0.0.1:8021",
        "http://localhost:8020",
        "http://evil.example",
        "http://[",
    ):
        assert not access.origin_allowed(origin, "127.0.0.1:8020")
    assert not access.origin_allowed("", "")


def test_tokens() -> None:
    access = Access("0.0.0.0", 8020, TOKEN)
    assert access.token_right(TOKEN, None)
    assert access.token_right(None, f"other=1; airhockey_8020={TOKEN}")
    for token, cookies in (
        (None, None), ("", None), ("abcdefghijkm", None), (None, f"airhockey_8021={TOKEN}"), (None, "\x00;=;"),
        ("wrong", f"airhockey_8020={TOKEN}"), ("ä\ud800", None),
    ):  # fmt: skip
        assert not access.token_right(token, cookies)
    assert Access("127.0.0.1", 8020, None).token_right(None, None)
