"""The page's files: a fixed table that is read at start, so that no request reaches the disk."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources

INDEX = "index.html"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".webmanifest": "application/manifest+json",
}


@dataclass(frozen=True, slots=True)
class PageFile:
    """One file.

    Attributes:
        body: Its bytes.
        type: For the header ``Content-Type``.
        tag: For the header ``ETag``.
    """

    body: bytes
    type: str
    tag: str


def page_files() -> dict[str, PageFile]:
    """Return the files of the page by their names."""
    return dict(_read())


def _read() -> Iterator[tuple[str, PageFile]]:
    for entry in resources.files("services.viewer").joinpath("page").iterdir():
        ending = f".{entry.name.rpartition('.')[2]}"
        if entry.is_file() and ending in TYPES:
            body = entry.read_bytes()
            tag = f'"{hashlib.sha256(body).hexdigest()[:16]}"'
            yield entry.name, PageFile(body, TYPES[ending], tag)
