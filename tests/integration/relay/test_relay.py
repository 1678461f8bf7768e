"""zv relay: a second stream with the identity of the first, or of a camera of its own."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import msgpack
import numpy as np
import pytest

from tests.integration.conftest import Service, a_router, some_services
from tests.support.listening import Listener, open_client, wait_for_nodes
from tests.support.typist import zv
from tests.support.waiting import wait_until

RELAYED = "vision/front/relayed/compressed"
LENS = """\
image_width: 320
image_height: 240
camera_name: front
camera_matrix: {rows: 3, cols: 3, data: [250, 0, 165, 0, 248, 118, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.25, 0.08, 0.001, -0.0008, 0]}
projection_matrix: {rows: 3, cols: 4, data: [230, 0, 160, 0, 0, 231, 122, 0, 0, 0, 1, 0]}
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Service]]:
    """A camera of 320x240 at 20 Hz with a calibration; its router's endpoint."""
    folder = tmp_path_factory.mktemp("relay")
    (folder / "lens.yaml").write_text(LENS)
    size = ("--width", 320, "--height", 240, "--rate", 20)
    with a_router(folder) as router, some_services(router.endpoint, folder) as start:
        start("camera", *size, "--calibration", folder / "lens.yaml")
        with open_client(router.endpoint) as session:
            wait_for_nodes(session, "camera_front")
        yield router.endpoint, start


def test_pictures_are_slower_and_smaller_and_keep_identity_and_coordinates(site):
    endpoint, start = site
    program = start("relay", "vision/front/image/compressed", "--rate", 5, "--scale", 0.5)
    with open_client(endpoint) as session:
        wait_for_nodes(session, "relay_front")
        originals = Listener(session, "vision/front/image/compressed")
        relayed = Listener(session, RELAYED)
        relayed.wait_for(8)
        headers = [message.header for message in relayed.messages]
        stamps = np.array([header["stamp_ns"] for header in headers])
        assert np.median(np.diff(stamps)) == pytest.approx(2e8, rel=0.2)
        assert {(h["camera"], h["width"], h["height"]) for h in headers} == {("front", 320, 240)}

        def stamps_of_both() -> list[tuple[int, int]]:
            # Either may have missed a frame: each is a subscriber that drops what comes too fast.
            first, second = stamps_by_frame(originals), stamps_by_frame(relayed)
            both = [(first[frame], second[frame]) for frame in first.keys() & second]
            return both if len(both) >= 4 else []

        assert all(original == copy for original, copy in wait_until(stamps_of_both))
        shown = cv2.imdecode(np.frombuffer(relayed.messages[-1].payload, np.uint8), 1)
        assert shown.shape == (120, 160, 3)
    program.interrupt()


def test_what_nothing_changes_is_passed_on_byte_for_byte(site):
    endpoint, start = site
    program = start("relay", "--camera", "front")
    with open_client(endpoint) as session:
        wait_for_nodes(session, "relay_front")
        originals = Listener(session, "vision/front/image/compressed")
        relayed = Listener(session, RELAYED)
        relayed.wait_for(6)
        bytes_of = {m.header["seq"]: m.payload for m in originals.messages}
        common = [m for m in relayed.messages if m.header["seq"] in bytes_of]
        assert common
        assert all(m.payload == bytes_of[m.header["seq"]] for m in common)
        done = zv(endpoint, "param", "set", "relay_front", "quality=20")
        assert done.returncode == 0, done.stderr
        least = min(map(len, bytes_of.values()))
        wait_until(lambda: len(relayed.messages[-1].payload) < 0.7 * least)
    program.interrupt()


def test_a_rectified_part_is_a_camera_with_a_calibration_of_its_own(site):
    endpoint, start = site
    program = start(
        *("relay", "--rectify", "--region", "40,30,200,160", "--to", "flat", "--scale", 0.5)
    )
    # As JPEG: in shared memory, reduced pictures have the size of their frame again.
    with open_client(endpoint) as session:
        relayed = Listener(session, "vision/flat/image/compressed")
        relayed.wait_for(1)
    header = relayed.messages[0].header
    assert (header["camera"], header["width"], header["height"]) == ("flat", 200, 160)
    shown = cv2.imdecode(np.frombuffer(relayed.messages[0].payload, np.uint8), 1)
    assert shown.shape == (80, 100, 3)
    assert header["node"] == "relay_flat"
    info = newest_calibration(endpoint)
    assert (info["width"], info["height"], info["d"]) == (200, 160, [])
    assert info["k"][:6] == pytest.approx([230, 0, 120, 0, 231, 92])
    assert info["header"]["camera"] == "flat"
    done = zv(endpoint, "param", "set", "relay_flat", "region=300,0,100,100")
    assert done.returncode == 0

    def is_reported() -> bool:
        said = zv(endpoint, "node", "info", "relay_flat").stdout
        return "is not within the picture of 320x240" in said

    wait_until(is_reported)
    program.interrupt()


def stamps_by_frame(listener: Listener) -> dict[tuple[int, int], int]:
    headers = [message.header for message in listener.messages]
    return {(header["epoch"], header["seq"]): header["stamp_ns"] for header in headers}


def newest_calibration(endpoint: str) -> dict:
    """Return the camera_info of the relay, which it publishes once and answers to queries."""
    found: list[dict] = []

    def asked() -> bool:
        for reply in session.get("vision/flat/camera_info", timeout=2.0):
            if reply.ok:
                found.append(msgpack.unpackb(reply.ok.payload.to_bytes()))
        return bool(found)

    with open_client(endpoint) as session:
        wait_until(asked)
    return found[-1]


def test_without_a_calibration_nothing_is_rectified_and_its_health_says_so(site):
    endpoint, start = site
    start("camera", "--camera", "bare", "--width", 64, "--height", 48, "--rate", 5)
    program = start("relay", "--camera", "bare", "--rectify")
    wait_until(
        lambda: "no camera_info that fits" in zv(endpoint, "node", "info", "relay_bare").stdout
    )
    program.interrupt()


def test_a_key_of_another_namespace_is_wrong_use(site):
    endpoint, _ = site
    done = zv(endpoint, "relay", "other/front/image/compressed")
    assert done.returncode == 2
    assert "is not of the namespace vision" in done.stderr
