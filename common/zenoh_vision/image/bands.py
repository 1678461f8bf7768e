"""JPEGs in bands of rows, which several processors encode and decode at once.

A restart marker ends each band, after which the coded data depends on nothing before it
(ITU-T T.81, E.1.4 and E.2.4), so any decoder reads such a JPEG. Its pixels are those of the same
picture in one piece, except that decoders which smooth chroma do so across the border of two bands
only if they decode it in one piece. Here a large JPEG in bands is always decoded band by band,
unless at a reduced scale, so its pixels do not depend on the machine.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Final

from zenoh_vision.host.parallel import workers
from zenoh_vision.image.limits import MAX_PIXELS, MAX_SIDE

BAND_PIXELS = 400_000
"""A picture with more pixels is encoded in two bands, or in one for each so many pixels. Two bands
of 768x576 take three quarters of the time of one piece (0.3 ms less), for a quarter more CPU time;
capture to pixels then takes a tenth less time. Bands are decoded by several threads if there is at
least so much for each of two: of 768x576, that takes no less time."""

MAX_BANDS: Final = 8
"""The numbers of restart markers are repeated after so many."""

MAX_INTERVAL: Final = 2**16 - 1
"""Most MCUs of a band, as a JPEG states their number."""

MAX_HEAD_BYTES: Final = 1 << 16
"""Each band gets a copy of the segments before the coded data, usually less than 1 kB."""

_HUFFMAN_TABLES, _START_OF_SCAN, _RESTART_INTERVAL = 0xC4, 0xDA, 0xDD
_BASELINE: Final = (0xC0, 0xC1)
_RESTARTS: Final = tuple(bytes((0xFF, 0xD0 + number)) for number in range(8))
_END_OF_IMAGE: Final = b"\xff\xd9"


@dataclass(frozen=True, slots=True)
class Head:
    """The segments of a JPEG up to its coded data, by their offsets in the file.

    Attributes:
        size: Where the frame header has height and width, 16 bits each.
        scan: The marker of the scan header.
        end: Where the coded data begins.
        mcu: Width and height of an MCU, pixels.
        interval: Number of MCUs between restart markers; 0 without them.
    """

    size: int
    scan: int
    end: int
    mcu: tuple[int, int]
    interval: int


@dataclass(frozen=True, slots=True)
class Layout:
    """How a JPEG is divided: its size, and the height of its bands, of which the last may be lower.

    Its head is the segments up to the coded data; ``rows`` is the height of a band.
    """

    head: Head
    width: int
    height: int
    rows: int


def encode(width: int, height: int, encode_rows: Callable[[slice], bytes], mcu: int) -> bytes:
    """Return a picture as a JPEG, in as many bands as there are threads, if it is large enough.

    Args:
        width: Of the picture.
        height: Of the picture.
        encode_rows: Returns some of the rows as a baseline JPEG with one scan; called by several
            threads.
        mcu: Side of an MCU: 16 pixels with chroma of half width and height, 8 without chroma.
    """
    rows = _band_rows(width, height, mcu)
    if rows >= height:
        return encode_rows(slice(0, height))
    tops = range(0, height, rows)
    jpegs = workers.run([partial(encode_rows, slice(top, top + rows)) for top in tops])
    first, head = jpegs[0], _head(jpegs[0])
    assert head is not None
    interval = -(-width // mcu) * (rows // mcu)
    pieces: list[bytes | memoryview] = [
        first[: head.size],
        height.to_bytes(2),
        first[head.size + 2 : head.scan],
        bytes((0xFF, _RESTART_INTERVAL, 0, 4)) + interval.to_bytes(2),
        first[head.scan : head.end],
    ]
    for number, jpeg in enumerate(jpegs):
        pieces.append(memoryview(jpeg)[head.end : -len(_END_OF_IMAGE)])
        pieces.append(_RESTARTS[number] if number + 1 < len(jpegs) else _END_OF_IMAGE)
    return b"".join(pieces)


def layout(jpeg: bytes) -> Layout | None:
    """Return how a large JPEG is divided into bands; None if it is not.

    Restart markers may also divide it into other parts, or into more of them than are worth it.
    """
    head = _head(jpeg)
    if head is None or not head.interval:
        return None
    height, width = struct.unpack_from(">HH", jpeg, head.size)
    if not 2 * BAND_PIXELS <= width * height <= MAX_PIXELS:
        return None
    lines, rest = divmod(head.interval, -(-width // head.mcu[0]))
    rows = lines * head.mcu[1]
    if rest or not 1 < -(-height // rows) <= MAX_BANDS:
        return None
    return Layout(head, width, height, rows)


def decode(jpeg: bytes, found: Layout, decode_rows: Callable[[bytes, slice], object]) -> bool:
    """Decode a JPEG in its bands.

    Several threads call ``decode_rows``, which decodes a JPEG of some of the rows.

    Returns:
        False if its bands are not complete, so that nothing was decoded.
    """
    head, data = found.head, memoryview(jpeg)
    tops = range(0, found.height, found.rows)
    starts = [head.end]
    for number in range(len(tops) - 1):
        at = jpeg.find(_RESTARTS[number], starts[-1])
        if at < 0:
            return False
        starts.append(at + 2)
    ends = [*(start - 2 for start in starts[1:]), len(jpeg)]

    def decode_band(top: int, start: int, end: int) -> None:
        bottom = min(top + found.rows, found.height)
        band = (
            data[: head.size],
            (bottom - top).to_bytes(2),
            data[head.size + 2 : head.end],
            data[start:end],
            _END_OF_IMAGE if bottom < found.height else b"",
        )
        decode_rows(b"".join(band), slice(top, bottom))

    workers.run([partial(decode_band, *each) for each in zip(tops, starts, ends, strict=True)])
    return True


def _band_rows(width: int, height: int, mcu: int) -> int:
    """Return the height of a picture's bands; its own height if it is not divided."""
    count = min(workers.threads, max(2, width * height // BAND_PIXELS), MAX_BANDS)
    is_small = width * height <= BAND_PIXELS
    if count < 2 or is_small or height > MAX_SIDE:  # which the encoder refuses
        return height
    most = MAX_INTERVAL // -(-width // mcu)
    lines = min(most, -(-height // (count * mcu)))
    return lines * mcu if -(-height // (lines * mcu)) <= MAX_BANDS else height


def _head(jpeg: bytes) -> Head | None:
    """Return the segments of a baseline JPEG with one scan up to that; None if it is another."""
    at, size, interval, mcu = 2, 0, 0, (8, 8)
    components = 0
    while at + 4 <= len(jpeg) and jpeg[at] == 0xFF:
        body = at + 4
        marker, end = jpeg[at + 1], at + 2 + int.from_bytes(jpeg[at + 2 : body])
        if end > min(len(jpeg), MAX_HEAD_BYTES):
            return None
        if marker == _START_OF_SCAN:
            whole = components and all(mcu) and jpeg[body:end][:1] == bytes([components])
            return Head(size, at, end, mcu, interval) if whole else None
        if marker == _RESTART_INTERVAL and end == body + 2:
            interval = int.from_bytes(jpeg[body:end])
        elif marker in _BASELINE and end > body + 6 and not components:
            size, components = body + 1, jpeg[body + 5]
            factors = jpeg[body + 7 : end : 3]
            if components not in (1, 3) or end != body + 6 + 3 * components:
                return None
            if components == 3:  # else an MCU is one block, whatever the factors are
                one, two, three = factors
                mcu = 8 * (max(factors) >> 4), 8 * max(one & 15, two & 15, three & 15)
        elif not (marker == _HUFFMAN_TABLES or 0xDB <= marker <= 0xFE):
            return None
        at = end
    return None
