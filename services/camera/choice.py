"""What the settings mean for each kind of source: how to open it, and what a change asks for."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING

from services.camera.scene.faults import parse_faults
from services.camera.settings import CameraSettings
from services.camera.sources import Kind, open_source
from services.camera.sources.base import Source

if TYPE_CHECKING:
    from services.camera.sources.synthetic import Conditions

FOLDER_RATE_HZ = 10.0
SYNTHETIC_RATE_HZ = 30.0
SYNTHETIC_SIZE = (640, 480)

Opener = Callable[[CameraSettings, Callable[[], CameraSettings]], Source]
"""Opens a source with some settings; the newest can be asked for at any time."""


def watches_for_repeats(kind: Kind) -> bool:
    """Tell whether equal pictures mean trouble: not in a file, which may well hold such."""
    return kind in ("synthetic", "device", "url")


def rate_to_keep(kind: Kind, settings: CameraSettings) -> float | None:
    """Return the rate that the reader imposes; None where the source's own times hold."""
    return None if kind == "synthetic" else settings.rate or own_rate(kind)


def rate_to_reach(kind: Kind, settings: CameraSettings) -> float | None:
    """Return the rate that the camera should have; None where the source's own will do."""
    return settings.rate or own_rate(kind)


def own_rate(kind: Kind) -> float | None:
    """Return the rate of a kind of source that has none of its own but the one we choose."""
    return {"synthetic": SYNTHETIC_RATE_HZ, "folder": FOLDER_RATE_HZ}.get(kind)


def must_reopen(
    kind: Kind, opened: CameraSettings, now: CameraSettings, source_hz: float | None
) -> bool:
    """Tell whether an open source cannot follow a change of the settings.

    Args:
        kind: Of the source.
        opened: The settings that it was opened with.
        now: The settings that shall hold.
        source_hz: Its own rate, None when that is not known.
    """
    if not same_source(kind, opened, now):
        return True
    if kind != "device" or now.rate == opened.rate:
        return False
    # Slower is a matter of leaving pictures out. It was asked for that rate already, if it was.
    return now.rate is None or now.rate > (source_hz or opened.rate or 0.0)


def same_picture(kind: Kind, one: CameraSettings, other: CameraSettings) -> bool:
    """Tell whether a picture read with the one is what it would be with the other."""
    if not same_source(kind, one, other):
        return False
    return kind != "synthetic" or conditions_of(one) == conditions_of(other)


def same_source(kind: Kind, one: CameraSettings, other: CameraSettings) -> bool:
    """Tell whether a source opened with the one is what it would be with the other."""
    return _opened_with(kind, one) == _opened_with(kind, other)


def _opened_with(kind: Kind, settings: CameraSettings) -> tuple[object, ...]:
    """Return what a source cannot change while it is open."""
    if kind == "synthetic":
        return (*synthetic_size(settings), settings.seed)
    if kind == "device":
        return (settings.width, settings.height, settings.fourcc)
    return ()


def synthetic_size(settings: CameraSettings) -> tuple[int, int]:
    """Return width and height of the synthetic picture."""
    return settings.width or SYNTHETIC_SIZE[0], settings.height or SYNTHETIC_SIZE[1]


def open_by(settings: CameraSettings, newest: Callable[[], CameraSettings]) -> Source:
    """Open the source that the settings name.

    Raises:
        SourceError: It cannot be opened.
    """

    def synthetic() -> Source:
        from services.camera.sources.synthetic import SyntheticSource

        width, height = synthetic_size(settings)
        return SyntheticSource(
            width=width,
            height=height,
            seed=settings.seed,
            conditions=lambda: conditions_of(newest()),
        )

    return open_source(
        settings.source,
        width=settings.width,
        height=settings.height,
        rate_hz=settings.rate,
        fourcc=settings.fourcc,
        timeout_s=settings.stall_after,
        synthetic=synthetic,
    )


@lru_cache(maxsize=4)
def conditions_of(settings: CameraSettings) -> Conditions:
    """Return what the settings say of a synthetic picture."""
    from services.camera.sources.synthetic import Conditions

    return Conditions(
        rate_hz=settings.rate or SYNTHETIC_RATE_HZ,
        noise=settings.noise,
        objects=settings.objects,
        faults=parse_faults(settings.faults),
        numbered=settings.numbered,
    )
