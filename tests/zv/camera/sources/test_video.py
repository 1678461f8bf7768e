"""A video file at its own pace, in its own colours, and what broken files do."""

from __future__ import annotations

import struct
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from av.video.frame import VideoFrame

from tests.support.pictures.videos import (
    HEIGHT,
    WIDTH,
    colour_bars,
    level,
    make_sound,
    make_video,
    noise,
    pictures,
    shown,
)
from zenoh_vision.errors import SourceError
from zv.camera.sources import libav
from zv.camera.sources.base import TimedPicture
from zv.camera.sources.recording import Timeline
from zv.camera.sources.video import VideoSource

MJPEG = {"codec": "mjpeg", "pixel_format": "yuvj420p"}


def mean(timed: TimedPicture) -> float:
    return float(shown(timed).mean())


def test_every_picture_comes_once_in_order_and_at_the_rate_of_the_file(tmp_path: Path):
    source = VideoSource(make_video(tmp_path / "a.avi", frames=20, rate=25))
    assert (source.rate_hz, source.live) == (25.0, False)
    assert source.description == "video file a.avi (64x48, MPEG4, 25 Hz)"
    given = list(iter(source.read, None))
    assert [mean(each) for each in given] == pytest.approx([level(k) for k in range(20)], abs=4)
    assert [each.due_s for each in given] == pytest.approx([k / 25 for k in range(20)])
    source.close()
    source.close()
    assert source.read() is None


def test_a_variable_rate_is_honoured_and_counted_from_the_first_picture(tmp_path: Path):
    times_ms = [2000, 2040, 2500, 2510, 4000]
    given = pictures(make_video(tmp_path / "a.mkv", times_ms=times_ms))
    assert [picture.due_s for picture in given] == pytest.approx([0.0, 0.04, 0.5, 0.51, 2.0])


@pytest.mark.parametrize(
    ("times_s", "due_s"),
    [
        ([5.0, 5.5, 6.0], [0.0, 0.5, 1.0]),
        ([None, None, None], [0.0, 0.1, 0.2]),
        ([0.0, None, 0.3], [0.0, 0.1, 0.2]),
        ([None, 7.0, 7.5], [0.0, 0.1, 0.6]),
        ([9.0, 9.5, 0.0, 0.5], [0.0, 0.5, 0.6, 1.1]),
        ([0.0, 0.5, 3700.5, 3701.0], [0.0, 0.5, 0.6, 1.1]),
        ([0.0, 0.5, 40.5, 41.0], [0.0, 0.5, 40.5, 41.0]),
    ],
    ids=[
        *("from anywhere", "no times", "one missing", "first missing", "clock starts again"),
        *("clock jumps", "a pause"),
    ],
)
def test_missing_and_backward_times_are_bridged_by_the_rate(
    times_s: list[float | None], due_s: list[float]
):
    timeline = Timeline(rate_hz=10.0)
    assert [timeline.due_s(time_s) for time_s in times_s] == pytest.approx(due_s)


def test_recordings_that_were_joined_play_on_and_the_jump_is_said_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    one = make_video(tmp_path / "a.ts", frames=5, codec="mpeg2video", rate=25)
    later = make_video(
        tmp_path / "b.ts",
        frames=5,
        codec="mpeg2video",
        rate=25,
        options={"output_ts_offset": "3600"},
    )
    for parts in ((one, later), (later, one)):
        joined = tmp_path / "joined.ts"
        joined.write_bytes(b"".join(part.read_bytes() for part in parts))
        caplog.clear()
        due_s = [each.due_s for each in pictures(joined)]
        assert len(due_s) == 10
        assert due_s == pytest.approx([k / 25 for k in range(10)], abs=0.1)
        assert len([each for each in caplog.records if "jumps" in each.message]) == 1


def test_one_of_several_videos_is_chosen(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    path = tmp_path / "two.mkv"
    with av.open(str(path), "w") as container:
        for size in ((64, 48), (32, 16)):
            stream = container.add_stream("ffv1", rate=10)
            stream.width, stream.height = size
            stream.pix_fmt = "gray"
        for stream in container.streams.video:
            pixels = noise(stream.height, stream.width)
            for packet in (
                *stream.encode(VideoFrame.from_ndarray(pixels, format="gray")),
                *stream.encode(None),
            ):
                container.mux(packet)
    caplog.set_level("INFO")
    for number, size in enumerate([(64, 48), (32, 16)]):
        source = VideoSource(path, number)
        assert source.read().picture.size == size
        source.close()
    assert "it has 2 videos: 64x48, 32x16; number 1 is shown" in caplog.text
    with pytest.raises(SourceError, match="video_stream = 2, but its last video is number 1"):
        VideoSource(path, 2)


def test_pixels_that_are_not_square_are_said(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    path = make_video(
        tmp_path / "a.mkv",
        tags={"sample_aspect_ratio": Fraction(64, 45)},
    )
    source = VideoSource(path)
    source.close()
    assert source.description == "video file a.mkv (64x48, pixels 64:45, MPEG4, 10 Hz)"
    assert "are not square but 64:45" in caplog.text


def test_an_mjpeg_video_that_must_be_turned_is_decoded_upright(tmp_path: Path):
    path = make_video(tmp_path / "a.mov", **MJPEG, frames=[colour_bars()] * 3)
    upright = shown(pictures(path)[0])
    turn_track(path)
    given = pictures(path)
    assert len(given) == 3
    assert {each.picture.size for each in given} == {(HEIGHT, WIDTH)}
    difference = shown(given[0]).astype(int) - np.rot90(upright, -1)
    assert np.median(np.abs(difference)) <= 2  # another decoder enlarges chroma in another way
    assert [each.due_s for each in given] == pytest.approx([0.0, 0.1, 0.2])


@pytest.mark.parametrize(
    ("codec", "pixel_format", "array_format", "frame", "encoding"),
    [
        ("ffv1", "gray", "gray", noise(HEIGHT, WIDTH), "mono8"),
        ("ffv1", "gray16le", "gray16le", noise(HEIGHT, WIDTH, depth=np.uint16), "mono16"),
        ("ffv1", "bgra", "bgra", noise(HEIGHT, WIDTH, 4), "bgra8"),
        ("ffv1", "bgr0", "bgr24", noise(HEIGHT, WIDTH, 3), "bgr8"),
        ("rawvideo", "bgr24", "bgr24", noise(HEIGHT, WIDTH, 3), "bgr8"),
        ("png", "rgb24", "bgr24", noise(HEIGHT, WIDTH, 3), "bgr8"),
    ],
    ids=["mono8", "mono16", "bgra8", "bgr0", "bgr8", "rgb8"],
)
def test_lossless_pixels_come_out_exactly_with_depth_and_channels(
    tmp_path: Path,
    codec: str,
    pixel_format: str,
    array_format: str,
    frame: np.ndarray,
    encoding: str,
):
    path = make_video(
        tmp_path / ("a.mkv" if codec == "ffv1" else "a.avi"),
        codec=codec,
        pixel_format=pixel_format,
        array_format=array_format,
        frames=[frame, frame[::-1].copy()],
    )
    first, second = pictures(path)
    assert (first.picture.encoding, first.picture.size) == (encoding, (WIDTH, HEIGHT))
    assert shown(first).dtype == frame.dtype
    assert np.array_equal(shown(first), frame)
    assert np.array_equal(shown(second), frame[::-1])


def test_an_odd_width_needs_no_padding(tmp_path: Path):
    frame = noise(33, 51, 3)
    path = make_video(tmp_path / "a.mkv", codec="ffv1", pixel_format="bgr0", frames=[frame])
    (picture,) = pictures(path)
    assert shown(picture).flags.c_contiguous
    assert np.array_equal(shown(picture), frame)


def test_a_picture_does_not_change_with_the_next(tmp_path: Path):
    # Flash screen video is BGR as it is, and only sends what differs from the picture before.
    path = make_video(
        tmp_path / "a.flv",
        codec="flashsv",
        pixel_format="bgr24",
        frames=[half_white(index) for index in range(8)],
    )
    source = VideoSource(path)
    given = [(shown(each), shown(each).copy()) for each in iter(source.read, None)]
    source.close()
    assert all(np.array_equal(now, then) for now, then in given)


@pytest.mark.parametrize(("color_range", "black"), [(1, 16), (2, 30)], ids=["limited", "full"])
def test_the_range_that_a_stream_states_is_heeded(tmp_path: Path, color_range: int, black: int):
    # Luma 30 is 30 in full range, and (30 - 16) * 255 / 219 = 16.3 in the range 16 to 235.
    path = make_video(
        tmp_path / "a.mkv",
        codec="ffv1",
        pixel_format="yuv420p",
        array_format="yuv420p",
        frames=[planar(30)],
        tags={"color_range": color_range},
    )
    (picture,) = pictures(path)
    assert mean(picture) == pytest.approx(black, abs=1)


def half_white(index: int) -> np.ndarray:
    """Return a picture whose lower rows stay as they are and whose first ones change."""
    pixels = np.full((256, 256, 3), 255, np.uint8)
    pixels[:64] = level(index)
    return pixels


def planar(luma: int) -> np.ndarray:
    """Return a plain 4:2:0 picture as one array of (height * 3 / 2, width)."""
    chroma = np.full((HEIGHT // 2, WIDTH), 128, np.uint8)
    return np.concatenate([np.full((HEIGHT, WIDTH), luma, np.uint8), chroma])


def test_packets_of_an_mjpeg_file_come_through_undecoded(tmp_path: Path):
    path = make_video(tmp_path / "a.avi", **MJPEG, frames=3)
    data = path.read_bytes()
    given = pictures(path)
    assert len(given) == 3
    for index, picture in enumerate(given):
        assert picture.picture.data in data
        assert (picture.picture.encoding, picture.picture.size) == ("bgr8", (WIDTH, HEIGHT))
        assert mean(picture) == pytest.approx(level(index), abs=3)
        assert picture.due_s == pytest.approx(index / 10)


def test_an_mjpeg_file_without_huffman_tables_gets_them(tmp_path: Path):
    path = make_video(tmp_path / "a.avi", **MJPEG, frames=1, options={})
    data = path.read_bytes()
    (whole,) = pictures(path)
    # Same length, so that the container stays valid: the table segments become comments.
    path.write_bytes(data.replace(b"\xff\xc4", b"\xff\xfe"))
    (picture,) = pictures(path)
    assert whole.picture.data not in path.read_bytes()
    assert np.array_equal(shown(picture), shown(whole))


def test_a_turned_video_is_shown_upright_as_opencv_shows_it(tmp_path: Path):
    path = make_video(tmp_path / "a.mp4", frames=[colour_bars()], options={"movflags": "faststart"})
    upright = shown(pictures(path)[0])
    turn_track(path)
    (picture,) = pictures(path)
    assert picture.picture.size == (HEIGHT, WIDTH)
    assert np.array_equal(shown(picture), np.rot90(upright, -1))
    _, opencv = cv2.VideoCapture(str(path)).read()
    assert np.array_equal(shown(picture), opencv)


def turn_track(path: Path) -> None:
    """Have the container say that its video is to be turned by 90 degrees clockwise."""
    data = path.read_bytes()
    # The 3x3 matrix of the track header in 16.16 (last column 2.30): a turn by 90 degrees.
    identity = struct.pack(">9i", 1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30)
    turn = struct.pack(">9i", 0, 1 << 16, 0, -(1 << 16), 0, 0, HEIGHT << 16, 0, 1 << 30)
    track = data.index(b"tkhd")
    path.write_bytes(data[:track] + data[track:].replace(identity, turn, 1))


def test_a_name_with_a_colon_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    make_video(tmp_path / "a.avi").rename(tmp_path / "http:b.avi")
    monkeypatch.chdir(tmp_path)
    assert len(pictures(Path("http:b.avi"))) == 5


def test_a_file_that_is_cut_short_gives_what_is_there_and_ends(tmp_path: Path):
    path = make_video(tmp_path / "a.avi", frames=[noise(HEIGHT, WIDTH, 3)] * 20)
    whole, data = pictures(path), path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    given = pictures(path)
    assert 8 <= len(given) <= 14
    for picture, expected in zip(given[:8], whole, strict=False):
        assert np.array_equal(shown(picture), shown(expected))


def test_damaged_mjpeg_packets_are_left_out_with_one_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
):
    path = make_video(tmp_path / "a.avi", **MJPEG, frames=4)
    data, second = path.read_bytes(), pictures(path)[1].picture.data
    path.write_bytes(data.replace(second, second[:-2] + b"\0\0"))
    assert [each.due_s for each in pictures(path)] == pytest.approx([0.0, 0.2, 0.3])
    assert len(caplog.records) == 1
    path.write_bytes(data.replace(b"\xff\xd9", b"\0\0"))
    assert pictures(path) == []
    assert len(caplog.records) == 2


def test_a_video_of_larger_pictures_than_allowed_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    path = make_video(tmp_path / "a.avi")
    monkeypatch.setattr(libav, "MAX_PIXELS", WIDTH * HEIGHT - 1)
    with pytest.raises(SourceError, match="too large: 64x48"):
        VideoSource(path)


def cut_mp4(path: Path) -> None:
    # Its index is at the end, so nothing can be read without it.
    make_video(path.with_suffix(".mp4"))
    path.write_bytes(path.with_suffix(".mp4").read_bytes().partition(b"moov")[0])


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda path: path.touch(), "empty"),
        (lambda path: path.write_bytes(noise(20_000).tobytes()), "not a video that can be read"),
        (lambda path: path.write_text("just words\n" * 1000), "not a video"),
        (lambda path: make_sound(path.with_suffix(".wav")).rename(path), "sound, but no video"),
        (cut_mp4, "cut short"),
    ],
    ids=["empty", "garbage", "text", "sound", "no index"],
)
@pytest.mark.parametrize("name", ["a.avi", "a.txt"])
def test_what_is_no_video_is_refused_with_the_reason(
    tmp_path: Path, make: Callable[[Path], object], reason: str, name: str
):
    path = tmp_path / name
    make(path)
    with pytest.raises(SourceError, match=reason) as caught:
        VideoSource(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("name", "frames"), [("vtest.avi", 795), ("intel_bottle-detection.mp4", 1189)]
)
def test_real_video_is_equal_to_what_opencv_reads_to_the_pixel_and_in_time(
    real_data: Callable[[str], Path], name: str, frames: int
):
    source = VideoSource(real_data(name))
    capture = cv2.VideoCapture(str(real_data(name)))
    for _ in range(frames):
        picture = source.read()
        _, expected = capture.read()
        assert np.array_equal(shown(picture), expected)
        assert picture.due_s * 1e3 == pytest.approx(capture.get(cv2.CAP_PROP_POS_MSEC), abs=1)
    assert source.read() is None


def test_a_video_that_aborts_opencv_is_read(real_data: Callable[[str], Path]):
    given = pictures(real_data("bgslib_demo.avi"))
    assert len(given) == 51
    assert {each.picture.size for each in given} == {(48, 48)}
    assert given[-1].due_s == pytest.approx(50 / 15)
