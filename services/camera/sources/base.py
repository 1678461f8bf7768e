"""What every source of pictures gives the camera, whatever it reads."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from common.messages import Track

Pixels = NDArray[np.uint8] | NDArray[np.uint16]


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture as a source handed it over.

    Attributes:
        encoding: What the decoded pixels are: ``mono8 mono16 bgr8 rgb8 bgra8 rgba8``.
        width: Pixels.
        height: Pixels.
        pixels: (height, width) or (height, width, channels), uint8 or uint16; None when
            the source delivered a JPEG and nobody decoded it.
        jpeg: The packet as it came from an MJPEG source, complete (Huffman tables included);
            None for other sources.
        stamp_ns: Capture time, ns since 1970, when the source knows it; None: now.
        due_s: When to show it, in seconds of the source's own time since its first picture;
            None when the source paces itself or has no time of its own.
        truth: Where everything is, for a synthetic picture; None when unknown.
    """

    encoding: str
    width: int
    height: int
    pixels: Pixels | None = None
    jpeg: bytes | None = None
    stamp_ns: int | None = None
    due_s: float | None = None
    truth: tuple[Track, ...] | None = None


class Source(Protocol):
    """An open source. Opening raises ``SourceError``.

    Attributes:
        description: For people: ``video file walk.avi (768x576, 10 Hz, MJPEG)``.
        live: True if it paces itself (a device, a URL); False if the camera paces it.
        rate_hz: Its own rate, None when it has none.
    """

    description: str
    live: bool
    rate_hz: float | None

    def read(self) -> Picture | None:
        """Return the next picture, or None at a regular end.

        Raises:
            SourceLost: The source stopped delivering, or delivers nothing usable.
        """

    def close(self) -> None:
        """Give the device, the connection or the child process back; safe to call twice."""


@runtime_checkable
class Foresighted(Protocol):
    """A source that knows when its next picture is due before it makes it, at the last moment."""

    def next_due_s(self) -> float | None:
        """Return when the next picture is due, as ``Picture.due_s``; None: it has no more.

        May block for as long as ``read`` may.
        """
