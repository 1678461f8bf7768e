"""Recognises the kind of source that a setting names."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Literal

from zenoh_vision.error_text import did_you_mean, similar_names, without_password
from zenoh_vision.errors import SourceError
from zenoh_vision.image.files import names_image

Kind = Literal["synthetic", "device", "video", "folder", "recording", "url", "command"]

RECORDINGS = (".mcap", ".mcap.partial")
"""The second is one that was not closed, which is read as far as it is."""

COMMAND = "command:"
URL_SCHEMES = ("rtsp", "rtsps", "http", "https", "rtmp", "rtmps", "tcp", "udp", "srt", "rtp")
ALLOWED = (
    "synthetic, a device (0, /dev/video0), a video file, a recording (.mcap), "
    "a folder of images, a URL (rtsp://, http://), or a program (command:PROGRAM ARGS)"
)


PIPES = "name the program that writes the stream: command:PROGRAM ARGS, such as command:cat FIFO"


def kind_of(spec: str) -> Kind:
    """Return the kind of source that a setting names.

    Raises:
        SourceError: It names no source; the text lists the kinds.
    """
    return _kind_by_form(spec) or _kind_of_path(spec)


def source_words(spec: str) -> str:
    """Return what is said of a source in logs and messages: nothing of it that may be secret.

    A URL is without its passwords, a program without its arguments, of which any may be one.
    """
    if not spec.startswith(COMMAND):
        return without_password(spec)
    program, *_ = [*spec.removeprefix(COMMAND).split(), ""]
    return f"command {Path(program).name}".strip()


def _kind_by_form(spec: str) -> Kind | None:
    """Return the kind of a source that is no path; None for a path.

    Raises:
        SourceError: It has the form of a source that does not exist.
    """
    if spec == "synthetic":
        return "synthetic"
    if spec.startswith(COMMAND):
        return "command"
    if spec == "-":
        raise SourceError(f"{spec}: standard input is no source; {PIPES}")
    if spec.isdecimal() or spec.startswith("/dev/"):
        return "device"
    scheme, separator, _ = spec.partition("://")
    if not separator:
        return None
    if scheme.lower() not in URL_SCHEMES:
        shown = without_password(spec)
        schemes = ", ".join(f"{name}://" for name in URL_SCHEMES)
        raise SourceError(f"{shown}: no such kind of URL; allowed: {schemes}")
    return "url"


def _kind_of_path(spec: str) -> Kind:
    """Return the kind of a file or folder.

    Raises:
        SourceError: There is none, or it is of another kind.
    """
    path = Path(spec)
    try:
        mode = os.stat(spec).st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):  # ValueError: holds a null byte
        near = _suggestion(path)
        shown = without_password(spec)  # perhaps a URL without its scheme
        raise SourceError(f"{shown}: no such file or folder{near} a source is {ALLOWED}") from None
    except PermissionError:
        raise SourceError(f"{spec}: permission denied on the way to it") from None
    except OSError as error:
        raise SourceError(f"{spec}: {error.strerror}; a source is {ALLOWED}") from None
    if stat.S_ISDIR(mode):
        return "folder"
    if stat.S_ISREG(mode):
        return _kind_of_file(path)
    if stat.S_ISFIFO(mode):
        raise SourceError(f"{spec}: a FIFO is no source; {PIPES}")
    raise SourceError(f"{spec}: neither a regular file nor a folder; a source is {ALLOWED}")


def _kind_of_file(path: Path) -> Kind:
    if path.name.lower().endswith(RECORDINGS):
        return "recording"
    return "folder" if names_image(path) else "video"


def _suggestion(path: Path) -> str:
    """Return a question with similar names, or else a semicolon."""
    try:
        there = [other.name for other in path.parent.iterdir()]
    except OSError:
        there = []
    near = [str(path.with_name(name)) for name in similar_names(path.name, there, limit=3)]
    if len(path.parts) == 1:
        near += similar_names(path.name, ["synthetic"])
    return did_you_mean(near, before=", ") or ";"
