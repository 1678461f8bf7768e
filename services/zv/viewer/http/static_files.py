"""The page's files, which are read into memory at the start, so that requests need no disk."""

from __future__ import annotations

import gzip
import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable

INDEX = "index.html"
VENDOR = "vendor/"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}

COMMENT = re.compile(rb"^[ \t]*(?://[^\n]*|/\*(?:(?!\*/).)*\*/[ \t]*)$", re.MULTILINE | re.DOTALL)
"""Comments on lines of their own, in scripts and style sheets."""


@dataclass(frozen=True, slots=True)
class PageFile:
    """One file, with its headers ``Content-Type`` and ``ETag``; also as ``gzip``."""

    body: bytes
    compressed: bytes
    type: str
    tag: str


def page_files() -> dict[str, PageFile]:
    """Return the files of the page by their paths below ``page``, such as ``js/main.js``.

    Comments are left out, but not their lines, so that an error names the line in the source; of
    what others wrote they are its notice of copyright, and stay. The index names all modules, so
    that a browser requests them at once and not level by level.
    """
    bodies = dict(_read(resources.files("zv.viewer").joinpath("page")))
    modules = sorted(name for name in bodies if name.startswith("js/"))
    links = "".join(f'<link rel="modulepreload" href="page/{name}">\n' for name in modules)
    bodies[INDEX] = bodies[INDEX].replace(b"</head>", links.encode() + b"</head>")
    return {name: _file(name, body) for name, body in bodies.items()}


def _file(name: str, body: bytes) -> PageFile:
    tag = f'W/"{hashlib.sha256(body).hexdigest()[:16]}"'  # weak: the same for both forms
    return PageFile(body, gzip.compress(body, mtime=0), TYPES[_ending(name)], tag)


def _read(folder: Traversable, prefix: str = "") -> Iterator[tuple[str, bytes]]:
    for entry in folder.iterdir():
        if entry.is_dir():
            yield from _read(entry, f"{prefix}{entry.name}/")
        elif _ending(entry.name) in TYPES:
            body = entry.read_bytes()
            is_ours = _ending(entry.name) in (".js", ".css") and prefix != VENDOR
            yield prefix + entry.name, COMMENT.sub(_blank, body) if is_ours else body


def _blank(comment: re.Match[bytes]) -> bytes:
    return b"\n" * comment[0].count(b"\n")


def _ending(name: str) -> str:
    return f".{name.rpartition('.')[2]}"
