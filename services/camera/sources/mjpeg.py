"""Packets of MJPEG sources: whether each is one whole JPEG, trimmed and with its Huffman tables.

Cameras send JPEGs that are nearly files. Some leave out the Huffman tables, because the ones
of ITU-T T.81 Annex K.3 are meant; some pad the packet; a hiccup on the bus cuts one short.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

START_OF_IMAGE: Final = b"\xff\xd8"
END_OF_IMAGE: Final = b"\xff\xd9"
DHT: Final = 0xC4
SOS: Final = 0xDA
APP0: Final = 0xE0
BASELINE: Final = (0xC0, 0xC1)
PROGRESSIVE: Final = 0xC2
FRAME_HEADERS: Final = frozenset(range(0xC0, 0xD0)) - {DHT, 0xC8, 0xCC}
STANDALONE: Final = frozenset({0x01, *range(0xD0, 0xDA)})
"""Markers without a length: none of them may stand in a header."""

_DC_VALUES = bytes(range(12)).hex()
# Class and number of the table, how many codes there are of 1 to 16 bits, and their symbols.
_TABLES = (
    f"00 00010501010101010100000000000000 {_DC_VALUES}",
    "10 0002010303020403050504040000017d"
    "01020300041105122131410613516107227114328191a1082342b1c11552d1f0"
    "2433627282090a161718191a25262728292a3435363738393a43444546474849"
    "4a535455565758595a636465666768696a737475767778797a83848586878889"
    "8a92939495969798999aa2a3a4a5a6a7a8a9aab2b3b4b5b6b7b8b9bac2c3c4c5"
    "c6c7c8c9cad2d3d4d5d6d7d8d9dae1e2e3e4e5e6e7e8e9eaf1f2f3f4f5f6f7f8f9fa",
    f"01 00030101010101010101010000000000 {_DC_VALUES}",
    "11 00020102040403040705040400010277"
    "000102031104052131061241510761711322328108144291a1b1c109233352f0"
    "156272d10a162434e125f11718191a262728292a35363738393a434445464748"
    "494a535455565758595a636465666768696a737475767778797a828384858687"
    "88898a92939495969798999aa2a3a4a5a6a7a8a9aab2b3b4b5b6b7b8b9bac2c3"
    "c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae2e3e4e5e6e7e8e9eaf2f3f4f5f6f7f8f9fa",
)
_TABLE_BYTES = bytes.fromhex("".join(_TABLES))
STANDARD_HUFFMAN_TABLES: Final = (
    b"\xff\xc4" + (2 + len(_TABLE_BYTES)).to_bytes(2, "big") + _TABLE_BYTES
)
"""The DHT segment of T.81 tables K.3 to K.6: DC and AC, luminance and chrominance."""


class DamagedJpeg(ValueError):
    """A packet that is not a whole JPEG; the text says what is wrong."""


@dataclass(frozen=True, slots=True)
class Jpeg:
    """A whole JPEG that every reader takes.

    Attributes:
        data: From its first marker to its last, nothing around them.
        width: Pixels, from its header.
        height: Pixels.
        encoding: What it decodes to: ``mono8`` or ``bgr8``.
    """

    data: bytes
    width: int
    height: int
    encoding: Literal["mono8", "bgr8"]


@dataclass(frozen=True, slots=True)
class _Header:
    """What stands before the entropy-coded data; offsets into the packet, in bytes."""

    frame_marker: int
    precision: int
    width: int
    height: int
    components: int
    interlaced: bool
    has_huffman_tables: bool
    scan_offset: int
    data_offset: int


def whole_jpeg(packet: bytes) -> Jpeg | None:
    """Return the JPEG in a packet, trimmed and made complete.

    Args:
        packet: As the source sent it; anything before the JPEG and after it is left out.

    Returns:
        The JPEG; None if it is whole, but of a kind that many readers refuse: two fields
        instead of one picture, lossless, arithmetic, 12 bits, CMYK.

    Raises:
        DamagedJpeg: The packet holds no JPEG, or only a part of one.
    """
    start = packet.find(START_OF_IMAGE + b"\xff")
    if start < 0:
        raise DamagedJpeg("no JPEG")
    header = _read_header(packet, start + 2)
    end = _end(packet, header)
    common = header.frame_marker in (*BASELINE, PROGRESSIVE) and header.precision == 8
    if not common or header.interlaced or header.components not in (1, 3) or not header.height:
        return None
    if header.has_huffman_tables:
        data = packet if (start, end) == (0, len(packet)) else packet[start:end]
    elif header.frame_marker in BASELINE:
        scan = header.scan_offset
        data = packet[start:scan] + STANDARD_HUFFMAN_TABLES + packet[scan:end]
    else:
        raise DamagedJpeg("a progressive JPEG without Huffman tables")
    encoding: Literal["mono8", "bgr8"] = "mono8" if header.components == 1 else "bgr8"
    return Jpeg(data, header.width, header.height, encoding)


def _read_header(packet: bytes, offset: int) -> _Header:
    frame: tuple[int, bytes] | None = None
    interlaced = has_huffman_tables = False
    while True:
        marker, body_offset, end = _segment(packet, offset)
        body = packet[body_offset:end]
        if marker == DHT:
            has_huffman_tables = True
        elif marker == APP0 and body.startswith(b"AVI1"):
            interlaced = len(body) > 4 and body[4] != 0
        elif marker in FRAME_HEADERS:
            if len(body) < 6:
                raise DamagedJpeg("a frame header that is too short")
            frame = marker, body
        elif marker == SOS:
            break
        offset = end
    if frame is None:
        raise DamagedJpeg("no frame header")
    marker, body = frame
    return _Header(
        frame_marker=marker,
        precision=body[0],
        height=int.from_bytes(body[1:3], "big"),
        width=int.from_bytes(body[3:5], "big"),
        components=body[5],
        interlaced=interlaced,
        has_huffman_tables=has_huffman_tables,
        scan_offset=offset,
        data_offset=end,
    )


def _segment(packet: bytes, offset: int) -> tuple[int, int, int]:
    """Return a segment's marker, and where its body begins and ends."""
    first = offset
    while packet[offset : offset + 1] == b"\xff":  # any number of fill bytes is allowed
        offset += 1
    marker = packet[offset] if first < offset < len(packet) else 0
    if marker == 0 or marker in STANDALONE:
        raise DamagedJpeg(f"no marker at byte {first}")
    end = offset + 1 + int.from_bytes(packet[offset + 1 : offset + 3], "big")
    if end < offset + 3 or end > len(packet):
        raise DamagedJpeg("cut short in its header")
    return marker, offset + 3, end


def _end(packet: bytes, header: _Header) -> int:
    """Return the offset after the end marker."""
    # Coded data never holds this pair; tables between the scans could, in theory only.
    end = packet.find(END_OF_IMAGE, header.data_offset)
    if end < 0:
        raise DamagedJpeg("cut short: it has no end")
    return end + len(END_OF_IMAGE)
