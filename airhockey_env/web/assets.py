"""The files that the pages are made of: read once, so that no request names a path on the disk."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

FOLDER = Path(__file__).parent / "static"

TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}
"""The types of files by suffix; files of other types are not served."""


class Asset(NamedTuple):
    """A file."""

    body: bytes
    content_type: str
    etag: str  # changes with the body


def load_assets(folder: Path = FOLDER) -> dict[str, Asset]:
    """The files of a folder by their path in it, with "/" between its parts."""
    assets = {}
    for path in sorted(folder.rglob("*")):
        if path.suffix in TYPES:
            body = path.read_bytes()
            etag = hashlib.sha256(body).hexdigest()[:16]
            assets[path.relative_to(folder).as_posix()] = Asset(body, TYPES[path.suffix], etag)
    return assets
