"""What people change: by ``.env``, by the override files, each seen to act."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
import zenoh

from tests.support import detector_models
from tests.support.containers.stack import OURS, Stack, run
from tests.support.containers.witness import Witness, opened
from tests.support.listening import Listener, newest, wait_for_nodes
from tests.support.pictures.encoded import write_video
from tests.support.processes import Program, missing
from tests.support.programs import rtsp_camera
from tests.support.routing import Router, free_port
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.compose, pytest.mark.timeout(1500)]
RTSP_SERVER = Path(rtsp_camera.__file__)


@pytest.fixture(scope="module")
def gateway(image: str) -> str:
    """This machine's address as containers on Docker's own bridge see it."""
    shown = run("ip", "-4", "-o", "address", "show", "docker0")
    found = re.search(r"inet ([\d.]+)/", shown)
    assert found, shown
    return found[1]


def connected(stack: Stack) -> zenoh.Session:
    return wait_until(lambda: opened(stack.endpoint), 60)


def test_quality_rate_size_and_namespace_by_env(new_stack):
    stack = new_stack(
        ZV_NAMESPACE="yard", ZV_CAMERA="gate", ZV_CAMERA_RATE="10", ZV_CAMERA_QUALITY="30",
        ZV_CAMERA_WIDTH="320", ZV_CAMERA_HEIGHT="240", ZV_EDGE_FORMAT="jpeg",
    )  # fmt: skip
    with connected(stack) as session:
        frame = newest(session, "yard/gate/image/compressed", 60)
        assert (frame.header["width"], frame.header["height"]) == (320, 240)
        pixels = cv2.imdecode(np.frombuffer(frame.payload, np.uint8), cv2.IMREAD_COLOR)
        assert pixels.shape == (240, 320, 3)
        # The standard's table at quality 30 scales its first entry, 16, by 5000 / 30 percent.
        table = frame.payload.index(b"\xff\xdb") + 5
        assert frame.payload[table] == (16 * (5000 // 30) + 50) // 100
        edges = newest(session, "yard/gate/edges/compressed", 60)
        assert edges.encoding == "image/jpeg"
        arrivals = Listener(session, "yard/gate/centroid")
        found = arrivals.wait_for(30, 30)
        took_s = (found[29].header["stamp_ns"] - found[0].header["stamp_ns"]) / 1e9
        numbers = found[29].header["seq"] - found[0].header["seq"]
        assert 9 < numbers / took_s < 11


def test_a_video_file_that_is_mounted(new_stack, tmp_path: Path):
    tmp_path.chmod(0o755)
    video = write_video(tmp_path / "square.avi", frames=20, rate_hz=30)
    video.chmod(0o644)
    stack = new_stack("video", ZV_VIDEO=str(video), ZV_CAMERA_LOOP="true")
    with connected(stack) as session:
        first = newest(session, "vision/front/image/compressed", 60)
        capture = cv2.VideoCapture(str(video))
        size = capture.get(cv2.CAP_PROP_FRAME_WIDTH), capture.get(cv2.CAP_PROP_FRAME_HEIGHT)
        assert (first.header["width"], first.header["height"]) == size
        wait_until(  # over and over, each time in an epoch of its own
            lambda: (
                newest(session, "vision/front/centroid").header["epoch"] > first.header["epoch"]
            ),
            30,
        )


def test_a_video_that_is_over_has_ended_well(new_stack, tmp_path: Path):
    tmp_path.chmod(0o755)
    video = write_video(tmp_path / "square.avi", frames=20, rate_hz=30)
    stack = new_stack("video", ZV_VIDEO=str(video))
    wait_until(lambda: stack.inspect("camera")["State"]["Status"] == "exited", 60)
    found = stack.inspect("camera")
    assert (found["State"]["ExitCode"], found["RestartCount"]) == (0, 0)


def test_a_video_that_cannot_be_read_says_so(new_stack, tmp_path: Path):
    tmp_path.chmod(0o755)
    secret = tmp_path / "secret.avi"
    secret.write_bytes(b"x")
    secret.chmod(0o600)
    stack = new_stack("video", ZV_VIDEO=str(secret))
    wait_until(lambda: "/video: " in stack.logs("camera"), 60)
    assert "Traceback" not in stack.logs("camera")


def test_a_model_that_is_mounted(new_stack, tmp_path: Path):
    tmp_path.chmod(0o755)
    pictures, models = tmp_path / "pictures", tmp_path / "models"
    for folder in (pictures, models):
        folder.mkdir()
        folder.chmod(0o755)
    for step in range(40):
        box = 20 + 4 * step, 60, 60 + 4 * step, 140
        cv2.imwrite(str(pictures / f"{step:02}.png"), detector_models.scene({1: box}, (320, 240)))
    detector_models.save(models / "tiny.onnx", "yolov8")
    for file in (*pictures.iterdir(), *models.iterdir()):
        file.chmod(0o644)
    stack = new_stack(
        "video", "model",
        ZV_VIDEO=str(pictures), ZV_CAMERA_LOOP="true", ZV_CAMERA_RATE="15",
        ZV_MODELS=str(models), ZV_TRACKER_MODEL="/models/tiny.onnx",
    )  # fmt: skip
    with connected(stack) as session:
        tracks = Listener(session, "vision/front/tracks")

        def classes() -> set[str]:
            return {each["class"] for found in tracks.messages for each in found.body["tracks"]}

        wait_until(classes, 60)
        assert classes() == {"green"}
    assert "model tiny.onnx by OpenCV on cpu, layout yolov8" in stack.logs("tracker")


def test_a_model_that_is_not_there_is_named(new_stack, tmp_path: Path):
    tmp_path.chmod(0o755)
    stack = new_stack(
        "model", services=("router", "tracker"),
        ZV_MODELS=str(tmp_path), ZV_TRACKER_MODEL="/models/none.onnx",
    )  # fmt: skip
    wait_until(lambda: "/models/none.onnx: No such file" in stack.logs("tracker"), 60)


def test_two_cameras_each_with_its_tracker(new_stack):
    stack = new_stack("two-cameras")
    keys = [f"vision/{camera}/{suffix}" for camera in ("front", "back")
            for suffix in ("image/compressed", "centroid")]  # fmt: skip
    with Witness(stack.endpoint, keys) as witness:
        witness.flows(10)
        front, back = (
            newest(witness.session, f"vision/{camera}/image/compressed")
            for camera in ("front", "back")
        )
    pictures = [
        cv2.imdecode(np.frombuffer(one.payload, np.uint8), cv2.IMREAD_COLOR)
        for one in (front, back)
    ]
    assert np.abs(pictures[0].astype(int) - pictures[1]).mean() > 5  # two scenes
    names = run(
        "docker", "ps", "-q", "--filter", f"label=com.docker.compose.project={stack.project}"
    )
    assert len(names.split()) == 7  # router, viewer, edge detector, and two of camera and tracker


def test_curl_gets_the_newest_frame_from_the_rest_port(new_stack, tmp_path: Path):
    port = free_port()
    stack = new_stack("rest", ZV_REST_PORT=str(port))
    with Witness(stack.endpoint) as witness:
        witness.flows(10)
        file = tmp_path / "frame.jpg"
        url = f"http://127.0.0.1:{port}/vision/front/image/compressed?_raw=true"

        def got() -> bool:
            run("curl", "-s", "-o", file, url, check=False)
            return file.exists() and file.read_bytes().startswith(b"\xff\xd8")

        wait_until(got, 30)
        arrivals = Listener(witness.session, "vision/front/image/compressed")
        arrivals.wait_for(10)
        run("curl", "-sf", "-o", file, url)
        newest_few = [message.payload for message in arrivals.wait_for(12)[-15:]]
        assert file.read_bytes() in newest_few
        pixels = cv2.imdecode(np.frombuffer(file.read_bytes(), np.uint8), cv2.IMREAD_COLOR)
        assert pixels.shape == (480, 640, 3)
        bound = stack.inspect("router")["NetworkSettings"]["Ports"]["8000/tcp"]
        assert [one["HostIp"] for one in bound] == ["127.0.0.1"]


def test_nodes_at_a_router_elsewhere(new_stack, gateway: str, tmp_path: Path):
    router = Router(tmp_path)
    listen = f"tcp/{gateway}:{router.port}"
    with Program(["-m", "zv", "router", "--listen", listen], tmp_path, "router"):
        stack = new_stack("remote-router", ZV_COMPOSE_CONNECT=listen)
        with wait_until(lambda: opened(listen), 60, lambda: listen) as session:
            wait_for_nodes(session, *(f"{service}_front" for service in OURS), deadline_s=60)
            newest(session, "vision/front/centroid", 60)
        running = stack.compose("ps", "--services", "--filter", "status=running")
        assert "router" not in running.split()
        stack.compose("stop")


def test_without_the_routers_address_the_override_says_what_is_missing(clone: Path, docker):
    stack = Stack(clone, ["remote-router"])
    with pytest.raises(AssertionError, match="set ZV_COMPOSE_CONNECT to the router"):
        stack.compose("config")


def test_an_rtsp_camera(new_stack, gateway: str, tmp_path: Path):
    command = ["/usr/bin/python3", RTSP_SERVER, gateway]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout
            port = server.stdout.readline().strip()
            if not port:
                missing("GStreamer's bindings; see tests/support/programs/rtsp_camera.py")
            stack = new_stack(ZV_CAMERA_SOURCE=f"rtsp://viewer:secret@{gateway}:{port}/locked")
            with connected(stack) as session:
                frame = newest(session, "vision/front/centroid", 60)
                assert (frame.header["width"], frame.header["height"]) == (320, 240)
            assert "secret" not in stack.logs("camera")
        finally:
            server.kill()


def test_the_webcam_override_hands_over_the_device_and_its_group(clone: Path, docker):
    # No machine of this project's CI has a camera: what Compose makes of the file is tested, and
    # that a device which is none is refused with words.
    settings = {"ZV_DEVICE": "/dev/video7", "ZV_VIDEO_GROUP": "985"}
    text = Stack(clone, ["webcam"], settings).compose("config")
    block = re.search(r"^  camera:\n(.*?)(?=^  \w)", text, re.MULTILINE | re.DOTALL)
    assert block
    device = r"/dev/video7:/dev/video0|source: /dev/video7\s+target: /dev/video0"
    assert re.search(device, block[1])
    assert re.search(r"group_add:\s+- '?\"?985", block[1])
    assert re.search(r"ZV_CAMERA_SOURCE: ['\"]0['\"]", block[1])


def test_a_device_that_is_no_camera_is_refused_with_words(new_stack):
    stack = new_stack("webcam", ZV_DEVICE="/dev/null")
    wait_until(lambda: "/dev/video0" in stack.logs("camera"), 60)
    assert "Traceback" not in stack.logs("camera")
