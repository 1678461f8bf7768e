"""The page's files, which are read into memory at the start, so that requests need no disk."""

from __future__ import annotations

import gzip
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable

INDEX = "index.html"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


@dataclass(frozen=True, slots=True)
class PageFile:
    """One file, with its headers ``Content-Type`` and ``ETag``; also as ``gzip``."""

    body: bytes
    compressed: bytes
    type: str
    tag: str


def page_files() -> dict[str, PageFile]:
    """Return the files of the page by their paths below ``page``, such as ``js/main.js``."""
    return dict(_read(resources.files("zv.viewer").joinpath("page")))


def _read(folder: Traversable, prefix: str = "") -> Iterator[tuple[str, PageFile]]:
    for entry in folder.iterdir():
        ending = f".{entry.name.rpartition('.')[2]}"
        if entry.is_dir():
            yield from _read(entry, f"{prefix}{entry.name}/")
        elif ending in TYPES:
            body = entry.read_bytes()
            tag = f'W/"{hashlib.sha256(body).hexdigest()[:16]}"'  # weak: the same for both forms
            compressed = gzip.compress(body, mtime=0)
            yield prefix + entry.name, PageFile(body, compressed, TYPES[ending], tag)
