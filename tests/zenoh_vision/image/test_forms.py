"""Each form of a picture: there and back, what it checks, and how it is found."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.headers import header
from tests.support.pictures.encoded import noise
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, forms, pixel_formats
from zenoh_vision.image.picture import PixelPicture
from zenoh_vision.keys import BITS, JPEG, PNG, RAW_IMAGE
from zenoh_vision.stream.frame_intake import snapshot_of
from zenoh_vision.stream.sample import Sample

PIXELS = np.arange(64 * 48 * 3, dtype=np.uint32).reshape(48, 64, 3).astype(np.uint8)
BILEVEL = (np.random.default_rng(1).random((48, 64)) < 0.5) * np.uint8(255)
JPEG_BYTES = codecs.encode_jpeg(PIXELS, "bgr8", 90)
PNG_BYTES = codecs.encode_png(PIXELS)


@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [
        *((RAW_IMAGE, pixels) for pixels in pixel_formats.ENCODINGS),
        *((PNG, pixels) for pixels in ("bgr8", "rgb8", "mono8", "mono16", "bgra8")),
    ],
)
def test_a_lossless_form_gives_back_the_pixels(encoding: str, pixels: str):
    array = noise(pixels, 31, 17)
    form, about = forms.FORMS[encoding], header(encoding=pixels, width=31, height=17)
    payload = form.make(PixelPicture(array, pixels), 80)
    form.check(payload, about)
    back = forms.opened(form, payload, about).pixels
    assert back.dtype == array.dtype
    assert np.array_equal(back, array)


def test_a_jpeg_is_like_the_pixels_that_it_was_made_of():
    smooth = np.full((48, 64, 3), (200, 100, 50), np.uint8)
    payload = forms.JPEG_FORM.make(PixelPicture(smooth), 90)
    shown = forms.opened(forms.JPEG_FORM, payload, header()).pixels
    assert np.abs(shown.astype(int) - smooth).max() <= 3


def test_depth_in_metres_goes_as_millimetres_in_a_file_and_as_metres_in_rows():
    metres = header(encoding="32FC1")
    assert forms.PNG_FORM.header(metres).encoding == "16UC1"
    assert forms.RAW_FORM.header(metres).encoding == "32FC1"
    pixels = PixelPicture(np.full((48, 64), 1.25, np.float32), "32FC1")
    shown = forms.opened(forms.PNG_FORM, forms.PNG_FORM.make(pixels, 80), metres)
    assert shown.depth is not None
    assert set(np.unique(shown.depth)) == {1250}


def test_the_leftmost_pixel_is_the_highest_bit_and_each_row_begins_with_a_byte():
    picture = np.zeros((2, 10), np.uint8)
    picture[0, 0] = picture[0, 7] = picture[0, 8] = 255
    picture[1, 9] = 1
    assert forms.pack_bits(picture) == bytes([0b10000001, 0b10000000, 0b00000000, 0b01000000])


@pytest.mark.parametrize("shape", [(1, 1), (1, 8), (3, 9), (50, 641)], ids=str)
def test_bits_become_0_and_255_whatever_the_header_says(shape: tuple[int, int]):
    picture = (np.random.default_rng(1).random(shape) < 0.5) * np.uint8(255)
    about = header(width=shape[1], height=shape[0], encoding="bgr8")
    payload = forms.BITS_FORM.make(PixelPicture(picture), 80)
    forms.BITS_FORM.check(payload, about)
    frame = forms.opened(forms.BITS_FORM, memoryview(payload), about)
    assert frame.header.encoding == "mono8"
    assert np.array_equal(frame.pixels, picture)
    assert frame.picture.mime == PNG  # of one bit, if it must be a file


@pytest.mark.parametrize("change", [-1, 1])
def test_a_number_of_packed_bits_that_does_not_fit_the_header_is_refused(change: int):
    form = forms.BITS_FORM
    payload = form.make(PixelPicture(BILEVEL, bilevel=True), 80)
    cut = payload[:change] if change < 0 else payload + b"\0"
    with pytest.raises(PayloadError) as caught:
        form.check(cut, header(encoding="mono8"))
    assert caught.value.reason == "wrong_size"


@pytest.mark.parametrize(
    ("encoding", "payload", "default", "expected"),
    [
        (JPEG, JPEG_BYTES, JPEG, JPEG),
        (JPEG, PNG_BYTES, JPEG, PNG),
        (PNG, JPEG_BYTES, PNG, JPEG),
        ("", PNG_BYTES, JPEG, PNG),
        ("zenoh/bytes", JPEG_BYTES, PNG, JPEG),
        (RAW_IMAGE, JPEG_BYTES, JPEG, RAW_IMAGE),
        ("", JPEG_BYTES, RAW_IMAGE, RAW_IMAGE),
        (BITS, b"\0", PNG, BITS),
        ("", b"no picture", JPEG, JPEG),
    ],
)
def test_the_form_is_that_of_the_encoding_except_that_files_show_theirs(
    encoding: str, payload: bytes, default: str, expected: str
):
    assert forms.form_of(encoding, payload, default).encoding == expected


def test_a_form_is_found_by_its_name_and_an_unknown_name_lists_all():
    assert forms.form_named("bits") is forms.BITS_FORM
    with pytest.raises(ValueError, match="'webp'; known are jpeg, png, raw, bits"):
        forms.form_named("webp")


def test_limits_hold_before_anything_is_decoded():
    for wide, high, most, words in (
        (100, 100, 9_999, "in all"),
        (65_535, 1, 10**9, "a side at most"),
    ):
        about = header(width=wide, height=high, encoding="mono8").to_bytes()
        big = Sample("vision/front/image", bytes(wide * high), RAW_IMAGE, about)
        with pytest.raises(PayloadError, match=words) as caught:
            snapshot_of(big, max_pixels=most)
        assert caught.value.reason == "too_large"
    assert forms.RAW_FORM.most_bytes(100) == 400
    assert forms.PNG_FORM.most_bytes(100) == codecs.MAX_COMPRESSED_BYTES
