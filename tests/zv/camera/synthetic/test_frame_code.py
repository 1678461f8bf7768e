"""Numbers in pictures: what a screen shows says which frame it is."""

from __future__ import annotations

import threading
from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.pictures.frame_numbers import read_number
from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.stream.counters import FrameCounters
from zv.camera.capture import Capture
from zv.camera.settings import CameraSettings
from zv.camera.synthetic.frame_code import MODULUS, draw_number, extent
from zv.camera.synthetic.scene import Scene

Pixels = np.ndarray[Any, np.dtype[np.uint8]]
NUMBERS = (0, 1, 255, 256, 4660, 43690, 65535)
COLORS = [(blue, green, red) for red in (0, 255) for green in (0, 255) for blue in (0, 255)]


@cache
def picture(width: int, height: int) -> Pixels:
    return Scene(width, height, noise=2.0).render(50)


def numbered(number: int, width: int = 640, height: int = 480) -> Pixels:
    bgr = picture(width, height).copy()
    draw_number(bgr, number)
    return bgr


def through_jpeg(bgr: Pixels, quality: int = 80) -> Pixels:
    packet = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(packet, cv2.IMREAD_COLOR), np.uint8)


def test_the_code_is_the_one_that_is_described() -> None:
    # 4660 is 0x1234, its check 0x12 ^ 0x34 ^ 0xA5 = 0x83; 0x123483 in threes of bits is
    # 000 100 100 011 010 010 000 011: black, red, red, cyan, green, green, black, cyan.
    bgr = np.full((480, 640, 3), 127, np.uint8)
    draw_number(bgr, 4660)
    black, red, green, cyan = (0, 0, 0), (0, 0, 255), (0, 255, 0), (255, 255, 0)
    for block, color in enumerate((black, red, red, cyan, green, green, black, cyan)):
        assert (bgr[0:32, 32 * block : 32 * block + 32] == color).all(), block
    assert (bgr[32:] == 127).all()
    assert (bgr[:, 256:] == 127).all()


def test_every_number_reads_back() -> None:
    bgr = np.zeros((60, 80, 3), np.uint8)
    for number in range(0, MODULUS, 7):
        draw_number(bgr, number)
        assert read_number(bgr) == number


def test_numbers_are_shown_modulo_65536() -> None:
    assert read_number(numbered(65536 * 3 + 17)) == 17


@pytest.mark.parametrize(
    "size", [(1920, 1080), (640, 480), (641, 479), (480, 640), (320, 240), (160, 120)], ids=str
)
@pytest.mark.parametrize("quality", [80, 40])
def test_a_number_survives_the_jpeg(size: tuple[int, int], quality: int) -> None:
    for number in NUMBERS:
        assert read_number(through_jpeg(numbered(number, *size), quality)) == number


@pytest.mark.parametrize(
    "size", [(320, 240), (160, 120), (80, 60), (640, 100), (1280, 960)], ids=str
)
def test_a_number_survives_being_scaled_between_two_jpegs(size: tuple[int, int]) -> None:
    for number in NUMBERS:
        scaled = cv2.resize(through_jpeg(numbered(number)), size, interpolation=cv2.INTER_AREA)
        assert read_number(through_jpeg(np.asarray(scaled, np.uint8))) == number


def test_a_picture_without_a_number_has_none() -> None:
    for color in (*COLORS, (127, 127, 127)):
        assert read_number(np.full((480, 640, 3), color, np.uint8)) is None
    for seed in range(20):
        assert read_number(Scene(160, 120, seed=seed).render(50)) is None


@pytest.mark.parametrize("block", range(8))
def test_a_block_of_another_colour_is_no_other_number(block: int) -> None:
    for number in NUMBERS:
        right = numbered(number, 160, 120)
        for color in COLORS:
            wrong = right.copy()
            wrong[:8, 8 * block : 8 * block + 8] = color
            expected = number if np.array_equal(wrong, right) else None
            assert read_number(wrong) == expected


def test_the_strip_is_the_same_share_of_every_picture() -> None:
    assert extent(640, 480) == (256, 32)
    assert extent(320, 240) == (128, 16)
    assert extent(16, 16) == (6, 1)


def test_a_picture_shows_the_seq_that_it_is_captured_with_in_every_epoch() -> None:
    # Frames that are dropped or stalled are not captured. Repeats are, with the number of the
    # first: the frozen frames 20 to 23 of the scene are the pictures 11 to 14.
    live = ParameterStore(
        CameraSettings(
            width=160, height=120, rate=200, numbered=True, faults="drop@5+9,frozen@20+4,stall@30+2"
        )
    )
    stop = threading.Event()
    seen: list[tuple[int, int, int | None]] = []
    with Capture(live, FrameCounters("captured", "published")) as capture:
        for captured in capture.frames(stop.is_set, lambda _trouble: None, lambda *_remark: None):
            pixels = np.asarray(captured.picture.pixels, np.uint8)
            seen.append((captured.epoch, captured.seq, read_number(pixels)))
            if captured.seq > 40 and len({epoch for epoch, _, _ in seen}) == 1:
                live.change({"seed": 9})
            elif captured.seq > 40:
                stop.set()
    assert len({epoch for epoch, _, _ in seen}) == 2
    assert all(number == (11 if seq in range(11, 15) else seq) for _, seq, number in seen)
