"""From the settings to a source: which kind it is and how to open it."""

from __future__ import annotations

from collections.abc import Callable

from services.camera.settings import CameraSettings
from services.camera.sources import kind_of, open_source
from services.camera.sources.base import Source

FOLDER_RATE_HZ = 10.0
SYNTHETIC_RATE_HZ = 30.0


def watches_for_repeats(spec: str) -> bool:
    """Tell whether equal pictures mean trouble: not in a file, which may well hold such."""
    return kind_of(spec) in ("synthetic", "device", "url")


def rate_to_keep(settings: CameraSettings) -> float | None:
    """Return the rate that the reader imposes; None where the source's own times hold."""
    return None if kind_of(settings.source) == "synthetic" else settings.rate


def rate_to_reach(settings: CameraSettings) -> float | None:
    """Return the rate that the camera should have; None where the source's own will do."""
    own = {"synthetic": SYNTHETIC_RATE_HZ, "folder": FOLDER_RATE_HZ}
    return settings.rate or own.get(kind_of(settings.source))


def opener(settings: CameraSettings) -> Callable[[], Source]:
    """Return what opens the source that the settings name; it may be called again."""

    def synthetic() -> Source:
        from services.camera.scene.faults import parse_faults
        from services.camera.sources.synthetic import SyntheticSource

        return SyntheticSource(
            width=settings.width or 640,
            height=settings.height or 480,
            rate_hz=settings.rate or SYNTHETIC_RATE_HZ,
            seed=settings.seed,
            noise=settings.noise,
            objects=settings.objects,
            faults=parse_faults(settings.faults),
        )

    return lambda: open_source(
        settings.source,
        width=settings.width,
        height=settings.height,
        rate_hz=settings.rate,
        fourcc=settings.fourcc,
        timeout_s=settings.stall_after,
        synthetic=synthetic,
    )
