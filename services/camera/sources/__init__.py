"""Where pictures come from: one module a kind, and which kind a setting means."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from common.errors import SourceError
from common.near_names import nearest, question
from services.camera.sources.base import Source

Kind = Literal["synthetic", "device", "video", "folder", "url"]

URL_SCHEMES = ("rtsp", "rtsps", "http", "https")
IMAGE_EXTENSIONS = ("png", "jpg", "jpeg", "bmp", "tif", "tiff", "webp", "pgm", "ppm")
SECRET_FIELD = re.compile(r"(?i)([?&][^=&]*(?:pass|pwd|token|key|secret|auth)[^=&]*=)[^&#]*")
ALLOWED = (
    "synthetic, a device (0, /dev/video0), a video file, a folder of images, "
    "or a URL (rtsp://, http://)"
)


def without_password(url: str) -> str:
    """Return a URL so that it can be shown: its user, password and secret fields masked.

    Rather too much is masked than too little: everything up to the last ``@``, since people
    paste passwords with any character in them.
    """
    return SECRET_FIELD.sub(r"\1***", re.sub(r"://.*@", "://***@", url))


def kind_of(spec: str) -> Kind:
    """Tell what kind of source a setting names.

    Raises:
        SourceError: It is none of the kinds; says which there are.
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
    mode = _mode(spec)
    if mode is None:
        raise SourceError(f"{spec}: no such file or folder{_meant(path)}; a source is {ALLOWED}")
    if stat.S_ISDIR(mode):
        return "folder"
    if stat.S_ISREG(mode):
        return "folder" if path.suffix[1:].lower() in IMAGE_EXTENSIONS else "video"
    raise SourceError(f"{spec}: neither a regular file nor a folder; a source is {ALLOWED}")


def _mode(spec: str) -> int | None:
    """Return the file mode of what a path names, None if nothing is there.

    Raises:
        SourceError: That cannot be told.
    """
    try:
        return os.stat(spec).st_mode
    except (FileNotFoundError, NotADirectoryError, ValueError):  # ValueError: holds a null byte
        return None
    except PermissionError:
        raise SourceError(f"{spec}: permission denied on the way to it") from None
    except OSError as error:
        raise SourceError(f"{spec}: {error.strerror}; a source is {ALLOWED}") from None


def _meant(path: Path) -> str:
    """Return a question with the nearest names, in case this one is mistyped."""
    try:
        there = [other.name for other in path.parent.iterdir()]
    except OSError:
        there = []
    near = [str(path.with_name(name)) for name in nearest(path.name, there, most=3)]
    if len(path.parts) == 1:
        near += nearest(path.name, ["synthetic"])
    return question(near, before=", ")


def open_source(
    spec: str,
    *,
    width: int | None,
    height: int | None,
    rate_hz: float | None,
    fourcc: str | None,
    timeout_s: float,
    synthetic: Callable[[], Source],
) -> Source:
    """Open the source that a setting names; loads only what that kind needs.

    Raises:
        SourceError: It cannot be opened; says why and what can be done.
    """
    kind = kind_of(spec)
    if kind == "synthetic":
        return synthetic()
    if kind == "device":
        from services.camera.sources.device import DeviceSource

        return DeviceSource(spec, width=width, height=height, rate_hz=rate_hz, fourcc=fourcc)
    if kind == "url":
        from services.camera.sources.url import UrlSource

        return UrlSource(spec, timeout_s=timeout_s)
    if kind == "folder":
        from services.camera.sources.folder import FolderSource

        return FolderSource(Path(spec), rate_hz=rate_hz or 10.0)
    from services.camera.sources.video import VideoSource

    return VideoSource(Path(spec))
