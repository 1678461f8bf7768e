"""Recognises the kind of source that a setting names."""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from typing import Literal

from zenoh_vision.error_text import did_you_mean, similar_names
from zenoh_vision.errors import SourceError
from zenoh_vision.image.files import names_image

Kind = Literal["synthetic", "device", "video", "folder", "url"]

URL_SCHEMES = ("rtsp", "rtsps", "http", "https")
SECRET_FIELD = re.compile(r"(?i)([?&][^=&]*(?:pass|pwd|token|key|secret|auth)[^=&]*=)[^&#]*")
ALLOWED = (
    "synthetic, a device (0, /dev/video0), a video file, a folder of images, "
    "or a URL (rtsp://, http://)"
)


def without_password(url: str) -> str:
    """Return a URL with user, password and secret fields masked, for logs and errors.

    Everything up to the last ``@`` is masked, since people paste passwords with any character
    in them.
    """
    return SECRET_FIELD.sub(r"\1***", re.sub(r"://.*@", "://***@", url))


def kind_of(spec: str) -> Kind:
    """Return the kind of source that a setting names.

    Raises:
        SourceError: It names no source; the text lists the kinds.
    """
    if spec == "synthetic":
        return "synthetic"
    if spec.isdecimal() or spec.startswith("/dev/"):
        return "device"
    scheme, separator, _ = spec.partition("://")
    if separator:
        if scheme.lower() not in URL_SCHEMES:
            shown = without_password(spec)
            schemes = ", ".join(f"{name}://" for name in URL_SCHEMES)
            raise SourceError(f"{shown}: no such kind of URL; allowed: {schemes}")
        return "url"
    path = Path(spec)
    try:
        mode = os.stat(spec).st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):  # ValueError: holds a null byte
        near = _suggestion(path)
        raise SourceError(f"{spec}: no such file or folder{near}; a source is {ALLOWED}") from None
    except PermissionError:
        raise SourceError(f"{spec}: permission denied on the way to it") from None
    except OSError as error:
        raise SourceError(f"{spec}: {error.strerror}; a source is {ALLOWED}") from None
    if stat.S_ISDIR(mode):
        return "folder"
    if stat.S_ISREG(mode):
        return "folder" if names_image(path) else "video"
    raise SourceError(f"{spec}: neither a regular file nor a folder; a source is {ALLOWED}")


def _suggestion(path: Path) -> str:
    """Return a question with similar names, or an empty text."""
    try:
        there = [other.name for other in path.parent.iterdir()]
    except OSError:
        there = []
    near = [str(path.with_name(name)) for name in similar_names(path.name, there, limit=3)]
    if len(path.parts) == 1:
        near += similar_names(path.name, ["synthetic"])
    return did_you_mean(near, before=", ")
