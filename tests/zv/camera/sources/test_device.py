"""A local camera, with a stand-in for ``cv2.VideoCapture``: machines for tests have none."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.pictures.http_camera import without_huffman_tables
from tests.support.pictures.videos import decoded, jpeg_of, noise
from zenoh_vision.errors import SourceError, SourceLost
from zenoh_vision.host import video_devices
from zv.camera.settings import CameraSettings
from zv.camera.sources.device import MAX_DAMAGED, DeviceSource

PIXELS = noise(48, 64, 3)
JPEG = jpeg_of(PIXELS)


def packet(jpeg: bytes) -> np.ndarray:
    """Return a packet as OpenCV gives it: one row of bytes."""
    return np.frombuffer(jpeg, np.uint8).reshape(1, -1)


class StandIn:
    """What a device gives: the images one after the other, then nothing.

    Args:
        images: What ``read`` gives.
        fourcc: What the device grants, whatever is asked for.
        can_give_packets: Whether CAP_PROP_CONVERT_RGB may be set.
    """

    def __init__(
        self,
        images: Iterable[Any] = (),
        *,
        fourcc: str = "BGR3",
        rate_hz: float = 30.0,
        is_open: bool = True,
        can_give_packets: bool = True,
        stamp_ms: float = 0.0,
    ) -> None:
        self.images = deque(images)
        self.asked: list[tuple[int, float]] = []
        self.released = 0
        self.opened_with: str | int | None = None
        self._is_open = is_open
        self._can_give_packets = can_give_packets
        self._values = {
            cv2.CAP_PROP_FOURCC: float(cv2.VideoWriter.fourcc(*fourcc)),
            cv2.CAP_PROP_FPS: rate_hz,
            cv2.CAP_PROP_POS_MSEC: stamp_ms,
        }

    def __call__(self, device: str | int) -> StandIn:
        self.opened_with = device
        return self

    def isOpened(self) -> bool:  # noqa: N802 - OpenCV's name
        return self._is_open

    def set(self, property_id: int, value: float) -> bool:
        self.asked.append((property_id, value))
        return self._can_give_packets or property_id != cv2.CAP_PROP_CONVERT_RGB

    def get(self, property_id: int) -> float:
        return self._values.get(property_id, 0.0)

    def read(self) -> tuple[bool, Any]:
        if not self.images:
            return False, None
        image = self.images.popleft()
        return image is not None, image

    def release(self) -> None:
        self.released += 1


def test_a_raw_device_gives_decoded_pictures():
    stand_in = StandIn([PIXELS, PIXELS[:24]])
    source = DeviceSource(0, capture=stand_in)
    first, second = source.read(), source.read()
    assert (first.encoding, first.width, first.height, first.jpeg) == ("bgr8", 64, 48, None)
    assert np.array_equal(first.pixels, PIXELS)
    assert second.height == 24
    assert (source.live, source.rate_hz) == (True, 30.0)
    assert cv2.CAP_PROP_CONVERT_RGB not in dict(stand_in.asked)


def test_what_the_device_granted_stands_in_the_description():
    source = DeviceSource(
        "/dev/video2", width=1920, height=1080, rate_hz=60, capture=StandIn([PIXELS])
    )
    assert source.description == "device /dev/video2 (64x48, 30 Hz, BGR3)"


def test_the_format_is_asked_for_before_size_and_rate_which_depend_on_it():
    stand_in = StandIn([PIXELS])
    DeviceSource("1", width=1280, height=720, rate_hz=15, fourcc="MJPG", capture=stand_in)
    assert stand_in.opened_with == 1
    assert stand_in.asked == [
        (cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG")),
        (cv2.CAP_PROP_FRAME_WIDTH, 1280),
        (cv2.CAP_PROP_FRAME_HEIGHT, 720),
        (cv2.CAP_PROP_FPS, 15),
    ]


def test_nothing_is_asked_for_that_was_not_wanted():
    stand_in = StandIn([PIXELS])
    DeviceSource(0, capture=stand_in)
    assert stand_in.asked == []


def yuyv(width: int, height: int) -> np.ndarray:
    """Return a grey picture of two bytes a pixel that is brighter to the right."""
    luma = np.tile(np.linspace(16, 235, width).astype(np.uint8), (height, 1))
    return np.dstack([luma, np.full_like(luma, 128)])


@pytest.mark.parametrize("fourcc", ["YUYV", "YUY2"])
def test_yuyv_is_converted_only_for_who_wants_pixels(fourcc: str):
    stand_in = StandIn([yuyv(64, 48)], fourcc=fourcc)
    picture = DeviceSource(0, capture=stand_in).read()
    assert (cv2.CAP_PROP_CONVERT_RGB, 0) in stand_in.asked
    assert (picture.encoding, picture.width, picture.height) == ("bgr8", 64, 48)
    assert (picture.pixels, picture.jpeg) == (None, None)
    assert picture.stored is not None
    first, last = picture.stored.bgr()[24, [0, 63]].tolist()
    assert (first, last) == ([0, 0, 0], [255, 255, 255])


@pytest.mark.parametrize(
    "image",
    [yuyv(64, 48).reshape(1, -1), yuyv(64, 48).ravel(), yuyv(63, 48), noise(72, 64)],
    ids=["one row", "no rows", "an odd width", "12 bits a pixel"],
)
def test_a_device_whose_yuyv_is_something_else_is_asked_to_have_it_decoded(
    image: np.ndarray, caplog: pytest.LogCaptureFixture
):
    stand_in = StandIn([image, PIXELS], fourcc="YUYV")
    picture = DeviceSource(0, capture=stand_in).read()
    assert np.array_equal(picture.pixels, PIXELS)
    assert stand_in.asked[-1] == (cv2.CAP_PROP_CONVERT_RGB, 1)
    assert f"delivers no YUYV, but {image.shape} uint8" in caplog.text


@pytest.mark.parametrize("can_give_packets", [True, False])
def test_yuyv_that_is_decoded_all_the_same_is_taken_as_pixels(can_give_packets: bool):
    stand_in = StandIn([PIXELS], fourcc="YUYV", can_give_packets=can_give_packets)
    assert np.array_equal(DeviceSource(0, capture=stand_in).read().pixels, PIXELS)


def test_packets_of_an_mjpg_device_come_through_undecoded():
    stand_in = StandIn([packet(JPEG), packet(JPEG + bytes(5000))], fourcc="MJPG")
    source = DeviceSource(0, fourcc="MJPG", capture=stand_in)
    for picture in (source.read(), source.read()):
        assert (picture.jpeg, picture.pixels) == (JPEG, None)
        assert (picture.encoding, picture.width, picture.height) == ("bgr8", 64, 48)
    assert (cv2.CAP_PROP_CONVERT_RGB, 0) in stand_in.asked


def test_a_column_of_bytes_is_a_packet_too():
    source = DeviceSource(0, capture=StandIn([packet(JPEG).reshape(-1, 1)], fourcc="MJPG"))
    assert source.read().jpeg == JPEG


def test_a_device_without_huffman_tables_gets_them():
    bare = without_huffman_tables(JPEG)
    picture = DeviceSource(0, capture=StandIn([packet(bare)], fourcc="MJPG")).read()
    assert np.array_equal(decoded(picture.jpeg), decoded(JPEG))


def test_a_damaged_packet_is_left_out():
    images = [packet(JPEG[:500]), packet(JPEG), packet(JPEG[:-2]), packet(JPEG)]
    source = DeviceSource(0, capture=StandIn(images, fourcc="MJPG"))
    assert [source.read().jpeg, source.read().jpeg] == [JPEG, JPEG]


def test_only_damaged_packets_lose_the_device():
    images = [packet(JPEG)] + [packet(JPEG[:-2])] * MAX_DAMAGED + [packet(JPEG)]
    source = DeviceSource(0, capture=StandIn(images, fourcc="MJPG"))
    source.read()
    with pytest.raises(SourceLost, match="damaged pictures in a row"):
        source.read()


@pytest.mark.parametrize(
    "unusable",
    [b"\x10\x80" * 3072, jpeg_of(PIXELS).replace(b"\xff\xc0\x00\x11", b"\xff\xc3\x00\x11")],
    ids=["no JPEG", "lossless JPEG"],
)
def test_a_device_whose_packets_are_unusable_is_asked_to_have_them_decoded(
    unusable: bytes, caplog: pytest.LogCaptureFixture
):
    stand_in = StandIn([packet(unusable), PIXELS], fourcc="MJPG")
    picture = DeviceSource(0, capture=stand_in).read()
    assert np.array_equal(picture.pixels, PIXELS)
    assert stand_in.asked[-1] == (cv2.CAP_PROP_CONVERT_RGB, 1)
    assert "its pictures are decoded" in caplog.text


def test_an_mjpg_device_that_cannot_give_packets_is_read_decoded():
    picture = DeviceSource(
        0, capture=StandIn([PIXELS], fourcc="MJPG", can_give_packets=False)
    ).read()
    assert np.array_equal(picture.pixels, PIXELS)


def test_pixels_from_a_device_that_was_asked_for_packets_are_taken_as_pixels():
    picture = DeviceSource(0, capture=StandIn([PIXELS], fourcc="MJPG")).read()
    assert np.array_equal(picture.pixels, PIXELS)


@pytest.mark.parametrize(
    ("pixels", "encoding"),
    [
        (noise(4, 6), "mono8"),
        (noise(4, 6, 1), "mono8"),
        (noise(4, 6, depth=np.uint16), "mono16"),
        (noise(4, 6, 4), "bgra8"),
    ],
    ids=["grey", "grey with an axis", "16 bits", "alpha"],
)
def test_grey_and_deep_devices_keep_their_encoding(pixels: np.ndarray, encoding: str):
    picture = DeviceSource(0, capture=StandIn([pixels])).read()
    assert picture.encoding == encoding
    assert np.array_equal(picture.pixels, pixels.reshape(picture.pixels.shape))


@pytest.mark.parametrize("nothing", [None, np.empty((0, 0), np.uint8)], ids=["None", "empty"])
def test_a_device_that_gives_no_picture_is_lost(nothing: Any):
    source = DeviceSource(0, capture=StandIn([PIXELS, nothing, PIXELS]))
    source.read()
    with pytest.raises(SourceLost, match="/dev/video0: the device delivers no picture"):
        source.read()


def test_a_device_that_opens_but_gives_nothing_cannot_be_opened_and_is_released():
    stand_in = StandIn()
    with pytest.raises(SourceError, match="busy with another program") as caught:
        DeviceSource(0, capture=stand_in)
    assert not isinstance(caught.value, SourceLost)
    assert stand_in.released == 1


def test_the_drivers_time_stamp_is_the_capture_time():
    age_ns = 250_000_000
    before_ns = time.time_ns()
    stand_in = StandIn([PIXELS], stamp_ms=time.monotonic_ns() / 1e6 - age_ns / 1e6)
    after_ns = time.time_ns()
    stamp_ns = DeviceSource(0, capture=stand_in).read().stamp_ns
    error_ns = 200_000_000  # of the two clocks' readings, which are not of the same moment
    assert before_ns - error_ns < stamp_ns + age_ns < after_ns + error_ns


@pytest.mark.parametrize("stamp_ms", [0.0, 1e12], ids=["none", "of another clock"])
def test_a_time_stamp_of_another_clock_is_not_believed(stamp_ms: float):
    assert DeviceSource(0, capture=StandIn([PIXELS], stamp_ms=stamp_ms)).read().stamp_ns is None


def test_a_fourcc_of_the_wrong_length_is_refused():
    with pytest.raises(ValueError, match="fourcc"):
        CameraSettings(fourcc="MJPEG")


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A machine with three devices, one of them without a readable name."""
    for number, name in [(0, "Integrated Camera"), (2, "HD Webcam"), (10, None)]:
        node = tmp_path / f"dev/video{number}"
        node.parent.mkdir(exist_ok=True)
        node.touch()
        if name is not None:
            folder = tmp_path / f"sys/class/video4linux/video{number}"
            folder.mkdir(parents=True)
            (folder / "name").write_text(name + "\n")
    (tmp_path / "dev/video-something").touch()
    return tmp_path


def test_a_missing_device_is_explained_with_those_that_exist(machine: Path):
    assert video_devices.why_not("/dev/video7", machine) == (
        "there is no such device; there are: /dev/video0 (Integrated Camera), "
        "/dev/video2 (HD Webcam), /dev/video10"
    )


def test_a_machine_without_devices_is_told_what_needs_none(tmp_path: Path):
    said = video_devices.why_not("/dev/video0", tmp_path)
    assert "no video device" in said
    assert "--source synthetic" in said


def test_missing_permission_is_said_with_the_way_out(
    machine: Path, monkeypatch: pytest.MonkeyPatch
):
    # Root may read everything, so taking the permission away would not do.
    monkeypatch.setattr(os, "access", lambda *_: False)
    said = video_devices.why_not("/dev/video0", machine)
    assert "permission is missing" in said
    assert "group video" in said
    assert "sudo usermod -aG video $USER" in said


def test_a_device_that_is_there_is_busy_or_does_not_capture(machine: Path):
    said = video_devices.why_not("/dev/video0", machine)
    assert "busy" in said
    assert "also: /dev/video2 (HD Webcam), /dev/video10" in said


def test_an_unopened_device_is_released_and_explained():
    stand_in = StandIn(is_open=False)
    with pytest.raises(SourceError, match="/dev/video98: "):
        DeviceSource("98", capture=stand_in)
    assert stand_in.released == 1


def test_a_picture_that_waited_in_the_drivers_buffers_keeps_its_own_time_stamp():
    stand_in = StandIn([PIXELS, PIXELS], stamp_ms=time.monotonic() * 1e3)
    source = DeviceSource(0, capture=stand_in)
    source.read()
    stand_in._values[cv2.CAP_PROP_POS_MSEC] -= 60_000
    age_ns = time.time_ns() - source.read().stamp_ns
    assert age_ns >= 60 * 10**9


def test_one_wrong_time_stamp_is_not_believed_and_the_next_good_one_is():
    stand_in = StandIn([PIXELS] * 4, stamp_ms=0.0)
    source, stamps = DeviceSource(0, capture=stand_in), []
    stamps.append(source.read().stamp_ns)
    for age_s in (0.1, None, 0.1):
        filled_s = 0.0 if age_s is None else time.monotonic() - age_s
        stand_in._values[cv2.CAP_PROP_POS_MSEC] = filled_s * 1e3
        stamps.append(source.read().stamp_ns)
    assert [stamp is None for stamp in stamps] == [True, False, True, False]
