"""Pixels that libswscale writes to given memory are those that PyAV makes, and nothing else."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from av.video.frame import VideoFrame
from av.video.plane import VideoPlane
from av.video.reformatter import ColorRange
from numpy.typing import NDArray

from zv.camera.sources.libav_frames import stored_planes
from zv.camera.sources.swscale import BgrWriter

GUARD = 64
UNTOUCHED = 7


def noise(width: int, height: int, pixel_format: str, colour_range: int) -> VideoFrame:
    """Return a frame of random planes."""
    frame = VideoFrame(width, height, pixel_format)
    random = np.random.default_rng(width * height)
    for plane in frame.planes:
        plane.update(random.integers(0, 256, plane.buffer_size, np.uint8).tobytes())
    frame.color_range = colour_range
    return frame


def planes_of(frame: VideoFrame) -> tuple[VideoPlane, ...]:
    planes = stored_planes(frame)
    assert planes is not None
    return planes


def written(writer: BgrWriter, frame: VideoFrame, *, full_range: bool) -> NDArray[np.uint8]:
    """Return what is written to memory of just the size of the pixels."""
    memory = np.full(frame.width * frame.height * 3 + GUARD, UNTOUCHED, np.uint8)
    target = memory[:-GUARD].reshape(frame.height, frame.width, 3)
    assert writer.write(planes_of(frame), full_range=full_range, target=target)
    assert set(memory[-GUARD:].tolist()) == {UNTOUCHED}
    return memory[:-GUARD].reshape(frame.height, frame.width, 3)


def by_pyav(frame: VideoFrame) -> NDArray[np.uint8]:
    made = frame.reformat(format="bgr24", src_color_range=frame.color_range)
    return np.asarray(made.to_ndarray(), np.uint8)


pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="a library shows only its own")


@pytest.mark.parametrize("width", [16, 32, 48, 112, 720, 1920])
@pytest.mark.parametrize("height", [2, 6, 48])
@pytest.mark.parametrize(
    ("pixel_format", "colour_range", "full_range"),
    [
        ("yuv420p", ColorRange.MPEG, False),
        ("yuv420p", ColorRange.JPEG, True),
        ("yuvj420p", ColorRange.JPEG, True),
    ],
)
def test_pixels_are_those_of_pyav(width, height, pixel_format, colour_range, full_range):
    frame = noise(width, height, pixel_format, colour_range)
    assert np.array_equal(written(BgrWriter(), frame, full_range=full_range), by_pyav(frame))


@pytest.mark.parametrize("width", [2, 8, 18, 40, 854])
def test_widths_of_which_whole_blocks_do_not_fit_are_not_written(width):
    frame = noise(width, 48, "yuv420p", ColorRange.MPEG)
    memory = np.zeros((48, width, 3), np.uint8)
    assert not BgrWriter().write(planes_of(frame), full_range=False, target=memory)
    assert not memory.any()


@pytest.mark.parametrize(
    "memory",
    [
        np.zeros((48, 64, 4), np.uint8),
        np.zeros((48, 64, 3), np.uint16),
        np.zeros((48, 128, 3), np.uint8)[:, ::2],
        np.frombuffer(bytes(48 * 64 * 3), np.uint8).reshape(48, 64, 3),
    ],
    ids=["other size", "other type", "gaps", "read only"],
)
def test_memory_that_does_not_fit_is_refused(memory):
    planes = planes_of(noise(64, 48, "yuv420p", ColorRange.MPEG))
    with pytest.raises(ValueError, match="memory"):
        BgrWriter().write(planes, full_range=False, target=memory)
    assert not memory.any()


def test_a_stream_may_change_its_size_and_its_range():
    writer = BgrWriter()
    for width, height, colour_range in (
        (64, 48, ColorRange.MPEG),
        (64, 48, ColorRange.JPEG),
        (48, 64, ColorRange.JPEG),
        (64, 48, ColorRange.MPEG),
    ):
        frame = noise(width, height, "yuv420p", colour_range)
        found = written(writer, frame, full_range=colour_range == ColorRange.JPEG)
        assert np.array_equal(found, by_pyav(frame))
