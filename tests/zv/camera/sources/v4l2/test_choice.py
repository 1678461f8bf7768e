"""Which format, size and rate of a device are chosen, what is refused; the clock of its frames."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

from zenoh_vision.errors import SourceError
from zv.camera.sources.base import DeviceWish
from zv.camera.sources.v4l2.buffers import Clock
from zv.camera.sources.v4l2.choice import choose
from zv.camera.sources.v4l2.offers import Offer, Rates, Sizes

SIZES = ((320, 240), (640, 480), (1280, 720), (1280, 960), (1920, 1080))


def offer(fourcc: str, *sizes: tuple[int, int]) -> Offer:
    found = tuple(Sizes((width, width, 1), (height, height, 1)) for width, height in sizes)
    return Offer(fourcc, "", found)


# As a USB 2 webcam: uncompressed pictures of 1280x720 reach 10 Hz only.
WEBCAM = [offer("YUYV", *SIZES), offer("MJPG", *SIZES), offer("H264", *SIZES)]


def webcam_rates(fourcc: str, width: int, height: int) -> Rates:
    if fourcc == "YUYV" and width > 640:
        return Rates((10.0, 5.0))
    return Rates((60.0, 30.0, 15.0)) if (width, height) == (320, 240) else Rates((30.0, 15.0, 5.0))


def chosen(**wish: object) -> str:
    return str(choose(WEBCAM, DeviceWish(**wish), webcam_rates))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wish", "mode"),
    [
        ({}, "MJPG 640x480 at 30 Hz"),
        ({"fourcc": "YUYV"}, "YUYV 640x480 at 30 Hz"),
        ({"width": 320}, "MJPG 320x240 at 30 Hz"),
        ({"height": 720}, "MJPG 1280x720 at 30 Hz"),
        ({"width": 1280, "height": 960}, "MJPG 1280x960 at 30 Hz"),
        ({"width": 1280}, "MJPG 1280x960 at 30 Hz"),  # the larger of the two
        ({"rate_hz": 12}, "MJPG 640x480 at 15 Hz"),  # the lowest that is enough
        ({"rate_hz": 15}, "MJPG 640x480 at 15 Hz"),
        ({"width": 320, "rate_hz": 60}, "MJPG 320x240 at 60 Hz"),
        ({"rate_hz": 60}, "MJPG 320x240 at 60 Hz"),  # what was asked before the usual size
        ({"fourcc": "YUYV", "width": 1280, "height": 720}, "YUYV 1280x720 at 10 Hz"),
    ],
)
def test_what_was_asked_then_the_rate_then_the_cheapest_is_chosen(
    wish: dict[str, object], mode: str
):
    assert chosen(**wish) == mode


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        ({"fourcc": "ZZZZ"}, ["fourcc ZZZZ is not offered; offered: YUYV, MJPG"]),
        ({"fourcc": "YUYY"}, ["did you mean YUYV?"]),
        ({"fourcc": "H264"}, ["fourcc H264 is offered, but cannot be read"]),
        ({"width": 641}, ["size 641 x any height is not offered", "640x480", "1920x1080"]),
        ({"width": 640, "height": 481}, ["size 640x481 is not offered; offered: 320x240, 640x480"]),
        (
            {"width": 1280, "height": 720, "rate_hz": 60},
            [
                "rate 60 Hz is not offered; offered: 1280x720: 30, 15, 5 Hz",
                "(60 Hz at 320x240)",
            ],
        ),
        ({"rate_hz": 61}, ["rate 61 Hz is not offered"]),
    ],
)
def test_what_is_not_offered_is_refused_with_what_is(wish: dict[str, object], words: list[str]):
    with pytest.raises(SourceError) as caught:
        chosen(**wish)
    for each in words:
        assert each in str(caught.value)


def test_without_a_size_near_640x480_the_nearest_is_taken():
    tall = [offer("GREY", (1920, 1200), (1280, 800), (2560, 1600))]
    assert str(choose(tall, DeviceWish(), lambda *_: Rates((60.0,)))) == "GREY 1280x800 at 60 Hz"


def test_any_size_of_a_range_can_be_had_in_its_steps():
    grabber = [Offer("YUYV", "", (Sizes((48, 1920, 16), (32, 1080, 2)),))]

    def pick(**wish: int) -> str:
        return str(choose(grabber, DeviceWish(**wish), lambda *_: Rates()))

    assert pick() == "YUYV 640x480"
    assert pick(width=800) == "YUYV 800x600"
    assert pick(width=1920, height=1080) == "YUYV 1920x1080"
    with pytest.raises(SourceError, match="48x32 to 1920x1080"):
        pick(width=801)


def test_a_range_of_rates_gives_the_rate_itself():
    loop = Rates((1000.0, 1.0), between=True)
    one = [offer("YUYV", (640, 480))]
    assert choose(one, DeviceWish(rate_hz=12.5), lambda *_: loop).rate_hz == 12.5
    assert str(loop) == "1 to 1000 Hz"


def test_2997_counts_as_30():
    ntsc = Rates((30000 / 1001,))
    found = choose([offer("YUYV", (640, 480))], DeviceWish(rate_hz=30), lambda *_: ntsc)
    assert found.rate_hz == pytest.approx(29.97, abs=0.01)


def test_a_wish_for_16_bits_prefers_the_formats_that_have_more_than_8():
    infrared = [offer("GREY", (640, 480)), offer("Y16 ", (640, 480)), offer("YUYV", (640, 480))]
    rates = lambda *_: Rates((30.0,))  # noqa: E731
    assert choose(infrared, DeviceWish(), rates).fourcc == "YUYV"
    assert choose(infrared, DeviceWish(deep=True), rates).fourcc == "Y16 "
    assert choose(infrared, DeviceWish(fourcc="GREY", deep=True), rates).fourcc == "GREY"


def test_a_device_without_a_format_that_can_be_read_says_which_it_has():
    with pytest.raises(SourceError, match=r"no format that can be read, only H264$"):
        choose([offer("H264", (640, 480))], DeviceWish(), lambda *_: Rates())


def ages_s(read_ns: Callable[[], int], *given_s: float) -> list[float | None]:
    clock, found = Clock(), []
    for age_s in given_s:
        stamp_ns = clock.stamp_ns(read_ns() - round(age_s * 1e9))
        found.append(None if stamp_ns is None else (time.time_ns() - stamp_ns) / 1e9)
    return found


@pytest.mark.parametrize("read_ns", [time.monotonic_ns, time.time_ns])
def test_a_stamp_of_either_clock_is_the_capture_time_also_if_the_picture_waited_long(
    read_ns: Callable[[], int],
):
    assert ages_s(read_ns, 0.25, 60.0) == pytest.approx([0.25, 60.0], abs=0.1)


def test_a_stamp_a_little_ahead_is_now_since_a_picture_is_not_of_the_future():
    assert ages_s(time.monotonic_ns, -0.04) == pytest.approx([0.0], abs=0.02)


def test_a_stamp_of_another_clock_is_not_believed_and_the_next_good_one_is():
    assert ages_s(time.monotonic_ns, 5.0) == [None]
    found = ages_s(time.monotonic_ns, 5.0, 0.1, -5.0, 0.1)
    assert [each is None for each in found] == [True, False, True, False]


def test_no_stamp_is_none():
    assert Clock().stamp_ns(0) is None
