"""Who may talk to the server."""

from __future__ import annotations

import hmac
import ipaddress
from http.cookies import SimpleCookie
from urllib.parse import urlsplit

LOOPBACK_NAME = "localhost"
SHORTEST_TOKEN = 12
"""Characters."""


def is_loopback(host: str) -> bool:
    """Whether only programs on this machine reach an address."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == LOOPBACK_NAME


class Access:
    """Decides from the headers of a request.

    Without a token, only pages that this machine's browser has loaded from this machine get in: the host that they ask
    for must be the machine itself under a name that no other machine can have (or a stranger's name could be made to
    lead here), and their origin must be this server. With a token, a browser must have been given it.

    Args:
        host: the address that the server is bound to.
        port: its port.
        token: what a visitor must know; None: nothing.

    Raises:
        ValueError: another host than the loopback address needs a token, or the token is short.
    """

    def __init__(self, host: str, port: int, token: str | None) -> None:
        if token is None and not is_loopback(host):
            raise ValueError(f"--token must be given with --host {host}, which other machines may reach")
        if token is not None and (len(token) < SHORTEST_TOKEN or not token.isalnum() or not token.isascii()):
            raise ValueError(f"--token must be {SHORTEST_TOKEN} or more letters and digits, or 'random'")
        self._token = token
        self._only_loopback = is_loopback(host)
        self.cookie = f"airhockey_{port}"
        """The cookie that keeps the token. Cookies belong to a host, whatever the port: so the name says the port."""

    def host_allowed(self, host: str) -> bool:
        """Whether a request's Host header may name this server."""
        return not self._only_loopback or is_loopback(_name_of(host))

    def origin_allowed(self, origin: str | None, host: str) -> bool:
        """Whether a page of this origin may open a session or upload: one that this server has served."""
        if origin is None:
            return False
        try:
            return bool(host) and urlsplit(origin).netloc.lower() == host.lower()
        except ValueError:
            return False

    def token_right(self, token: str | None, cookies: str | None) -> bool:
        """Whether a visitor knows the token, from the address or from the cookie of an earlier visit."""
        if self._token is None:
            return True
        if token is None:
            try:
                morsel = SimpleCookie(cookies or "").get(self.cookie)
            except Exception:  # of whatever makes no cookie
                morsel = None
            token = morsel.value if morsel is not None else ""
        return hmac.compare_digest(token.encode("utf-8", "replace"), self._token.encode())


def _name_of(host: str) -> str:
    """The name or address in a Host header."""
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""
