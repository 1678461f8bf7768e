"""Frames of a video in libav's memory: what is made of them, when; and libav's options."""

from __future__ import annotations

import gc
import weakref
from pathlib import Path

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from tests.support.pictures.videos import (
    colour_bars,
    decoded,
    make_video,
    noise,
    pictures,
    shown,
)
from zenoh_vision.errors import SourceError
from zenoh_vision.image import codecs
from zenoh_vision.image import planar as planar_module
from zenoh_vision.image.picture import PixelPicture
from zv.camera.settings import CameraSettings
from zv.camera.sources import libav_options
from zv.camera.sources.libav_frames import VideoPicture
from zv.camera.sources.libav_options import hardware, options_of
from zv.camera.sources.video import VideoSource


@pytest.mark.parametrize("tags", [{}, {"color_range": 2}, {"colorspace": 6}])
def test_a_jpeg_of_a_videos_planes_has_the_colours_of_its_pixels(
    tmp_path: Path, tags: dict[str, int]
):
    smooth = cv2.GaussianBlur(colour_bars(), (0, 0), 4)
    path = make_video(tmp_path / "a.mkv", codec="ffv1", frames=[smooth], tags=tags)
    (picture,) = pictures(path)
    by_planes = decoded(picture.picture.jpeg(95)).astype(int)
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
    first, second = (each.picture for each in pictures(path))
    memory = np.zeros(48 * width * 3, np.uint8)
    if width == 64:
        monkeypatch.setattr(first, "_make_pixels", lambda: pytest.fail("converted and copied"))
    first.write(memory)
    assert np.array_equal(memory, second.pixels.ravel())


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
    assert isinstance(picture.picture, PixelPicture)
    assert picture.picture.pixels.shape == (*size, 3)


def test_forms_that_were_asked_for_are_prepared_for_the_next_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    prepared = []
    monkeypatch.setattr(VideoPicture, "prepare", lambda _, forms: prepared.append(set(forms)))
    source = VideoSource(make_video(tmp_path / "a.avi"))
    source.read().picture.jpeg(80)
    with_pixels = source.read().picture
    assert with_pixels.pixels.size
    source.read()
    # A copy of pixels that exist asks for none of the next picture.
    with_pixels.write(np.zeros(48 * 64 * 3, np.uint8))
    source.read()
    source.close()
    assert prepared == [set(), {"planes"}, {"bgr"}, set()]


def test_planes_are_scaled_and_pixels_are_made_before_they_are_asked_for_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    source = VideoSource(make_video(tmp_path / "a.avi"))
    first = source.read().picture
    first.jpeg(80)
    assert first.pixels.size
    second = source.read().picture
    monkeypatch.setattr(second, "_make_pixels", lambda: pytest.fail("made when asked for"))
    monkeypatch.setattr(planar_module, "_scaled", lambda *_: pytest.fail("scaled when asked for"))
    assert second.pixels.size
    second.jpeg(80)
    source.close()


def test_a_picture_is_freed_as_soon_as_nothing_refers_to_it(tmp_path: Path):
    source = VideoSource(make_video(tmp_path / "a.avi"))
    gc.disable()
    try:
        picture = source.read().picture
        picture.jpeg(80)
        part = picture.cropped((0, 0, 32, 32))
        assert (part.pixels == picture.pixels[:32, :32]).all()
        freed = weakref.ref(picture)
        del picture, part
        assert freed() is None
    finally:
        gc.enable()
        source.close()


def test_options_of_formats_and_protocols_are_known():
    text = "user_agent=a b,max_delay=200000,reorder_queue_size=10,probesize=32=1"
    assert options_of(text) == {
        "user_agent": "a b",
        "max_delay": "200000",
        "reorder_queue_size": "10",
        "probesize": "32=1",
    }
    assert options_of("") == {}


@pytest.mark.parametrize(
    ("text", "reason"),
    [("user_agnet=x", "no option 'user_agnet'"), ("tcp", "'tcp' is not NAME=VALUE")],
)
def test_what_is_no_option_is_refused(text: str, reason: str):
    with pytest.raises(ValueError, match=reason):
        options_of(text)
    with pytest.raises(ValidationError, match=reason):
        CameraSettings(libav_options=text)


def test_without_hardware_the_cpu_decodes_unless_hardware_was_asked_for(
    monkeypatch: pytest.MonkeyPatch,
):
    monkeypatch.setattr(libav_options, "hwdevices_available", lambda: ["cuda"])
    monkeypatch.setattr(libav_options, "DEVICE_FILES", {"cuda": ("/nowhere",)})
    assert hardware("none") is None
    assert hardware("auto") is None
    with pytest.raises(SourceError, match="hwaccel = cuda does not work here: cuda: there is no"):
        hardware("cuda")
    with pytest.raises(SourceError, match="built without it; allowed: auto, none, cuda"):
        hardware("vaapi")
