"""Pictures that are none: refused, with a reason, before they cost anything."""

from __future__ import annotations

import struct
import tracemalloc
import zlib

import cv2
import numpy as np
import pytest

from tests.support.pictures.encoded import SCENE, forged_size, png_of, progressive
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, pixel_formats

JPEG = codecs.encode_jpeg(SCENE, "bgr8", 80)
PNG = codecs.encode_png(SCENE)


def decoded(picture: bytes) -> np.ndarray:
    codecs.picture_size(picture)
    if picture.startswith(codecs.PNG_START):
        return codecs.decode_png(picture)
    return codecs.decode_jpeg(picture, "bgr8")


def jpeg_claiming(width: int, height: int) -> bytes:
    return forged_size(JPEG, width, height)


def png_claiming(width: int, height: int) -> bytes:
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return png_of((b"IHDR", head), (b"IDAT", zlib.compress(b"")), (b"IEND", b""))


NO_PICTURES = {
    "no bytes": (b"", "empty"),
    "text": (b"hello", "not_an_image"),
    "GIF": (b"GIF89a" + bytes(100), "not_an_image"),
    "BMP": (b"BM" + bytes(100), "not_an_image"),
    "PNG start": (codecs.PNG_START, "not_an_image"),
    "PNG cut in IHDR": (PNG[:24], "not_an_image"),
    "JPEG start": (codecs.JPEG_START, "corrupt"),
    "JPEG cut before its size": (JPEG[: JPEG.index(b"\xff\xc0")], "corrupt"),
    "32 MiB of zeros": (bytes(codecs.MAX_COMPRESSED_BYTES + 1), "too_large"),
    "a JPEG and 32 MiB": (JPEG + bytes(codecs.MAX_COMPRESSED_BYTES), "too_large"),
    "no width": (png_claiming(0, 4), "too_large"),
    "no height": (png_claiming(4, 0), "too_large"),
}


@pytest.mark.parametrize(("picture", "reason"), NO_PICTURES.values(), ids=NO_PICTURES)
def test_what_is_no_picture_is_refused_by_its_first_bytes(picture: bytes, reason: str):
    with pytest.raises(PayloadError) as caught:
        codecs.picture_size(picture)
    assert caught.value.reason == reason


@pytest.mark.parametrize("claiming", [jpeg_claiming, png_claiming])
@pytest.mark.parametrize(
    ("width", "height", "fits"),
    [
        (7680, 4320, True),  # 8K: 33,177,600 pixels, the limit
        (4320, 7680, True),
        (7681, 4320, False),
        (7680, 4321, False),
        (65500, 506, True),  # 33,143,000
        (65500, 507, False),  # 33,208,500
        (32767, 32767, False),
    ],
)
def test_the_size_in_the_header_is_held_to_8k(claiming, width: int, height: int, fits: bool):
    picture = claiming(width, height)
    if fits:
        assert codecs.picture_size(picture) == (width, height)
        return
    with pytest.raises(PayloadError, match=f"{width}x{height}") as caught:
        codecs.picture_size(picture)
    assert caught.value.reason == "too_large"


@pytest.mark.parametrize("claiming", [jpeg_claiming, png_claiming])
def test_a_forged_size_is_refused_without_decoding_or_memory(
    claiming, monkeypatch: pytest.MonkeyPatch
):
    def never(*_arguments: object, **_options: object) -> None:
        raise AssertionError("decoded")

    monkeypatch.setattr(codecs.simplejpeg, "decode_jpeg", never)
    monkeypatch.setattr(cv2, "imdecode", never)
    forged = claiming(32767, 32767)
    tracemalloc.start()  # numpy reports its arrays to it
    try:
        with pytest.raises(PayloadError):
            decoded(forged)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 100_000


@pytest.mark.parametrize(
    ("width", "height", "most"),
    [(64, 48, 100), (1920, 1080, 100), (3840, 2160, 64), (7680, 4320, 16)],  # 16 times 8K in all
)
def test_scans_of_a_jpeg_are_limited_before_it_is_decoded(
    width: int, height: int, most: int, monkeypatch: pytest.MonkeyPatch
):
    def never(*_arguments: object, **_options: object) -> None:
        raise AssertionError("decoded")

    assert codecs.picture_size(progressive(most, width, height)) == (width, height)
    monkeypatch.setattr(codecs.simplejpeg, "decode_jpeg", never)
    bomb = progressive(most + 1, width, height)
    for refusing in (codecs.picture_size, lambda jpeg: codecs.decode_jpeg(jpeg, "mono8")):
        with pytest.raises(PayloadError, match=f"over {most} scans") as caught:
            refusing(bomb)
        assert caught.value.reason == "too_large"


def test_a_progressive_jpeg_of_as_many_scans_as_allowed_is_decoded():
    assert (codecs.decode_jpeg(progressive(100), "mono8") == 90).all()


def test_scans_are_counted_whatever_stands_between_them():
    comment = b"\xff\xfe\0\x04\xff\xda"  # holds what looks like a scan
    for between in (b"\0junk\xff\0", b"\xff\xff\xff", b"\xff\xd0\xff\x01", comment):
        for scans, fits in ((100, True), (101, False)):
            jpeg = progressive(scans).replace(b"\xff\xda", between + b"\xff\xda")
            try:
                codecs.check_scans(jpeg)
                assert fits
            except PayloadError:
                assert not fits


def test_coded_data_of_the_usual_single_scan_is_not_searched(monkeypatch: pytest.MonkeyPatch):
    ends = []
    real = codecs._MARKER.search

    class Watched:
        def search(self, jpeg: bytes, position: int):
            found = real(jpeg, position)
            ends.append(found.end())
            return found

    monkeypatch.setattr(codecs, "_MARKER", Watched())
    codecs.check_scans(JPEG)
    assert max(ends) == JPEG.index(b"\xff\xda") + 2


@pytest.mark.parametrize("encoding", ["mono8", "mono16", "rgba8"])
def test_raw_pixels_over_8k_are_refused_by_their_header(encoding: str):
    assert pixel_formats.raw_size(encoding, 7680, 4320)
    with pytest.raises(PayloadError) as caught:
        pixel_formats.raw_size(encoding, 7680, 4321)
    assert caught.value.reason == "too_large"


@pytest.mark.parametrize("picture", [JPEG, PNG], ids=["JPEG", "PNG"])
def test_a_picture_cut_off_at_any_byte_is_refused(picture: bytes):
    for length in range(len(picture)):
        with pytest.raises(PayloadError):
            decoded(picture[:length])


def test_every_flipped_bit_of_a_png_is_noticed():
    noticed = 0
    for at in range(len(codecs.PNG_START), len(PNG)):
        flipped = bytearray(PNG)
        flipped[at] ^= 1 << at % 8
        with pytest.raises(PayloadError):
            decoded(bytes(flipped))
        noticed += 1
    assert noticed == len(PNG) - 8


def test_flipped_bits_of_a_jpeg_are_refused_where_opencv_says_nothing(
    capfd: pytest.CaptureFixture[str],
):
    """Most single flips leave a valid JPEG of another picture, which nobody can tell. But what
    libjpeg warns of is refused here, while OpenCV returns the wrong picture."""
    start = JPEG.index(b"\xff\xda") + 14  # the entropy-coded data behind the scan header
    refused_here_only = 0
    for at in range(start, len(JPEG) - 2):
        flipped = bytearray(JPEG)
        flipped[at] ^= 1 << at % 8
        capfd.readouterr()
        second = cv2.imdecode(np.frombuffer(flipped, np.uint8), cv2.IMREAD_COLOR)
        warned = "Corrupt JPEG data" in capfd.readouterr().err
        try:
            pixels = decoded(bytes(flipped))
        except PayloadError:
            refused_here_only += second is not None
        else:
            assert not warned
            assert np.array_equal(pixels, second)
    assert refused_here_only > 50


def test_an_animated_png_is_refused():
    """OpenCV 5.0 dies of malformed ones (SIGSEGV), so that even a sound one is not tried."""
    head = struct.pack(">IIBBBBB", 8, 4, 8, 0, 0, 0, 0)
    control = struct.pack(">IIIIIHHBB", 0, 8, 4, 0, 0, 1, 10, 0, 0)
    rows = zlib.compress(bytes(9 * 4))
    still = png_of((b"IHDR", head), (b"IDAT", rows), (b"IEND", b""))
    assert decoded(still).shape == (4, 8)
    for kind, content in ((b"acTL", struct.pack(">II", 1, 0)), (b"fcTL", control)):
        animated = png_of((b"IHDR", head), (kind, content), (b"IDAT", rows), (b"IEND", b""))
        with pytest.raises(PayloadError, match="animated") as caught:
            decoded(animated)
        assert caught.value.reason == "corrupt"


@pytest.mark.parametrize(
    ("name", "picture"),
    [
        ("too many pixels for OpenCV", png_claiming(100_000, 100_000)),
        ("no pixels", png_claiming(8, 8)),
        ("no IEND", PNG[:-12]),
        ("a length beyond the end", PNG[:8] + b"\xff\xff\xff\xff" + PNG[12:]),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_png_that_cannot_be_decoded_is_corrupt(name: str, picture: bytes):
    with pytest.raises(PayloadError) as caught:
        codecs.decode_png(picture)
    assert caught.value.reason == "corrupt"
