"""A region of a running camera while consumers of each kind look on; what replies may cost."""

from __future__ import annotations

import time
from pathlib import Path
from statistics import mean

import cv2
import msgpack
import numpy as np
import pytest
import zenoh

from tests.support.listening import Listener, Message, newest, wait_for_nodes
from tests.support.pictures.encoded import jpeg
from tests.support.processes import START_S
from tests.support.waiting import in_time, wait_until
from zenoh_vision import Node
from zenoh_vision.calibration.calibration import Calibration
from zenoh_vision.calibration.camera_model import CameraModel
from zenoh_vision.calibration.ros_yaml import write_calibration
from zenoh_vision.messages import CameraInfo
from zenoh_vision.shm.machine import why_impossible

RAW, COMPRESSED = "vision/front/image", "vision/front/image/compressed"
PARAMETER = "@vision/set/camera_front/region"
REGION = "101,50,100,80"
PART = (slice(50, 130), slice(101, 201))
WAYS = ["jpeg", "raw", pytest.param("shm", marks=pytest.mark.skipif(
    bool(why_impossible()), reason=why_impossible() or "-"))]  # fmt: skip


@pytest.fixture
def whole() -> np.ndarray:
    """A picture without two equal parts."""
    noise = np.random.default_rng(8).integers(40, 200, (15, 20, 3), np.uint8)
    return np.asarray(cv2.resize(noise, (320, 240), interpolation=cv2.INTER_CUBIC), np.uint8)


@pytest.fixture
def folder(tmp_path: Path, whole: np.ndarray) -> Path:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for number in range(3):
        assert cv2.imwrite(str(pictures / f"{number}.png"), whole)
    return pictures


def set_region(client: zenoh.Session, value: str) -> dict[str, str]:
    """Set it; return the refusal, or nothing."""
    (reply,) = client.get(PARAMETER, payload=msgpack.packb(value), timeout=10.0)
    return msgpack.unpackb(reply.err.payload.to_bytes()) if reply.err is not None else {}


def with_size(messages: list[Message], width: int, height: int) -> list[Message]:
    """Return those whose header says this size."""
    return [m for m in messages if (m.header["width"], m.header["height"]) == (width, height)]


def test_while_it_is_set_only_the_region_is_sent(client, service, folder: Path, whole, tmp_path):
    lens = CameraModel(320, 240, (250.0, 0, 160, 0, 250, 120, 0, 0, 1), "plumb_bob", (0.0,) * 5)
    write_calibration(Calibration(lens), tmp_path / "front.yaml")
    raws, images = Listener(client, RAW), Listener(client, COMPRESSED)
    told = Listener(client, "vision/front/camera_info")
    options = ("--loop", "--rate", 20, "--calibration", tmp_path / "front.yaml")
    camera = service("camera", "--source", folder, *options)
    before = images.wait_for(5, START_S)
    assert set_region(client, REGION) == {}
    wait_until(lambda: len(with_size(images.messages, 100, 80)) >= 5)
    wait_until(lambda: len(with_size(raws.messages, 100, 80)) >= 5)
    for raw in with_size(raws.messages, 100, 80):
        assert raw.payload == whole[PART].tobytes()
    after = with_size(images.messages, 100, 80)
    for image in after:
        shown = cv2.imdecode(np.frombuffer(image.payload, np.uint8), cv2.IMREAD_COLOR)
        assert np.abs(shown.astype(int) - whole[PART]).mean() < 4
    # A tenth of the pixels, in JPEGs whose tables take 0.6 kB.
    sizes = [mean(len(each.payload) for each in these) for these in (before, after)]
    assert sizes[1] < 0.2 * sizes[0]
    info = CameraInfo.from_bytes(newest(client, "vision/front/camera_info").payload)
    assert (info.width, info.height, info.k[2], info.k[5]) == (100, 80, 59, 70)
    assert f"published from now on: region {REGION} of 320x240" in camera.complaints

    refusal = set_region(client, "300,0,21,10")
    assert refusal == {
        "error": "region = 300,0,21,10 is not within the picture of 320x240",
        "allowed": "X + WIDTH at most 320, Y + HEIGHT at most 240",
    }
    seen = len(images.messages)
    assert set_region(client, "") == {}
    wait_until(lambda: with_size(images.messages[seen:], 320, 240))
    wait_until(lambda: CameraInfo.from_bytes(told.messages[-1].payload).width == 320)


@pytest.mark.parametrize("way", WAYS)
def test_a_service_sees_the_change_on_every_way(
    connection, client, service, folder, whole, way: str
):
    service("camera", "--source", folder, "--loop", "--rate", 20)
    with Node("taker", connection=connection) as node:
        frames = in_time(node, iter(node.frames(want="pixels", transport=way)), START_S)
        assert next(frames).pixels.shape == (240, 320, 3)
        wait_for_nodes(client, "camera_front")  # another session than the one that has a frame
        assert set_region(client, REGION) == {}
        frame = next(frame for frame in frames if frame.header.width == 100)
        assert frame.pixels.shape == (80, 100, 3)
        assert np.abs(frame.pixels.astype(int) - whole[PART]).mean() < (
            4 if way == "jpeg" else 1e-9
        )
        assert frame.header.revision == 1


def test_jpegs_of_the_source_are_passed_on_only_without_a_region(client, service, tmp_path, whole):
    packets = {jpeg(np.roll(whole, shift, axis=0)) for shift in range(3)}
    video = tmp_path / "pictures.mjpeg"
    video.write_bytes(b"".join(packets))
    images = Listener(client, COMPRESSED)
    camera = service("camera", "--source", video, "--loop", "--rate", 20)
    assert {each.payload for each in images.wait_for(3, START_S)} <= packets
    assert set_region(client, REGION) == {}
    wait_until(lambda: with_size(images.messages, 100, 80))
    assert "its JPEGs are encoded again" in camera.complaints
    seen = len(images.messages)
    assert set_region(client, "") == {}
    wait_until(lambda: {each.payload for each in images.messages[seen:]} & packets)


def test_a_camera_does_not_start_with_a_region_outside_of_its_pictures(service, folder: Path):
    camera = service("camera", "--source", folder, "--region", "0,0,320,241")
    assert camera.process.wait(START_S) == 2
    assert "region = 0,0,320,241 is not within the picture of 320x240" in camera.complaints


KEY = "vision/front/image/compressed"
BUDGET = 10_000  # bytes a second
SECONDS = 2.0


def test_a_flood_of_queries_takes_no_more_than_the_budget(client, service):
    service("camera", "--max-kbps", BUDGET * 8 // 1000, "--rate", 20)
    wait_until(lambda: list(client.get(KEY, timeout=5.0)))
    assert newest(client, "vision/front/image").payload, "raw pixels are not charged"
    sizes, refusals = [], []
    begun_s = time.monotonic()
    while time.monotonic() - begun_s < SECONDS:
        for reply in client.get(KEY, timeout=5.0):  # none, if the machine is too busy
            if reply.ok is not None:
                sizes.append(len(reply.ok.payload))
            else:
                refusals.append(reply.err.payload.to_bytes().decode())
        time.sleep(0.02)
    took_s = time.monotonic() - begun_s
    # The first is paid for later: it may begin while the one before it is not.
    assert sum(sizes[:-1]) <= BUDGET * took_s
    assert len(refusals) > len(sizes)
    words = "max_kbps = 80 is used up by earlier replies; ask again in"
    assert any(words in refusal for refusal in refusals)
