"""Frames of a video in libav's memory: what is made of them, when, and for how long."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.pictures.videos import (
    colour_bars,
    decoded,
    make_video,
    noise,
    pictures,
    shown,
)
from zenoh_vision.image import codecs
from zenoh_vision.image import planar as planar_module
from zv.camera.sources.libav_frames import VideoPicture
from zv.camera.sources.video import VideoSource


@pytest.mark.parametrize("tags", [{}, {"color_range": 2}, {"colorspace": 6}])
def test_a_jpeg_of_a_videos_planes_has_the_colours_of_its_pixels(
    tmp_path: Path, tags: dict[str, int]
):
    smooth = cv2.GaussianBlur(colour_bars(), (0, 0), 4)
    path = make_video(tmp_path / "a.mkv", codec="ffv1", frames=[smooth], tags=tags)
    (picture,) = pictures(path)
    assert picture.stored is not None
    by_planes = decoded(picture.stored.jpeg(95)).astype(int)
    by_pixels = decoded(codecs.encode_jpeg(shown(picture), "bgr8", 95))
    difference = np.abs(by_planes - by_pixels)
    assert difference.mean() < 1.6
    assert difference.max() <= 8


@pytest.mark.parametrize("width", [64, 56], ids=["in whole blocks", "others"])
@pytest.mark.parametrize("tags", [{}, {"color_range": 2}, {"colorspace": 6}])
def test_memory_gets_the_pixels_of_a_video(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, tags: dict[str, int], width: int
):
    shows = noise(48, width, 3)
    path = make_video(tmp_path / "a.mkv", codec="ffv1", frames=[shows, shows], tags=tags)
    first, second = (picture.stored for picture in pictures(path))
    memory = np.zeros((48, width, 3), np.uint8)
    if width == 64:
        monkeypatch.setattr(first, "_made_bgr", lambda: pytest.fail("it is converted and copied"))
    first.copy_bgr(memory)
    assert np.array_equal(memory, second.bgr())


@pytest.mark.parametrize(
    ("size", "pixel_format", "tags"),
    [
        ((48, 63), "yuv420p", {}),
        ((47, 64), "yuv420p", {}),
        ((48, 64), "yuv422p", {}),
        ((48, 64), "yuv444p", {}),
        ((48, 64), "yuv420p10le", {}),
        ((48, 64), "yuv420p", {"colorspace": 1}),  # BT.709, which no JPEG has
    ],
)
def test_planes_that_no_jpeg_can_store_are_converted(
    tmp_path: Path, size: tuple[int, int], pixel_format: str, tags: dict[str, int]
):
    frame = colour_bars(size[1], size[0])
    path = make_video(
        tmp_path / "a.mkv", codec="ffv1", pixel_format=pixel_format, frames=[frame], tags=tags
    )
    (picture,) = pictures(path)
    assert picture.stored is None
    assert picture.pixels.shape == (*size, 3)


def test_forms_that_were_asked_for_are_prepared_for_the_next_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    prepared = []
    monkeypatch.setattr(VideoPicture, "prepare", lambda _, forms: prepared.append(set(forms)))
    source = VideoSource(make_video(tmp_path / "a.avi"))
    source.read().stored.jpeg(80)
    with_pixels = source.read().stored
    with_pixels.bgr()
    source.read()
    # A copy of pixels that exist asks for none of the next picture.
    with_pixels.copy_bgr(np.zeros((*with_pixels.size[::-1], 3), np.uint8))
    source.read()
    source.close()
    assert prepared == [set(), {"planes"}, {"bgr"}, set()]


def test_planes_are_scaled_and_pixels_are_made_before_they_are_asked_for_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    source = VideoSource(make_video(tmp_path / "a.avi"))
    first = source.read().stored
    first.jpeg(80)
    first.bgr()
    second = source.read().stored
    monkeypatch.setattr(second, "_made_bgr", lambda: pytest.fail("made when asked for"))
    monkeypatch.setattr(planar_module, "_scaled", lambda *_: pytest.fail("scaled when asked for"))
    second.bgr()
    second.jpeg(80)
    source.close()


def test_a_picture_is_freed_as_soon_as_nothing_refers_to_it(tmp_path: Path):
    source = VideoSource(make_video(tmp_path / "a.avi"))
    gc.disable()
    try:
        picture = source.read().stored
        picture.jpeg(80)
        part = picture.cropped((0, 0, 32, 32))
        assert (part.bgr() == picture.bgr()[:32, :32]).all()
        freed = weakref.ref(picture)
        del picture, part
        assert freed() is None
    finally:
        gc.enable()
        source.close()
