"""A packet of an MJPEG source is one whole JPEG with its tables, or is refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.support.pictures.http_camera import without_huffman_tables
from tests.support.pictures.videos import decoded, jpeg_of, noise
from zv.camera.sources.mjpeg import STANDARD_HUFFMAN_TABLES, DamagedJpeg, whole_jpeg

COLOUR = jpeg_of(noise(48, 64, 3))
GREY = jpeg_of(noise(48, 64))


def test_a_sound_jpeg_is_handed_over_as_the_same_object():
    jpeg = whole_jpeg(COLOUR)
    assert jpeg is not None
    assert jpeg.data is COLOUR
    assert (jpeg.width, jpeg.height, jpeg.encoding) == (64, 48, "bgr8")


def test_a_grey_jpeg_is_mono8():
    jpeg = whole_jpeg(GREY)
    assert jpeg is not None
    assert (jpeg.width, jpeg.height, jpeg.encoding) == (64, 48, "mono8")


@pytest.mark.parametrize(
    "packet",
    [COLOUR + bytes(1000), b"\0\0junk" + COLOUR, b"\r\n" + COLOUR + b"\r\n", COLOUR + b"\xff\xd8"],
    ids=["padded", "junk first", "line ends around", "rest of an older picture"],
)
def test_what_surrounds_the_jpeg_is_trimmed(packet: bytes):
    jpeg = whole_jpeg(packet)
    assert jpeg is not None
    assert jpeg.data == COLOUR


@pytest.mark.parametrize("original", [COLOUR, GREY], ids=["colour", "grey"])
def test_missing_huffman_tables_are_put_in_so_that_it_decodes_to_the_same_pixels(original: bytes):
    bare = without_huffman_tables(original)
    assert b"\xff\xc4" not in bare[: bare.find(b"\xff\xda")]
    jpeg = whole_jpeg(bare)
    assert jpeg is not None
    assert jpeg.data.count(STANDARD_HUFFMAN_TABLES) == 1
    assert np.array_equal(decoded(jpeg.data), decoded(original))


# ITU-T T.81 Annex K.3: number of codes of 1 to 16 bits, and their symbols.
DC_VALUES = bytes(range(12)).hex()
T81_TABLES = (
    f"00010501010101010100000000000000 {DC_VALUES}",
    "0002010303020403050504040000017d"
    "01020300041105122131410613516107227114328191a1082342b1c11552d1f0"
    "2433627282090a161718191a25262728292a3435363738393a43444546474849"
    "4a535455565758595a636465666768696a737475767778797a83848586878889"
    "8a92939495969798999aa2a3a4a5a6a7a8a9aab2b3b4b5b6b7b8b9bac2c3c4c5"
    "c6c7c8c9cad2d3d4d5d6d7d8d9dae1e2e3e4e5e6e7e8e9eaf1f2f3f4f5f6f7f8f9fa",
    f"00030101010101010101010000000000 {DC_VALUES}",
    "00020102040403040705040400010277"
    "000102031104052131061241510761711322328108144291a1b1c109233352f0"
    "156272d10a162434e125f11718191a262728292a35363738393a434445464748"
    "494a535455565758595a636465666768696a737475767778797a828384858687"
    "88898a92939495969798999aa2a3a4a5a6a7a8a9aab2b3b4b5b6b7b8b9bac2c3"
    "c4c5c6c7c8c9cad2d3d4d5d6d7d8d9dae2e3e4e5e6e7e8e9eaf2f3f4f5f6f7f8f9fa",
)


def test_the_standard_tables_are_those_of_the_standard():
    # Of each: marker, length, class and number, 16 counts, and the symbols of 12 or 162 codes.
    assert len(STANDARD_HUFFMAN_TABLES) == 4 * (4 + 17) + 2 * (12 + 162)
    for number, table in zip((0x00, 0x10, 0x01, 0x11), T81_TABLES, strict=True):
        assert bytes([number]) + bytes.fromhex(table) in STANDARD_HUFFMAN_TABLES


def test_a_progressive_jpeg_passes():
    progressive = jpeg_of(noise(48, 64, 3), cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    assert progressive != COLOUR
    jpeg = whole_jpeg(progressive)
    assert jpeg is not None
    assert jpeg.data is progressive


def test_a_packet_with_too_many_scans_is_refused():
    jpeg = jpeg_of(noise(48, 64, 3), cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
    scan = jpeg[jpeg.rindex(b"\xff\xda") : -2]
    with pytest.raises(DamagedJpeg, match="over 100 scans"):
        whole_jpeg(jpeg[:-2] + 100 * scan + jpeg[-2:])


@pytest.mark.parametrize(
    ("packet", "reason"),
    [
        (b"", "no JPEG"),
        (b"hello", "no JPEG"),
        (COLOUR[:-2], "no end"),
        (COLOUR[: len(COLOUR) // 2], "no end"),
        (COLOUR[:100], "cut short in its header"),
        (COLOUR[:2] + COLOUR[COLOUR.find(b"\xff\xda") :], "no frame header"),
        (COLOUR[:2] + b"\xff\xd9" + COLOUR[2:], "no marker"),
        (COLOUR[:2] + b"\xff\xc0\x00\x04\x08\x00" + COLOUR[2:], "too short"),
    ],
    ids=["empty", "text", "no end", "half", "header only", "no size", "ends at once", "short SOF"],
)
def test_a_damaged_packet_is_refused_and_the_reason_given(packet: bytes, reason: str):
    with pytest.raises(DamagedJpeg, match=reason):
        whole_jpeg(packet)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"\xff\xc0\x00\x11\x08", b"\xff\xc3\x00\x11\x08"),
        (b"\xff\xc0\x00\x11\x08", b"\xff\xc9\x00\x11\x08"),
        (b"\xff\xc0\x00\x11\x08", b"\xff\xc1\x00\x11\x0c"),
        (b"\xff\xc0\x00\x11\x08\x00\x30", b"\xff\xc0\x00\x11\x08\x00\x00"),
        (b"\xff\xd8\xff\xe0", b"\xff\xd8\xff\xe0\x00\x0aAVI1\x01\x00\x00\x00\xff\xe0"),
    ],
    ids=["lossless", "arithmetic", "12 bits", "height comes later", "one field of two"],
)
def test_a_jpeg_of_an_unusual_kind_is_not_passed_on(old: bytes, new: bytes):
    assert COLOUR.count(old) == 1
    assert whole_jpeg(COLOUR.replace(old, new)) is None


@given(st.binary(max_size=400), st.integers(0, len(COLOUR)), st.integers(0, len(COLOUR)))
@settings(max_examples=300, deadline=None)
def test_any_bytes_are_either_a_jpeg_or_refused(junk: bytes, start: int, end: int):
    for packet in (junk, COLOUR[:start] + junk + COLOUR[end:]):
        try:
            jpeg = whole_jpeg(packet)
        except DamagedJpeg:
            continue
        assert jpeg is None or (jpeg.data[:2], jpeg.data[-2:]) == (b"\xff\xd8", b"\xff\xd9")
