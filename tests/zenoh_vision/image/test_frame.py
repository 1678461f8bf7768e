"""A frame makes each form on demand, at most once, and never what nobody asked for."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from tests.support.pictures.encoded import SCENE
from zenoh_vision import keys
from zenoh_vision.errors import PayloadError
from zenoh_vision.image import codecs, pixel_formats
from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Header

GRAY = np.ascontiguousarray(SCENE[:, :, 1])
DEEP = GRAY.astype(np.uint16) * 256 + 77
JPEG = codecs.encode_jpeg(SCENE, "bgr8", 80)
CODECS = ("encode_jpeg", "encode_png", "decode_jpeg", "decode_png")


def header(encoding: str | None = "bgr8") -> Header:
    return Header(
        camera="front", epoch=1, seq=0, stamp_ns=0, width=64, height=48, encoding=encoding
    )


@pytest.fixture(autouse=True)
def calls(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Count what is encoded and decoded."""
    counted: Counter[str] = Counter()
    for name in CODECS:
        real = getattr(codecs, name)

        def counting(*arguments, _name=name, _real=real, **options):
            counted[_name] += 1
            return _real(*arguments, **options)

        monkeypatch.setattr(codecs, name, counting)
    return counted


def everything(frame: Frame) -> None:
    for _ in range(2):
        assert frame.pixels.shape[:2] == (48, 64)
        assert frame.bgr.shape == (48, 64, 3)
        assert frame.gray.shape == (48, 64)
        assert frame.compressed
        assert frame.raw


def test_a_frame_of_pixels_is_encoded_once(calls: Counter[str]):
    everything(Frame(header(), SCENE))
    assert calls == {"encode_jpeg": 1}


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(lambda: Frame(header(), JPEG), id="JPEG"),
        pytest.param(lambda: Frame(header(), SCENE.copy()), id="pixels"),
        pytest.param(lambda: Frame(header("rgb8"), SCENE.copy()), id="other colours"),
        pytest.param(lambda: Frame(header("16UC1"), codecs.encode_png(DEEP)), id="PNG"),
    ],
)
def test_no_form_can_be_written_to_however_the_frame_came(make: Callable[[], Frame]):
    frame = make()
    forms = [frame.pixels, frame.bgr, frame.gray, frame.depth]
    assert not any(form.flags.writeable for form in forms if form is not None)


def test_the_pixels_that_a_frame_was_made_from_stay_those_of_their_owner():
    pixels = SCENE.copy()
    Frame(header(), pixels)
    assert pixels.flags.writeable


def test_a_frame_of_16_bits_is_encoded_once_as_a_png_that_is_exact(calls: Counter[str]):
    frame = Frame(header("mono16"), DEEP)
    everything(frame)
    assert calls == {"encode_png": 1}
    assert frame.picture.mime == keys.PNG
    assert np.array_equal(cv2.imdecode(np.frombuffer(frame.compressed, np.uint8), -1), DEEP)
    received = Frame(header("mono16"), frame.compressed)
    assert received.pixels.dtype == np.uint16
    assert np.array_equal(received.pixels, DEEP)


def test_a_jpeg_passes_through_untouched_and_undecoded(calls: Counter[str]):
    frame = Frame(header(), JPEG)
    assert frame.compressed is JPEG
    assert frame.picture.mime == keys.JPEG
    assert not calls


@pytest.mark.parametrize(
    ("encoding", "decodings"),
    [("bgr8", 2), ("mono8", 2), ("rgb8", 1), ("mono16", 1)],
    ids=["bgr8", "mono8", "rgb8", "mono16"],
)
def test_each_form_of_a_jpeg_is_decoded_at_most_once(
    calls: Counter[str], encoding: str, decodings: int
):
    """``bgr`` of a ``bgr8`` frame is its ``pixels``, and the rest is converted from those."""
    frame = Frame(header(encoding), JPEG)
    if decodings == 2:  # the form that is not in the frame's encoding first
        assert (frame.gray if encoding == "bgr8" else frame.bgr).any()
    everything(frame)
    assert calls == {"decode_jpeg": decodings}


@pytest.mark.parametrize("first", ["pixels", "bgr"])
def test_the_bgr_form_of_a_bgr8_frame_is_its_pixels(calls: Counter[str], first: str):
    frame = Frame(header(), JPEG)
    frame.view("bgr" if first == "bgr" else "pixels")
    assert frame.bgr is frame.pixels
    assert calls == {"decode_jpeg": 1}


def test_only_the_luma_is_decoded_when_only_grey_is_wanted(monkeypatch: pytest.MonkeyPatch):
    spaces = []
    real = codecs.decode_jpeg
    monkeypatch.setattr(
        codecs,
        "decode_jpeg",
        lambda jpeg, space, *rest, **options: (
            spaces.append(space) or real(jpeg, space, *rest, **options)
        ),
    )
    gray = Frame(header(), JPEG).view("gray")
    assert spaces == ["mono8"]
    assert np.array_equal(gray, cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_GRAYSCALE))


@pytest.mark.parametrize("encoding", ["mono8", "bgr8", "rgb8", "bgra8", "rgba8"])
def test_pixels_are_in_the_encoding_the_header_names(encoding: str):
    received = Frame(header(encoding), JPEG)
    expected = cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_COLOR)
    assert np.array_equal(received.bgr, expected)
    if encoding == "mono8":
        expected = cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_GRAYSCALE)
    else:
        expected = pixel_formats.convert(expected, "bgr8", encoding)
    assert np.array_equal(received.pixels, expected)
    assert received.raw == expected.tobytes()


@pytest.mark.parametrize(
    "stored",
    [GRAY, SCENE, np.dstack([SCENE, GRAY]), DEEP, SCENE.astype(np.uint16) * 257],
    ids=["grey", "colour", "colour and alpha", "16 bits grey", "16 bits colour"],
)
@pytest.mark.parametrize("encoding", pixel_formats.ENCODINGS)
def test_a_png_of_any_kind_becomes_the_encoding_the_header_names(stored: np.ndarray, encoding: str):
    frame = Frame(header(encoding), codecs.encode_png(stored))
    known = pixel_formats.ENCODINGS[encoding]
    assert frame.picture.mime == keys.PNG
    assert frame.pixels.dtype == known.dtype
    assert frame.pixels.shape == ((48, 64) if known.channels == 1 else (48, 64, known.channels))
    # Colour pictures are SCENE whatever their depth or alpha.
    # DEEP has 256 v + 77 for v: (256 v + 77 + 128) // 257 is v again for all v from 0 to 205.
    if stored.ndim == 3:
        assert np.array_equal(frame.gray, cv2.cvtColor(SCENE, cv2.COLOR_BGR2GRAY))
        assert known.channels == 1 or np.array_equal(frame.bgr, SCENE)
    elif stored.dtype == np.uint8:
        assert np.array_equal(frame.gray, GRAY)
    else:
        low = GRAY <= 205
        assert low.any()
        assert np.array_equal(frame.gray[low], GRAY[low])


def test_a_picture_that_cannot_be_decoded_is_corrupt_each_time_it_is_asked_for():
    frame = Frame(header(), JPEG[:-50])
    for form in ("pixels", "bgr", "gray", "bgr"):
        with pytest.raises(PayloadError) as caught:
            frame.view(form)
        assert caught.value.reason == "corrupt"


def test_the_quality_of_what_is_encoded_here_is_the_frames():
    small, large = (len(Frame(header(), SCENE, quality=q).compressed) for q in (20, 95))
    assert small < large / 2


def test_a_frame_of_an_unknown_encoding_is_refused():
    with pytest.raises(PayloadError) as caught:
        Frame(header("bayer_rggb8"), JPEG)
    assert caught.value.reason == "unsupported_encoding"


QUARTER = codecs.encode_jpeg(cv2.resize(SCENE, (16, 12), interpolation=cv2.INTER_AREA), "bgr8", 95)


def test_the_pixels_of_a_reduced_picture_have_the_frames_size():
    frame = Frame(header(), QUARTER)
    assert frame.is_reduced
    assert frame.picture.size == (16, 12)
    for shown, shape in (
        (frame.pixels, (48, 64, 3)),
        (frame.bgr, (48, 64, 3)),
        (frame.gray, (48, 64)),
    ):
        assert shown.shape == shape
        assert not shown.flags.writeable
    assert frame.bgr is frame.bgr
    # Enlarged by interpolation, every fourth pixel is near one of the picture's own.
    own = cv2.imdecode(np.frombuffer(QUARTER, np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(frame.bgr[2::4, 2::4].astype(int) - own).mean() < 8
    memory = np.zeros(64 * 48 * 3, np.uint8)
    frame.write(memory)
    assert memory.tobytes() == frame.raw == frame.pixels.tobytes()


def test_a_reduced_view_is_at_least_as_large_as_asked_also_of_a_reduced_picture():
    assert Frame(header(), QUARTER).reduced("mono8", 32, 24).shape == (24, 32)
    assert Frame(header(), JPEG).reduced("mono8", 32, 24).shape == (24, 32)


def test_values_of_a_reduced_depth_picture_are_picked_not_mixed():
    depth = np.where(np.arange(16) < 8, 1000, 3000).astype(np.uint16)[np.newaxis].repeat(12, 0)
    frame = Frame(header("16UC1"), codecs.encode_png(depth))
    assert frame.depth is not None
    assert frame.depth.shape == (48, 64)
    assert set(np.unique(frame.depth)) == {1000, 3000}


@pytest.mark.parametrize(
    "size",
    [(65, 48), (64, 49), (32, 23), (30, 24), (16, 24), (7, 5)],
    ids=["wider", "higher", "flatter", "narrower", "cropped", "over an eighth"],
)
def test_a_picture_that_is_not_its_frame_reduced_is_refused(size: tuple[int, int]):
    with pytest.raises(PayloadError) as caught:
        Frame(header(), np.zeros((size[1], size[0], 3), np.uint8))
    assert caught.value.reason == "wrong_size"


@pytest.mark.parametrize("size", [(64, 48), (32, 24), (21, 16), (16, 12), (8, 6)], ids=str)
def test_a_frame_reduced_with_rounded_sides_is_accepted(size: tuple[int, int]):
    assert Frame(header(), np.zeros((size[1], size[0], 3), np.uint8)).bgr.shape == (48, 64, 3)


@pytest.mark.parametrize("form", ["pixels", "bgr", "gray", "compressed"])
def test_threads_that_ask_at_once_share_one_result(form: str, calls: Counter[str]):
    frame = Frame(header("rgb8"), SCENE[:, :, ::-1].copy() if form == "compressed" else JPEG)
    together = threading.Barrier(8)
    results = []

    def ask() -> None:
        together.wait()
        results.append(getattr(frame, form))

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 8
    assert all(result is results[0] for result in results)
    assert calls.total() == 1
