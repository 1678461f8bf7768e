"""Rules for each kind of source: how settings open it, and which changes require reopening."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from zenoh_vision.image.pixel_formats import DISTANCES
from zv.camera.settings import CameraSettings
from zv.camera.sources.base import Source
from zv.camera.sources.device import DeviceSource
from zv.camera.sources.folder import FolderSource
from zv.camera.sources.kinds import Kind, kind_of
from zv.camera.synthetic.faults import parse_faults
from zv.camera.synthetic.source import Conditions, SyntheticSource

FOLDER_RATE_HZ = 10.0
SYNTHETIC_RATE_HZ = 30.0

OpenSource = Callable[[CameraSettings, Callable[[], CameraSettings]], Source]
"""Opens a source with settings; the second argument returns the newest ones at any time."""


def open_source(settings: CameraSettings, newest: Callable[[], CameraSettings]) -> Source:
    """Open the source that the settings name; PyAV is loaded only if it is needed.

    The synthetic source follows the newest settings while it is open.

    Raises:
        SourceError: It cannot be opened; the text has the reason and a remedy.
    """
    kind = kind_of(settings.source)
    if kind == "synthetic":
        size = settings.size
        return SyntheticSource(size, settings.seed, lambda: scene_conditions(newest()))
    if kind == "device":
        return DeviceSource(
            settings.source,
            width=settings.width,
            height=settings.height,
            rate_hz=settings.rate,
            fourcc=settings.fourcc,
        )
    if kind == "url":
        from zv.camera.sources.url import UrlSource

        return UrlSource(settings.source, timeout_s=settings.stall_after)
    if kind == "folder":
        return FolderSource(Path(settings.source), rate_hz=settings.rate or FOLDER_RATE_HZ)
    from zv.camera.sources.video import VideoSource

    return VideoSource(Path(settings.source))


def expected_rate(kind: Kind, settings: CameraSettings) -> float | None:
    """Return the rate at which the camera should publish; None if the source decides."""
    default_hz = {"synthetic": SYNTHETIC_RATE_HZ, "folder": FOLDER_RATE_HZ}
    return settings.rate or default_hz.get(kind)


def imposed_rate(kind: Kind, settings: CameraSettings) -> float | None:
    """Return the rate at which the reader paces the source; None to follow the source's times."""
    return None if kind == "synthetic" else expected_rate(kind, settings)


def frozen_after_s(kind: Kind, settings: CameraSettings) -> float:
    """Return how long equal pictures may repeat; 0: forever, as in a file with equal pictures."""
    return settings.frozen_after if kind in ("synthetic", "device", "url") else 0.0


def needs_reopening(
    kind: Kind, opened: CameraSettings, newest: CameraSettings, source_hz: float | None
) -> bool:
    """Tell whether a source opened with some settings cannot follow the newest ones.

    ``source_hz`` is the source's own rate, None if unknown.
    """
    if not same_source(kind, opened, newest):
        return True
    if kind != "device" or newest.rate == opened.rate:
        return False
    # A lower rate only drops pictures; a higher one must be requested from the device.
    return newest.rate is None or newest.rate > (source_hz or opened.rate or 0.0)


def same_picture(kind: Kind, one: CameraSettings, other: CameraSettings) -> bool:
    """Tell whether a source reads the same picture with either settings."""
    if one is other:
        return True  # nearly always
    if not same_source(kind, one, other):
        return False
    return kind != "synthetic" or scene_conditions(one) == scene_conditions(other)


def same_source(kind: Kind, one: CameraSettings, other: CameraSettings) -> bool:
    """Tell whether a source is opened in the same way with either settings."""
    if one is other:
        return True
    if kind == "synthetic":
        return (*one.size, one.seed) == (*other.size, other.seed)
    fixed = ("width", "height", "fourcc") if kind == "device" else ()
    return all(getattr(one, name) == getattr(other, name) for name in fixed)


@lru_cache(maxsize=4)
def scene_conditions(settings: CameraSettings) -> Conditions:
    """Return the conditions that may change in the synthetic scene while it is open."""
    return Conditions(
        rate_hz=settings.rate or SYNTHETIC_RATE_HZ,
        noise=settings.noise,
        objects=settings.objects,
        faults=parse_faults(settings.faults),
        numbered=settings.numbered,
        depth=settings.encoding in DISTANCES,
    )
