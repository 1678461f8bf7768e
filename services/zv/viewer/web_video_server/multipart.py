"""Formats pictures as parts of a multipart/x-mixed-replace response, for programs and browsers.

A browser's ``<img>`` shows a part when it is complete. Firefox detects that by the boundary after
the part, Chromium only by the header of the next part. So browsers get both directly after each
picture. If the header were sent with the next picture, as is usual, Chromium would show every
picture one frame late and the last one never. A header that is sent this early cannot describe
the picture that follows it, which ``<img>`` does not need. Programs get a complete header with
each picture.
"""

from __future__ import annotations

from collections.abc import Mapping

from zv.viewer.streams.rendering import EncodedPicture

BOUNDARY = "zenoh-vision-picture"
_BOUNDARY_LINE = f"--{BOUNDARY}\r\n".encode()


class ProgramParts:
    """Makes parts whose header has the picture's identity, capture time and length."""

    begin = _BOUNDARY_LINE

    def part(self, picture: EncodedPicture) -> bytes:
        """Return header, picture and boundary, made once for all programs."""
        return picture.once("program", _program_part)


class BrowserParts:
    """Makes parts that also begin the next part."""

    begin = b""  # the type of the first picture is not known yet

    def __init__(self) -> None:
        self._begun_as = ""

    def part(self, picture: EncodedPicture) -> bytes:
        """Return the picture and the beginning of the next part, made once for all browsers."""
        part = picture.once("browser", _browser_part)
        if picture.mime == self._begun_as:
            return part
        # The camera has changed between JPEG and PNG: the part that was begun stays empty.
        end = b"\r\n" if self._begun_as else b""
        self._begun_as = picture.mime
        return b"".join((end, _beginning(picture.mime), part))


def parts_for(headers: Mapping[str, str]) -> ProgramParts | BrowserParts:
    """Return the parts for the client of a request: only browsers accept images explicitly."""
    return BrowserParts() if "image/" in headers.get("Accept", "") else ProgramParts()


def _beginning(mime: str) -> bytes:
    return _BOUNDARY_LINE + f"Content-Type: {mime}\r\n\r\n".encode()


def _browser_part(picture: EncodedPicture) -> bytes:
    return b"".join((picture.payload, b"\r\n", _beginning(picture.mime)))


def _program_part(picture: EncodedPicture) -> bytes:
    seconds, nanoseconds = divmod(picture.header.stamp_ns, 10**9)
    header = (
        f"Content-Type: {picture.mime}\r\nContent-Length: {len(picture.payload)}\r\n"
        f"X-Timestamp: {seconds}.{nanoseconds:09d}\r\n"
        f"X-Epoch: {picture.header.epoch}\r\nX-Seq: {picture.header.seq}\r\n"
    )
    if picture.ended_ns is not None:
        header += f"X-Ended-Ns: {picture.ended_ns}\r\n"
    return b"".join((header.encode(), b"\r\n", picture.payload, b"\r\n", _BOUNDARY_LINE))
