"""Pictures as the parts of a multipart/x-mixed-replace answer, for programs and for browsers.

A browser's ``<img>`` shows a part once it is over. Firefox knows that by the boundary behind it,
Chromium only by the head of the part after that. So browsers get both right behind each picture;
with the head only behind the boundary of the next picture, as is usual, Chromium shows every
picture one frame late and the last one never. A head that is sent so early can say nothing of the
picture that will follow it, which no ``<img>`` misses. Programs get a whole head with each picture.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from services.viewer.wire import Picture

BOUNDARY = "zenoh-vision-picture"
_BOUNDARY_LINE = f"--{BOUNDARY}\r\n".encode()


class Parts(Protocol):
    """What the pictures of one answer become, in their order."""

    def begin(self) -> bytes:
        """Return what comes before the first picture."""

    def part(self, picture: Picture) -> bytes:
        """Return what is sent for the next picture; the bulk is made once for all clients."""


def parts_for(headers: Mapping[str, str]) -> Parts:
    """Return what suits who asks: only browsers say that they take images."""
    return ForBrowsers() if "image/" in headers.get("Accept", "") else ForPrograms()


class ForPrograms:
    """Each part says which picture it is, when it was captured, and how long it is."""

    def begin(self) -> bytes:
        """Return the first boundary."""
        return _BOUNDARY_LINE

    def part(self, picture: Picture) -> bytes:
        """Return head, picture and boundary."""
        if not picture.part:
            picture.part = _whole(picture)
        return picture.part


class ForBrowsers:
    """Behind each picture the part of the next one is begun already."""

    def __init__(self) -> None:
        self._begun_as = ""

    def begin(self) -> bytes:
        """Return nothing: of which type the first picture is, it must say itself."""
        return b""

    def part(self, picture: Picture) -> bytes:
        """Return the picture and the begin of the next part."""
        if not picture.browser_part:
            picture.browser_part = b"".join((picture.payload, b"\r\n", _begun(picture.mime)))
        if picture.mime == self._begun_as:
            return picture.browser_part
        # The camera has begun to send PNGs, or ends that: the part that was begun stays empty.
        end = b"\r\n" if self._begun_as else b""
        self._begun_as = picture.mime
        return b"".join((end, _begun(picture.mime), picture.browser_part))


def _begun(mime: str) -> bytes:
    return _BOUNDARY_LINE + f"Content-Type: {mime}\r\n\r\n".encode()


def _whole(picture: Picture) -> bytes:
    seconds, nanoseconds = divmod(picture.header.stamp_ns, 10**9)
    head = (
        f"Content-Type: {picture.mime}\r\nContent-Length: {len(picture.payload)}\r\n"
        f"X-Timestamp: {seconds}.{nanoseconds:09d}\r\n"
        f"X-Epoch: {picture.header.epoch}\r\nX-Seq: {picture.header.seq}\r\n"
    )
    if picture.ended_ns is not None:
        head += f"X-Ended-Ns: {picture.ended_ns}\r\n"
    return b"".join((head.encode(), b"\r\n", picture.payload, b"\r\n", _BOUNDARY_LINE))
