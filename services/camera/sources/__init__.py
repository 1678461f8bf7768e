"""Where pictures come from: one module a kind, and which kind a setting means."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

from common.errors import SourceError
from services.camera.sources.base import Source

Kind = Literal["synthetic", "device", "video", "folder", "url"]

URL_SCHEMES = ("rtsp", "rtsps", "http", "https")
ALLOWED = (
    "synthetic, a device (0, /dev/video0), a video file, a folder of images, "
    "or a URL (rtsp://, http://)"
)


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
            raise SourceError(f"{spec}: no such kind of URL; allowed: {', '.join(URL_SCHEMES)}")
        return "url"
    path = Path(spec)
    if path.is_dir():
        return "folder"
    if path.exists():
        return "video"
    raise SourceError(f"{spec}: no such file or folder; a source is {ALLOWED}")


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
