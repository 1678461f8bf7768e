"""``/stream`` and ``/snapshot``: original bytes, one subscription, the newest only."""

from __future__ import annotations

import http.client
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from email.utils import parsedate_to_datetime
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest
import zenoh

from tests.integration.conftest import Service
from tests.support.fork_server import ZV
from tests.support.listening import wait_for_nodes
from tests.support.pictures.videos import with_orientation
from tests.support.processes import STOP_S, Program
from tests.support.publishing import PlainCamera
from tests.support.routing import Router, free_port
from tests.support.typist import zv
from tests.support.viewer.client import IMAGE, Answer, Part, Viewer, parts
from tests.support.waiting import wait_until
from zenoh_vision.image import codecs
from zenoh_vision.testing import first_picture

TOPIC = "topic=/front/image/compressed"
GET_STREAM = f"GET /stream?{TOPIC} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()


def until_there(viewer: Viewer, topic: str = TOPIC) -> None:
    wait_until(lambda: viewer.get(f"/snapshot?{topic}").status == 200)


def subscribers(session: zenoh.Session, key: str) -> int:
    """How many entries the router's admin space has for subscriptions to a key: 0 or 1.

    Zenoh 1.10 can hang a router that is asked while something is being declared, so ask seldom.
    """
    threading.Event().wait(0.25)
    found = list(session.get(f"@/*/router/subscriber/{key}", timeout=2.0))
    return len([reply for reply in found if reply.ok])


def test_the_only_picture_of_a_program_that_is_no_node_is_in_its_stream(service, client):
    viewer = Viewer(service("view", "--port", 0, "--wait", 60))
    camera = PlainCamera(client)

    def send() -> None:
        wait_until(lambda: subscribers(client, IMAGE))  # that of the viewer
        camera.send()

    with ThreadPoolExecutor(1) as beside:
        sent = beside.submit(send)
        with viewer.stream(TOPIC) as pictures:
            assert next(pictures).seq == 0
        sent.result()


def pixels_of(part: Part) -> np.ndarray:
    return cv2.imdecode(np.frombuffer(part.body, np.uint8), cv2.IMREAD_GRAYSCALE)


@pytest.fixture(scope="module")
def shown(standing_service: Service) -> Viewer:
    """A viewer with a camera and its edges, for all tests that leave no trace in it."""
    standing_service("camera", "--rate", 15, "--width", 640, "--height", 480)
    standing_service("edge")
    return Viewer(standing_service("view", "--port", 0))


@pytest.mark.parametrize(
    ("query", "mime", "size"),
    [
        ("topic=/front/image&width=320&height=200", "image/jpeg", (200, 320)),
        ("topic=/front/image&type=png", "image/png", (480, 640)),
        ("topic=/front/edges", "image/jpeg", (480, 640)),
    ],
)
def test_pictures_come_in_the_form_that_is_asked_for(shown, query, mime, size):
    until_there(shown, query.partition("&")[0])
    with shown.stream(query) as pictures:
        part = next(pictures)
    assert part.headers["content-type"] == mime
    pixels = cv2.imdecode(np.frombuffer(part.body, np.uint8), cv2.IMREAD_UNCHANGED)
    assert pixels.shape[:2] == size
    answer = shown.get(f"/snapshot?{query}")
    assert answer.headers["content-type"] == mime


def test_the_tracker_draws_only_while_somebody_looks(viewer, service, client):
    service("camera", "--rate", 15)
    service("tracker")
    key = "vision/front/tracked/compressed"
    until_there(viewer, "topic=/front/tracked")
    wait_until(lambda: subscribers(client, key) == 0)  # a snapshot may have waited for a frame
    with viewer.stream("topic=/front/tracked") as pictures:
        assert next(pictures).seq < next(pictures).seq
        wait_until(lambda: subscribers(client, key) == 1)
    wait_until(lambda: subscribers(client, key) == 0)


def test_a_client_that_stops_reading_delays_nobody_and_then_sees_the_newest(viewer, client):
    noise = np.random.default_rng(1).integers(0, 255, (480, 640, 3), np.uint8)
    picture = codecs.encode_jpeg(noise, "bgr8", 90)  # 300 kB: buffers fill soon
    camera = PlainCamera(client, pictures=(picture,))
    with camera.at(60), viewer.deaf() as stalled:
        until_there(viewer)
        stalled.sendall(GET_STREAM)
        with viewer.stream(TOPIC) as pictures:
            first = next(pictures).seq
            while next(pictures).seq < first + 120:  # 2 s at 60 Hz
                pass
            newest = camera.seq
            while next(pictures).seq < newest:  # it is not far behind, and for ever
                pass
            # What the other gets when it reads on: what was in buffers, then the newest.
            reader = http.client.HTTPResponse(stalled)
            reader.begin()
            found = parts(reader)
            seen = [next(found).seq for _ in range(12)]
    assert seen == sorted(set(seen))
    assert max(b - a for a, b in pairwise(seen)) > 60, "nothing of 120 pictures was skipped"


def test_a_client_that_takes_nothing_any_more_is_left_and_its_subscription_ends(
    quick_service, client
):
    viewer = Viewer(quick_service("view", "--port", 0))  # which leaves after 2 s instead of 20
    noise = np.random.default_rng(1).integers(0, 255, (720, 1280, 3), np.uint8)
    camera = PlainCamera(client, pictures=(codecs.encode_jpeg(noise, "bgr8", 95),))  # > 1 MB
    with camera.at(15), ExitStack() as clients:
        until_there(viewer)
        stalled = clients.enter_context(viewer.deaf())
        stalled.sendall(GET_STREAM)
        wait_until(lambda: subscribers(client, IMAGE) == 1)
        wait_until(lambda: subscribers(client, IMAGE) == 0)


def test_a_snapshot_says_which_frame_it_is_and_how_old(shown):
    until_there(shown)
    answer = wait_until(lambda: fresh_snapshot(shown))
    assert codecs.picture_size(answer.body) == (640, 480)
    headers = answer.headers
    assert headers["content-type"] == "image/jpeg"
    assert 0 < float(headers["x-age-ms"]) <= (time.time_ns() - int(headers["x-stamp-ns"])) / 1e6
    assert headers["x-camera"] == "front"
    assert int(headers["x-epoch"]) <= int(headers["x-stamp-ns"]) <= time.time_ns()
    modified = parsedate_to_datetime(headers["last-modified"]).timestamp()
    assert abs(modified - int(headers["x-stamp-ns"]) / 1e9) <= 1
    assert headers["cache-control"] == "no-store"
    later = wait_until(
        lambda: (
            (new := shown.get(f"/snapshot?{TOPIC}")).headers["x-seq"] != headers["x-seq"] and new
        )
    )
    assert later.headers["etag"] != headers["etag"]


def fresh_snapshot(viewer: Viewer) -> Answer | None:
    """Return the newest picture, unless a busy machine has made it old."""
    answer = viewer.get(f"/snapshot?{TOPIC}")
    return answer if float(answer.headers["x-age-ms"]) < 2000 else None


def test_a_picture_that_says_how_it_was_held_has_one_orientation_everywhere(
    viewer: Viewer, client: zenoh.Session, router: Router, tmp_path: Path
):
    """That of its header and of what trackers find; browsers would turn it."""
    stored = codecs.encode_jpeg(np.zeros((48, 64, 3), np.uint8), "bgr8", 90)
    turned = with_orientation(stored, 6)
    assert cv2.imdecode(np.frombuffer(turned, np.uint8), cv2.IMREAD_COLOR).shape == (64, 48, 3)
    file = tmp_path / "snapshot.jpg"
    with PlainCamera(client, pictures=(turned,)).at(15):
        until_there(viewer)
        with viewer.stream(TOPIC) as pictures:
            streamed = next(pictures).body
        assert zv(router.endpoint, "snapshot", IMAGE, "-o", str(file)).returncode == 0
        assert first_picture(router.endpoint).bgr.shape == (48, 64, 3)
        for found in (streamed, viewer.get(f"/snapshot?{TOPIC}").body, file.read_bytes()):
            assert cv2.imdecode(np.frombuffer(found, np.uint8), cv2.IMREAD_COLOR).shape[0] == 48


def test_what_does_not_exist_is_404_with_what_does(shown, standing_viewer):
    until_there(standing_viewer)
    wait_until(lambda: "there are: " in standing_viewer.get("/snapshot?topic=/front/nosuch").text)
    for path in ("stream", "snapshot"):
        answer = standing_viewer.get(f"/{path}?topic=/front/nosuch")
        assert answer.status == 404
        assert IMAGE in answer.text
        assert "truth" not in answer.text  # which is no picture
        assert answer.text.count("\n") == 1


def test_a_page_with_one_stream_names_it_and_escapes_what_it_was_given(standing_viewer):
    answer = standing_viewer.get(f"/stream_viewer?{TOPIC}&width=320&type=png")
    assert answer.status == 200
    source = "stream?topic=%2Ffront%2Fimage%2Fcompressed&amp;width=320&amp;type=png"
    assert f'<img src="{source}"' in answer.text
    assert standing_viewer.get("/stream_viewer?topic=%22%3E%3Cscript%3E").status == 400
    refused = standing_viewer.get(f"/stream_viewer?{TOPIC}&width=-3")
    assert (refused.status, refused.text[:27]) == (400, "width = '-3' is not allowed")


def test_streams_go_on_when_the_camera_was_away(viewer, service):
    camera = service("camera", "--rate", 15)
    until_there(viewer)
    with viewer.stream(TOPIC) as pictures:
        before = next(pictures)
        epoch = before.headers["x-epoch"]
        camera.process.kill()
        camera.process.wait(STOP_S)
        while "x-ended-ns" not in (last := next(pictures)).headers:
            before = last
        assert last.seq == before.seq
        assert pixels_of(last).shape == pixels_of(before).shape
        assert pixels_of(last).mean() < pixels_of(before).mean() / 2
        stamp_ns = float(before.headers["x-timestamp"]) * 1e9
        assert stamp_ns <= int(last.headers["x-ended-ns"]) + 1e3 <= time.time_ns()
        service("camera", "--rate", 15)
        while next(pictures).headers["x-epoch"] == epoch:
            pass


def test_two_viewers_of_one_system_are_two_nodes(service: Service, client: zenoh.Session):
    for name in ("north", "south"):
        service("view", "--port", 0, "--name", name)
    wait_for_nodes(client, "viewer_north", "viewer_south")


def test_pages_are_served_before_there_is_a_router_and_it_ends_with_0(tmp_path):
    nowhere = f"tcp/127.0.0.1:{free_port()}"
    arguments = ["view", "--port", "0", "--wait", "0.2", "--connect", nowhere]
    with Program(arguments, tmp_path, "view", forked=ZV) as program:
        viewer = Viewer(program)
        assert viewer.get("/").status == 200
        assert viewer.get("/healthz").text == "ok\n"
        answer = viewer.get(f"/snapshot?{TOPIC}")
        assert answer.status == 503
        assert "no router" in answer.text
        assert program.interrupt() == 0
        assert program.complaints == ""


def test_told_to_stop_it_ends_with_0_whatever_its_clients_do(viewer, client):
    camera = PlainCamera(client)
    with camera.at(15), ExitStack() as clients:
        until_there(viewer)
        for _ in range(5):
            next(clients.enter_context(viewer.stream(TOPIC)))
            clients.enter_context(viewer.deaf()).sendall(GET_STREAM)
        assert viewer.program.interrupt() == 0
    (line,) = viewer.program.complaints.splitlines()
    assert "connected to the router at" in line
