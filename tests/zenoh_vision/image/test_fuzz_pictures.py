"""Whatever bytes come in, a picture is decoded or refused with a PayloadError, nothing else."""

from __future__ import annotations

import struct
import zlib
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.headers import header
from tests.support.library import Changes, changed, changes, fuzz, tried
from tests.support.pictures.encoded import chunks_of, png_of
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.forms import RAW_FORM

NOISE = np.random.default_rng(7).integers(0, 256, (48, 64, 3), np.uint8)
PICTURES = {
    "colour JPEG": codecs.encode_jpeg(NOISE, "bgr8", 80),
    "grey JPEG": codecs.encode_jpeg(NOISE[:, :, 0], "mono8", 80),
    "PNG": codecs.encode_png(NOISE),
    "16-bit PNG": codecs.encode_png(NOISE[:, :, 0].astype(np.uint16) * 257),
    "bilevel PNG": codecs.encode_png((NOISE[:, :, 0] & 128) // 128 * 255, bilevel=True),
}
REASONS = {"empty", "too_large", "not_an_image", "corrupt"}


def look_and_decode(picture: bytes) -> None:
    """Do what a receiver does: the size first, then the pixels, which have that size."""
    width, height = codecs.picture_size(picture)
    if picture.startswith(codecs.PNG_START):
        pixels: pixel_formats.Pixels = codecs.decode_png(picture)
    else:
        pixels = codecs.decode_jpeg(picture, "bgr8")
    assert pixels.shape[:2] == (height, width)


@fuzz
@given(st.sampled_from([b"", codecs.JPEG_START, codecs.PNG_START]), st.binary(max_size=64))
def test_pictures_of_arbitrary_bytes(start: bytes, rest: bytes):
    tried(codecs.picture_size, start + rest, REASONS)
    tried(codecs.decode_png, start + rest, {"corrupt"})
    tried(lambda jpeg: codecs.decode_jpeg(jpeg, "mono8"), start + rest, {"corrupt"})


@pytest.mark.parametrize("name", PICTURES)
@fuzz
@given(changes)
def test_pictures_with_changed_bytes(name: str, how: Changes):
    tried(look_and_decode, changed(PICTURES[name], how), REASONS)


ANIMATED = [
    (b"IHDR", struct.pack(">IIBBBBB", 8, 4, 8, 0, 0, 0, 0)),
    (b"acTL", struct.pack(">II", 2, 0)),
    (b"fcTL", struct.pack(">IIIIIHHBB", 0, 8, 4, 0, 0, 1, 10, 0, 0)),
    (b"IDAT", zlib.compress(bytes(9 * 4))),
    (b"fcTL", struct.pack(">IIIIIHHBB", 1, 8, 4, 0, 0, 1, 10, 0, 0)),
    (b"fdAT", struct.pack(">I", 2) + zlib.compress(bytes(9 * 4))),
    (b"IEND", b""),
]
KINDS = [b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND", b"acTL", b"fcTL", b"fdAT", b"eXIf", b"iCCP"]


@pytest.mark.parametrize("name", ["PNG", "16-bit PNG", "bilevel PNG", "animated PNG"])
@fuzz
@given(
    st.lists(
        st.tuples(st.floats(0, 0.999), changes, st.none() | st.sampled_from(KINDS)), max_size=3
    )
)
def test_pngs_with_changed_chunks_and_right_checksums(
    name: str, how: list[tuple[float, Changes, bytes | None]]
):
    parts = list(ANIMATED) if name == "animated PNG" else chunks_of(PICTURES[name])
    for share, bytes_how, added in how:
        at = int(share * len(parts))
        kind, content = parts[at]
        content = changed(content, bytes_how)
        parts[at : at + (added is None)] = [(added or kind, content)]
    tried(look_and_decode, png_of(*parts), REASONS)


@fuzz
@given(
    st.binary(max_size=200),
    st.sampled_from([*pixel_formats.ENCODINGS, "", "jpeg", "bayer_rggb8"]),
    st.integers(1, 65535),
    st.integers(1, 65535),
)
def test_raw_pixels_of_arbitrary_size(raw: bytes, encoding: str, width: int, height: int):
    reasons = {"wrong_size", "too_large", "unsupported_encoding"}
    for wide, high in ((width, height), (width % 8 + 1, height % 8 + 1)):
        about = header(encoding=encoding, width=wide, height=high)
        tried(partial(RAW_FORM.open, header=about, size=None), raw, reasons)
