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
    everything(Frame(header(), pixels=SCENE))
    assert calls == {"encode_jpeg": 1}


@pytest.mark.parametrize(
    "make",
    [
        pytest.param(lambda: Frame(header(), compressed=JPEG), id="JPEG"),
        pytest.param(lambda: Frame(header(), pixels=SCENE.copy()), id="pixels"),
        pytest.param(lambda: Frame(header("rgb8"), pixels=SCENE.copy()), id="other colours"),
        pytest.param(lambda: Frame(header("16UC1"), compressed=codecs.encode_png(DEEP)), id="PNG"),
    ],
)
def test_no_form_can_be_written_to_however_the_frame_came(make: Callable[[], Frame]):
    frame = make()
    forms = [frame.pixels, frame.bgr, frame.gray, frame.depth]
    assert not any(form.flags.writeable for form in forms if form is not None)


def test_the_pixels_that_a_frame_was_made_from_stay_those_of_their_owner():
    pixels = SCENE.copy()
    Frame(header(), pixels=pixels)
    assert pixels.flags.writeable


def test_a_frame_of_16_bits_is_encoded_once_as_a_png_that_is_exact(calls: Counter[str]):
    frame = Frame(header("mono16"), pixels=DEEP)
    everything(frame)
    assert calls == {"encode_png": 1}
    assert frame.mime == keys.PNG
    assert np.array_equal(cv2.imdecode(np.frombuffer(frame.compressed, np.uint8), -1), DEEP)
    received = Frame(header("mono16"), compressed=frame.compressed)
    assert received.pixels.dtype == np.uint16
    assert np.array_equal(received.pixels, DEEP)


def test_a_jpeg_passes_through_untouched_and_undecoded(calls: Counter[str]):
    frame = Frame(header(), compressed=JPEG)
    assert frame.compressed is JPEG
    assert frame.mime == keys.JPEG
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
    frame = Frame(header(encoding), compressed=JPEG)
    if decodings == 2:  # the form that is not in the frame's encoding first
        assert (frame.gray if encoding == "bgr8" else frame.bgr).any()
    everything(frame)
    assert calls == {"decode_jpeg": decodings}


@pytest.mark.parametrize("first", ["pixels", "bgr"])
def test_the_bgr_form_of_a_bgr8_frame_is_its_pixels(calls: Counter[str], first: str):
    frame = Frame(header(), compressed=JPEG)
    frame.form("bgr" if first == "bgr" else "pixels")
    assert frame.bgr is frame.pixels
    assert calls == {"decode_jpeg": 1}


def test_only_the_luma_is_decoded_when_only_grey_is_wanted(monkeypatch: pytest.MonkeyPatch):
    spaces = []
    real = codecs.decode_jpeg
    monkeypatch.setattr(
        codecs, "decode_jpeg", lambda jpeg, space: spaces.append(space) or real(jpeg, space)
    )
    gray = Frame(header(), compressed=JPEG).form("gray")
    assert spaces == ["mono8"]
    assert np.array_equal(gray, cv2.imdecode(np.frombuffer(JPEG, np.uint8), cv2.IMREAD_GRAYSCALE))


@pytest.mark.parametrize("encoding", ["mono8", "bgr8", "rgb8", "bgra8", "rgba8"])
def test_pixels_are_in_the_encoding_the_header_names(encoding: str):
    received = Frame(header(encoding), compressed=JPEG)
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
    frame = Frame(header(encoding), compressed=codecs.encode_png(stored))
    known = pixel_formats.ENCODINGS[encoding]
    assert frame.mime == keys.PNG
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
    frame = Frame(header(), compressed=JPEG[:-50])
    for form in ("pixels", "bgr", "gray", "bgr"):
        with pytest.raises(PayloadError) as caught:
            frame.form(form)
        assert caught.value.reason == "corrupt"


def test_the_quality_of_what_is_encoded_here_is_the_frames():
    small, large = (len(Frame(header(), pixels=SCENE, quality=q).compressed) for q in (20, 95))
    assert small < large / 2


@pytest.mark.parametrize(
    ("forms", "error"),
    [({}, ValueError), ({"pixels": SCENE, "compressed": JPEG}, ValueError)],
    ids=["neither", "both"],
)
def test_a_frame_is_born_in_exactly_one_form(forms: dict, error: type[Exception]):
    with pytest.raises(error, match="either"):
        Frame(header(), **forms)


@pytest.mark.parametrize("encoding", [None, "bayer_rggb8"])
def test_a_frame_of_an_unknown_encoding_is_refused(encoding: str | None):
    with pytest.raises(PayloadError) as caught:
        Frame(header(encoding), compressed=JPEG)
    assert caught.value.reason == "unsupported_encoding"


@pytest.mark.parametrize("form", ["pixels", "bgr", "gray", "compressed"])
def test_threads_that_ask_at_once_share_one_result(form: str, calls: Counter[str]):
    born = {"pixels": SCENE[:, :, ::-1].copy()} if form == "compressed" else {"compressed": JPEG}
    frame = Frame(header("rgb8"), **born)
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
