"""Rules for each kind of source: how settings open it, and which changes require reopening."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from zenoh_vision.errors import ParameterRefused, SourceError
from zenoh_vision.image.pixel_formats import DEEP, DISTANCES
from zv.camera.settings import CameraSettings
from zv.camera.sources.base import DeviceWish, OffersModes, Source
from zv.camera.sources.folder import FolderSource
from zv.camera.sources.kinds import Kind, kind_of
from zv.camera.synthetic.faults import parse_faults
from zv.camera.synthetic.source import Conditions, SyntheticSource

FOLDER_RATE_HZ = 10.0
SYNTHETIC_RATE_HZ = 30.0
DEFAULT_RATES_HZ = {"synthetic": SYNTHETIC_RATE_HZ, "folder": FOLDER_RATE_HZ}

OpenSource = Callable[[CameraSettings, Callable[[], CameraSettings]], Source]
"""Opens a source with settings; the second argument returns the newest ones at any time."""


class SourceOpener:
    """Opens the source that settings name; its libraries are loaded only if they are needed.

    It remembers which device it has opened: after it was unplugged, ``/dev/video0`` may be another
    one, and the same one may have another number.
    """

    def __init__(self) -> None:
        self._device: str | None = None

    def __call__(self, settings: CameraSettings, newest: Callable[[], CameraSettings]) -> Source:
        """Open the source; the synthetic one follows the newest settings while it is open.

        Raises:
            SourceError: It cannot be opened; the text has the reason and a remedy.
        """
        kind = kind_of(settings.source)
        if kind == "synthetic":
            size = settings.size
            return SyntheticSource(size, settings.seed, lambda: scene_conditions(newest()))
        if kind == "device":
            return self._opened_device(settings, newest)
        if kind == "url":
            from zv.camera.sources.libav_options import options_of
            from zv.camera.sources.url import UrlOptions, open_url

            return open_url(
                settings.source,
                UrlOptions(
                    timeout_s=settings.stall_after,
                    username=settings.username,
                    password=password_of(settings),
                    transport=settings.rtsp_transport,
                    libav=options_of(settings.libav_options),
                    hwaccel=settings.hwaccel,
                    video_stream=settings.video_stream,
                    rate_hz=lambda: newest().rate,
                    max_lag_s=lambda: newest().max_lag,
                ),
            )
        if kind == "command":
            from zv.camera.sources.command import open_command

            return open_command(settings.source, settings.stall_after, lambda: newest().max_lag)
        if kind == "recording":
            from zv.camera.recorded import RecordedSource

            return RecordedSource(settings.source, settings.camera)
        if kind == "folder":
            return FolderSource(Path(settings.source), rate_hz=settings.rate or FOLDER_RATE_HZ)
        from zv.camera.sources.video import VideoSource

        return VideoSource(Path(settings.source), settings.video_stream)

    def _opened_device(
        self, settings: CameraSettings, newest: Callable[[], CameraSettings]
    ) -> Source:
        from zv.camera.sources.device import DeviceSource, found_again, stable_name

        device = found_again(settings.source, self._device)
        source = DeviceSource(
            device,
            device_wish(settings),
            controls=settings.controls,
            timeout_s=settings.stall_after,
            still_wanted=newest,
        )
        self._device = self._device or stable_name(device)
        return source


def device_wish(settings: CameraSettings) -> DeviceWish:
    """Return what settings ask of a device."""
    return DeviceWish(
        fourcc=settings.fourcc,
        width=settings.width,
        height=settings.height,
        rate_hz=settings.rate,
        deep=settings.encoding in DEEP,
    )


def check_change(kind: Kind, source: Source | None, settings: CameraSettings) -> None:
    """Refuse settings that an open source cannot follow.

    Raises:
        ParameterRefused: A device does not offer them.
    """
    if kind != "device" or not isinstance(source, OffersModes):
        return
    try:
        source.check(device_wish(settings))
    except SourceError as error:
        why, _, offered = str(error).partition("; offered: ")
        raise ParameterRefused(why, offered or "what zv camera --list lists") from None


def password_of(settings: CameraSettings) -> str | None:
    """Return the password for a URL; None if none is set.

    Raises:
        SourceError: Its file cannot be read, or is empty.
    """
    if settings.password_file is None:
        return settings.password
    try:
        text = Path(settings.password_file).read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8"
        raise SourceError(f"password_file = {settings.password_file}: {reason}") from None
    password = text.partition("\n")[0].rstrip("\r")
    if not password:
        raise SourceError(f"password_file = {settings.password_file}: its first line is empty")
    return password


def expected_rate(kind: Kind, settings: CameraSettings) -> float | None:
    """Return the rate at which the camera should publish; None if the source decides."""
    return settings.rate or DEFAULT_RATES_HZ.get(kind)


def imposed_rate(kind: Kind, settings: CameraSettings) -> float | None:
    """Return the rate at which the reader paces the source; None to follow the source's times."""
    return None if kind == "synthetic" else expected_rate(kind, settings)


def is_watched_for_repeats(kind: Kind) -> bool:
    """Tell whether equal pictures of a source are counted; those of a recording mean nothing."""
    return kind in ("synthetic", "device", "url", "command")


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
    if not same_source(kind, one, other):
        return False
    return kind != "synthetic" or scene_conditions(one) == scene_conditions(other)


def same_source(kind: Kind, one: CameraSettings, other: CameraSettings) -> bool:
    """Tell whether a source is opened in the same way with either settings."""
    if one is other:
        return True
    if kind == "synthetic":
        return (*one.size, one.seed) == (*other.size, other.seed)
    if kind != "device":
        return True
    # A rate may be followed by dropping pictures: ``needs_reopening`` tells.
    wishes = [replace(device_wish(each), rate_hz=None) for each in (one, other)]
    return wishes[0] == wishes[1]


def scene_conditions(settings: CameraSettings) -> Conditions:
    """Return the conditions that may change in the synthetic scene while it is open."""
    return _conditions(
        settings.rate or SYNTHETIC_RATE_HZ,
        settings.noise,
        settings.objects,
        settings.faults,
        settings.numbered,
        settings.encoding in DISTANCES,
    )


@lru_cache(maxsize=4)
def _conditions(
    rate_hz: float, noise: float, objects: int, faults: str, numbered: bool, depth: bool
) -> Conditions:
    return Conditions(
        rate_hz=rate_hz,
        noise=noise,
        objects=objects,
        faults=parse_faults(faults),
        numbered=numbered,
        depth=depth,
    )
