"""A folder of images, in the order and encoding in which people mean them."""

from __future__ import annotations

import logging
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.pictures.videos import colour_bars, decoded, jpeg_of, noise, with_orientation
from tests.support.processes import run_program
from zenoh_vision.errors import SourceError
from zenoh_vision.image.picture import Picture
from zenoh_vision.keys import JPEG
from zv.camera.sources.base import TimedPicture
from zv.camera.sources.folder import FolderSource


def save(path: Path, pixels: np.ndarray) -> np.ndarray:
    assert cv2.imwrite(str(path), pixels)
    return pixels


def timed(source: FolderSource) -> list[TimedPicture]:
    return list(iter(source.read, None))


def pictures(folder: Path) -> list[Picture]:
    return [each.picture for each in timed(FolderSource(folder))]


def test_images_come_in_natural_order_and_on_time(tmp_path: Path):
    for number in (10, 2, 1, 33, 3):
        save(tmp_path / f"frame{number}.png", np.full((4, 6), number, np.uint8))
    source = FolderSource(tmp_path, rate_hz=4.0)
    given = timed(source)
    assert [int(each.picture.pixels[0, 0]) for each in given] == [1, 2, 3, 10, 33]
    assert [each.due_s for each in given] == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert source.read() is None
    assert (source.live, source.rate_hz) == (False, 4.0)
    assert source.description == f"folder {tmp_path.name} (5 images, 6x4, 4 Hz)"


@pytest.mark.parametrize(
    ("name", "pixels", "encoding"),
    [
        ("a.png", noise(5, 7), "mono8"),
        ("a.pgm", noise(5, 7), "mono8"),
        ("a.png", noise(5, 7, depth=np.uint16), "mono16"),
        ("a.tiff", noise(5, 7, depth=np.uint16), "mono16"),
        ("a.pgm", noise(5, 7, depth=np.uint16), "mono16"),
        ("a.tif", noise(5, 7).astype(np.float32), "32FC1"),
        ("a.png", noise(5, 7, 3), "bgr8"),
        ("a.BMP", noise(5, 7, 3), "bgr8"),
        ("a.ppm", noise(5, 7, 3), "bgr8"),
        ("a.tif", noise(5, 7, 3), "bgr8"),
        ("a.png", noise(5, 7, 4), "bgra8"),
    ],
    ids=lambda value: value if isinstance(value, str) else "x".join(map(str, value.shape)),
)
def test_pixels_keep_their_depth_and_channels(
    tmp_path: Path, name: str, pixels: np.ndarray, encoding: str
):
    save(tmp_path / name, pixels)
    (picture,) = pictures(tmp_path)
    assert picture.encoding == encoding
    assert (picture.width, picture.height) == (7, 5)
    assert picture.form is None
    assert picture.pixels.dtype == pixels.dtype
    assert np.array_equal(picture.pixels, pixels)


@pytest.mark.parametrize(("channels", "encoding"), [(3, "bgr8"), (4, "bgra8")])
def test_colour_of_16_bits_is_scaled_to_8_and_rounded(tmp_path: Path, channels: int, encoding: str):
    # x * 255 / 65535 = x / 257: 128 / 257 rounds down, 129 / 257 up.
    values = np.array([0, 128, 129, 257, 32768, 65535], np.uint16)
    pixels = np.repeat(values, channels).reshape(1, 6, channels)
    save(tmp_path / "a.png", pixels)
    (picture,) = pictures(tmp_path)
    assert picture.encoding == encoding
    assert picture.pixels[0, :, 0].tolist() == [0, 0, 1, 1, 128, 255]


def test_a_jpeg_file_comes_through_untouched(tmp_path: Path):
    colour, grey = jpeg_of(noise(5, 7, 3)), jpeg_of(noise(5, 7))
    (tmp_path / "a.jpg").write_bytes(colour)
    (tmp_path / "b.JPEG").write_bytes(grey)
    first, second = pictures(tmp_path)
    assert (first.data, first.encoding) == (colour, "bgr8")
    assert (second.data, second.encoding, second.size) == (grey, "mono8", (7, 5))


@pytest.mark.parametrize("order", ["little", "big"])
def test_a_jpeg_that_was_taken_on_the_side_is_turned_upright(tmp_path: Path, order: str):
    jpeg = jpeg_of(colour_bars())
    (tmp_path / "a.jpg").write_bytes(with_orientation(jpeg, 6, order))  # 6: turn it clockwise
    (tmp_path / "b.jpg").write_bytes(with_orientation(jpeg, 1, order))
    turned, upright = pictures(tmp_path)
    assert turned.form is None
    assert (turned.width, turned.height) == (48, 64)
    assert np.array_equal(turned.pixels, np.rot90(decoded(jpeg), -1))
    assert upright.form == JPEG


def test_broken_images_are_left_out_with_one_warning_each(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    good = noise(5, 7, 3)
    save(tmp_path / "2.png", good)
    (tmp_path / "1.png").write_bytes((tmp_path / "2.png").read_bytes()[:-30])
    (tmp_path / "3.jpg").write_bytes(jpeg_of(good)[:-30])
    (tmp_path / "4.bmp").write_bytes(b"no image")
    (tmp_path / "5.tif").write_bytes(b"")
    (tmp_path / "6.png").symlink_to(tmp_path / "nothing")
    save(tmp_path / "7.png", good)
    with caplog.at_level(logging.WARNING):
        given = timed(FolderSource(tmp_path, rate_hz=2.0))
    assert [each.due_s for each in given] == [0.0, 0.5]
    assert [record.args[0].name for record in caplog.records] == [
        "1.png",
        "3.jpg",
        "4.bmp",
        "5.tif",
    ]


def test_a_jpeg_with_a_forged_size_is_left_out_before_memory_is_spent(tmp_path: Path):
    jpeg = jpeg_of(noise(48, 64, 3))
    forged = jpeg.replace(b"\x08\x00\x30\x00\x40", b"\x08\x7f\xff\x7f\xff")
    assert forged != jpeg
    (tmp_path / "a.jpg").write_bytes(forged)
    with pytest.raises(SourceError, match="none of its 1 images can be read"):
        FolderSource(tmp_path)


def test_other_files_hidden_ones_and_folders_are_no_images(tmp_path: Path):
    save(tmp_path / "a.png", noise(5, 7))
    (tmp_path / "._a.png").write_bytes(b"what macOS leaves behind")
    (tmp_path / "notes.txt").write_text("x")
    (tmp_path / "b.png").mkdir()
    assert "1 images" in FolderSource(tmp_path).description


def test_an_empty_or_missing_folder_is_refused_with_the_reason(tmp_path: Path):
    with pytest.raises(SourceError, match=r"png, jpg, jpeg, bmp, tif, tiff, webp, pgm, ppm"):
        FolderSource(tmp_path)
    with pytest.raises(SourceError, match="No such file or directory"):
        FolderSource(tmp_path / "nothing")


def test_webp_is_read_and_a_closed_source_gives_nothing_more(tmp_path: Path):
    save(tmp_path / "a.webp", colour_bars())
    assert [each.size for each in pictures(tmp_path)] == [(64, 48)]
    source = FolderSource(tmp_path)
    source.close()
    source.close()
    assert source.read() is None


TOO_LARGE = """
import sys
from zv.camera.sources.folder import FolderSource
print(FolderSource(sys.argv[1]).description)
# Not ru_maxrss, which a process inherits from the one that started it.
print(open("/proc/self/status").read().partition("VmHWM:")[2].split()[0])
"""


def test_an_image_of_any_format_over_8k_is_left_out_before_it_takes_memory(tmp_path: Path):
    for name in ("a.tif", "b.bmp", "c.pgm"):
        save(tmp_path / name, np.zeros((8000, 16_000), np.uint8))
    save(tmp_path / "d.png", noise(5, 7))
    done = run_program([sys.executable, "-c", TOO_LARGE, tmp_path])
    said, peak_kb = done.stdout.splitlines()
    assert "(4 images, 7x5, 10 Hz)" in said
    assert done.stderr.count("skipped") == 3
    # A file of 128 MB is read as a whole; none is decoded to as much again.
    assert int(peak_kb) * 1024 < 350e6
