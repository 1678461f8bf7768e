"""Every pixel encoding: exact on the raw key, close on the compressed one."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import msgpack
import numpy as np
import pytest

from tests.support.headers import header
from tests.support.listening import Listener, Message, newest
from tests.support.pictures.encoded import HEIGHT, WIDTH, scene
from tests.support.publishing import Paced
from tests.support.waiting import in_time, wait_until
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.image.frame import Frame
from zenoh_vision.image.picture import PixelPicture
from zenoh_vision.messages import Header
from zenoh_vision.node.node import Node
from zv.camera.service import run
from zv.camera.settings import CameraSettings
from zv.camera.sources.base import TimedPicture

ENCODINGS = ("mono8", "mono16", "bgr8", "rgb8", "bgra8", "rgba8")
RAW = "vision/front/image"
COMPRESSED = "vision/front/image/compressed"


def pixels_in(encoding: str) -> np.ndarray:
    """Return a picture in an encoding, made without code of ours."""
    bgr = scene(7)
    alpha = np.random.default_rng(2).integers(0, 256, (HEIGHT, WIDTH, 1), np.uint8)
    if encoding == "mono8":
        return bgr[:, :, 0].copy()
    if encoding == "mono16":
        return np.random.default_rng(3).integers(0, 65536, (HEIGHT, WIDTH), np.uint16)
    color = bgr[:, :, ::-1] if encoding.startswith("rgb") else bgr
    picture = np.concatenate([color, alpha], axis=2) if encoding.endswith("a8") else color
    return np.ascontiguousarray(picture)


def as_bgr(pixels: np.ndarray, encoding: str) -> np.ndarray:
    """Return what a compressed picture of these pixels shows; alpha is not in a JPEG."""
    if encoding.startswith("mono"):
        return pixels
    color = pixels[:, :, :3]
    return color[:, :, ::-1] if encoding.startswith("rgb") else color


def decoded(payload: bytes) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(payload, np.uint8), cv2.IMREAD_UNCHANGED)


def from_raw(message: Message) -> np.ndarray:
    """Read raw pixels as a stranger would, by the header's words."""
    header = message.header
    encoding = header["encoding"]
    channels = {"mono8": 1, "mono16": 1, "bgr8": 3, "rgb8": 3, "bgra8": 4, "rgba8": 4}[encoding]
    flat = np.frombuffer(message.payload, "<u2" if encoding == "mono16" else np.uint8)
    shape = (header["height"], header["width"], channels)
    return flat.reshape(shape if channels > 1 else shape[:2])


def check_compressed(compressed: Message, pixels: np.ndarray, encoding: str) -> None:
    shown, expected = decoded(compressed.payload), as_bgr(pixels, encoding)
    assert compressed.header["encoding"] == encoding
    if encoding == "mono16":
        assert compressed.encoding == "image/png"
        assert shown.dtype == np.uint16
        assert np.array_equal(shown, expected)
        return
    assert compressed.encoding == "image/jpeg"
    assert shown.shape == expected.shape
    # Quality 80 on a smooth picture with one sharp square: a few grey levels on average.
    assert np.abs(shown.astype(int) - expected).mean() < 4


def header_now(seq: int, epoch: int, encoding: str) -> Header:
    changes = {"width": WIDTH, "height": HEIGHT, "encoding": encoding}
    return header(seq, epoch, stamp_ns=time.time_ns(), **changes)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_published_pixels_arrive_exactly_on_the_raw_key(connection, client, encoding):
    pixels = pixels_in(encoding)
    raws, images = Listener(client, RAW), Listener(client, COMPRESSED)
    epoch, numbers = time.time_ns(), iter(range(1_000_000))

    def sent() -> bool:
        node.publish_picture(
            "image/compressed", Frame(header_now(next(numbers), epoch, encoding), pixels)
        )
        return bool(raws.messages and images.messages)

    with Node("camera", connection=connection, publishes=["image/compressed", "image"]) as node:
        wait_until(sent)
    raw = raws.messages[0]
    assert raw.encoding == "application/octet-stream;vision.Image.v1"
    assert raw.header["encoding"] == encoding
    assert raw.payload == pixels.tobytes()
    check_compressed(images.messages[0], pixels, encoding)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_node_that_takes_the_raw_key_gets_the_pixels_exactly(connection, client, encoding):
    pixels = pixels_in(encoding)
    sent = header_now(0, time.time_ns(), encoding)

    def put() -> None:
        client.put(
            RAW,
            pixels.tobytes(),
            encoding="application/octet-stream;vision.Image.v1",
            attachment=sent.to_bytes(),
        )

    with Node("taker", connection=connection) as node, Paced(50, put):
        for frame in in_time(node, node.frames("image", want="pixels", max_age_s=30)):
            assert np.array_equal(frame.pixels, pixels)
            assert frame.bgr.shape == (HEIGHT, WIDTH, 3)
            assert frame.gray.shape == (HEIGHT, WIDTH)
            return
    pytest.fail("no frame came")


@pytest.mark.parametrize("encoding", ["mono16", "rgb8", "bgra8"])
def test_a_folder_of_pngs_arrives_exactly_on_the_raw_key(client, service, tmp_path, encoding):
    folder = tmp_path / "pictures"
    folder.mkdir()
    pixels = pixels_in(encoding)
    for number in range(3):
        stored = np.roll(pixels, 5 * number, axis=1)
        if encoding in ("rgb8", "rgba8"):  # a PNG is written from BGR
            order = [2, 1, 0, 3][: stored.shape[2]]
            stored = stored[:, :, order]
        assert cv2.imwrite(str(folder / f"{number}.png"), stored)
    raws, images = Listener(client, RAW), Listener(client, COMPRESSED)
    service("camera", "--source", folder, "--encoding", encoding, "--loop", "--rate", 20)
    wait_until(lambda: len(raws.messages) >= 8 and len(images.messages) >= 8)
    for raw in raws.messages:
        number = raw.header["seq"] % 3
        expected = read(folder / f"{number}.png", encoding)
        assert raw.header["encoding"] == encoding
        assert np.array_equal(from_raw(raw), expected)
    for image in images.messages:
        check_compressed(image, read(folder / f"{image.header['seq']}.png", encoding), encoding)
    check_compressed(
        snapshot := newest(client, COMPRESSED),
        read(folder / f"{snapshot.header['seq']}.png", encoding),
        encoding,
    )


def read(path: Path, encoding: str) -> np.ndarray:
    """Read a picture as OpenCV does, in the encoding's channel order."""
    stored = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if encoding in ("rgb8", "rgba8"):
        return np.ascontiguousarray(stored[:, :, [2, 1, 0, 3][: stored.shape[2]]])
    return np.asarray(stored)


def test_a_camera_of_colours_takes_no_encoding_of_depth_at_its_start_or_later(
    connection, client, service, tmp_path
):
    assert cv2.imwrite(str(tmp_path / "colour.png"), scene(7))
    refused = "encoding = 16UC1 is depth, but the source delivers bgr8"
    flags = ("--source", tmp_path, "--loop", "--rate", 20)
    with pytest.raises(ConfigurationError, match=f"{refused}; allowed: mono8, mono16, bgr8"):
        run(CameraSettings(source=str(tmp_path), encoding="16UC1"), connection)

    images = Listener(client, COMPRESSED)
    service("camera", *flags)
    images.wait_for(1)
    wish = msgpack.packb("16UC1")
    (answer,) = client.get("@vision/set/camera_front/encoding", payload=wish)
    assert msgpack.unpackb(answer.err.payload.to_bytes())["error"] == refused


def test_an_encoding_set_before_the_first_picture_drops_frames_and_ends_no_camera(
    connection, client, tmp_path
):
    may_read = threading.Event()

    class Slow:
        """A source whose first picture comes when the test says so, and whose second is none."""

        description, live, rate_hz = "slow", False, 30.0

        def __init__(self) -> None:
            self.pictures = [TimedPicture(PixelPicture(scene(7)))]

        def read(self) -> TimedPicture | None:
            assert may_read.wait(30)
            return self.pictures.pop() if self.pictures else None

        def close(self) -> None:
            may_read.set()

    settings = CameraSettings(source=str(tmp_path), stall_after=60)
    health = Listener(client, "@vision/diagnostics/camera_front")
    with ThreadPoolExecutor(1) as beside:
        running = beside.submit(run, settings, connection, lambda *_: Slow())
        wish = msgpack.packb("16UC1")
        key = "@vision/set/camera_front/encoding"
        (answer,) = wait_until(lambda: list(client.get(key, payload=wish)))
        assert answer.ok, answer.err.payload.to_bytes()
        may_read.set()
        running.result(30)
    dropped = [
        each.body["counters"].get("dropped.unsupported_encoding") for each in health.messages
    ]
    assert dropped[-1] == 1
