"""The interface of a source, and the picture it delivers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from numpy.typing import NDArray

from zenoh_vision.image.pixel_formats import Pixels, encoding_of
from zenoh_vision.image.stored import StoredPicture
from zenoh_vision.messages import Track


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture as a source delivered it.

    Attributes:
        encoding: That of the decoded pixels: ``mono8 mono16 bgr8 rgb8 bgra8 rgba8 16UC1 32FC1``.
        pixels: (height, width) or (height, width, channels), uint8, uint16 or float32; None where
            the source delivered a JPEG or another form that is not decoded yet.
        jpeg: The packet of an MJPEG source, complete (Huffman tables included); None for other
            sources.
        stored: A video's or webcam's picture, not converted yet to ``bgr8``; None for others.
        stamp_ns: Capture time, ns since 1970; None if unknown.
        due_s: When to publish it, seconds on the source's own clock since its first picture; None
            for a source that paces itself or has no clock.
        truth: All objects in a synthetic picture; None for other sources.
    """

    encoding: str
    width: int
    height: int
    pixels: Pixels | None = None
    jpeg: bytes | None = None
    stored: StoredPicture | None = None
    stamp_ns: int | None = None
    due_s: float | None = None
    truth: tuple[Track, ...] | None = None


def picture_of(
    pixels: NDArray[Any], *, stamp_ns: int | None = None, due_s: float | None = None
) -> Picture:
    """Return decoded pixels as a picture, in the encoding that their channels and dtype imply.

    Raises:
        PayloadError: ``unsupported_encoding``.
    """
    if pixels.ndim == 3 and pixels.shape[2] == 1:
        pixels = pixels[:, :, 0]
    height, width = pixels.shape[:2]
    return Picture(encoding_of(pixels), width, height, pixels, stamp_ns=stamp_ns, due_s=due_s)


class Source(Protocol):
    """An open source. Its constructor raises ``SourceError``.

    The same thread must open, read and close it: C libraries crash if their memory is freed
    during a call.

    Attributes:
        description: For people: ``video file walk.avi (768x576, 10 Hz, MJPEG)``.
        live: Whether it paces itself (a device, a URL) instead of being paced by the camera.
        rate_hz: Its own rate, None if it has none.
    """

    description: str
    live: bool
    rate_hz: float | None

    def read(self) -> Picture | None:
        """Return the next picture, or None at the normal end.

        Raises:
            SourceLost: The source stopped delivering, or delivers nothing usable.
        """

    def close(self) -> None:
        """Release the device, connection or file; safe to call twice."""


@runtime_checkable
class KnowsNextDue(Protocol):
    """A source that knows when its next picture is due before it draws the picture in ``read``."""

    def next_due_s(self) -> float | None:
        """Return when the next picture is due, as ``Picture.due_s``; None if there is none.

        May block for as long as ``read`` may.
        """
