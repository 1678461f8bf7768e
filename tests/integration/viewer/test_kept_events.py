"""Events of a viewer that no page has open: kept, found by HTTP, there after a restart."""

from __future__ import annotations

import csv
import io
import itertools
import json
import shlex
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import zenoh

from tests.integration.conftest import Service
from tests.support.listening import wait_for_nodes
from tests.support.typist import zv
from tests.support.viewer.client import Viewer
from tests.support.viewer.event_camera import BOX, EPOCH, Camera, event_camera
from tests.support.waiting import wait_until
from zenoh_vision import Connection, Node
from zenoh_vision.messages import Track, TrackEvent, Tracks
from zenoh_vision.topics import COMPRESSED, EVENTS, TRACKS


@pytest.fixture
def camera(client: zenoh.Session) -> Iterator[Camera]:
    with event_camera(client) as found:
        yield found


def kept(viewer: Viewer, query: str = "") -> list[dict[str, Any]]:
    answer = viewer.get(f"/events?{query}")
    assert answer.status == 200, answer.text
    return json.loads(answer.text)["events"]


def test_an_event_is_found_with_its_picture_after_the_viewer_was_restarted(
    service: Service, client: zenoh.Session, camera: Camera, tmp_path: Path
):
    folder = tmp_path / "kept"
    first = Viewer(service("view", "--port", 0, "--events-dir", folder))
    wait_for_nodes(client, "viewer")
    camera.seq = 3

    def is_kept() -> bool:
        camera.publish(1)  # the same event each time: it is kept once
        return bool(kept(first))

    wait_until(is_kept, poll_s=0.3)
    camera.publish(3, "line_crossed", zone="=gate", direction="left")
    wait_until(lambda: len(kept(first)) == 2)
    assert first.program.interrupt() == 0

    viewer = Viewer(service("view", "--port", 0, "--events-dir", folder))
    crossed, entered = kept(viewer)
    assert (entered["camera"], entered["kind"], entered["zone"]) == (
        "front",
        "zone_entered",
        "belt",
    )
    assert (entered["track"], entered["box"], entered["width"]) == (13, list(BOX), 640)
    assert (entered["frames_later"], crossed["frames_later"]) == (2, 0)
    assert entered["epoch"] == str(EPOCH)
    picture = viewer.get(f"/events/{entered['picture']}.jpg")
    assert picture.headers["content-type"] == "image/jpeg"
    shape = cv2.imdecode(np.frombuffer(picture.body, np.uint8), cv2.IMREAD_COLOR).shape
    assert shape == (240, 320, 3)
    assert [each["seq"] for each in kept(viewer, "kind=line_crossed")] == [3]
    assert kept(viewer, f"since_ns={time.time_ns()}") == kept(viewer, "zone=door") == []
    assert json.loads(viewer.get("/events").text)["choices"]["zone"] == ["=gate", "belt"]
    assert viewer.get("/events?most=0").status == 400
    assert viewer.get("/events/999.jpg").status == 404

    table = viewer.get("/events.csv?camera=front")
    rows = list(csv.DictReader(io.StringIO(table.text)))
    assert [row["kind"] for row in rows] == ["line_crossed", "zone_entered"]
    assert rows[0]["zone"] == "'=gate"  # no formula for a spreadsheet
    assert rows[1]["stamp_ns"] == entered["stamp_ns"]
    assert rows[1]["time"].endswith("+00:00")


def test_a_camera_is_asked_for_pictures_only_when_events_come_and_not_for_each(
    service: Service, client: zenoh.Session, camera: Camera, tmp_path: Path
):
    viewer = Viewer(service("view", "--port", 0, "--events-dir", tmp_path))
    wait_for_nodes(client, "viewer")
    assert not camera.asked
    wait_until(lambda: camera.publish(0) or kept(viewer), poll_s=0.3)
    begin_s, before = time.monotonic(), camera.asked
    for seq in range(1, 201):
        camera.publish(seq)
    wait_until(lambda: len(kept(viewer, "most=1000")) == 201)
    most = 2 + (time.monotonic() - begin_s) / 0.3
    assert camera.asked - before <= most
    assert all(each["picture"] for each in kept(viewer, "most=1000"))
    asked = camera.asked
    later = itertools.count(201)
    wait_until(lambda: camera.publish(next(later)) or camera.asked > asked, poll_s=0.1)


def test_a_picture_is_of_the_frame_of_its_event_and_the_box_of_the_same_frame(
    service: Service, client: zenoh.Session, router, tmp_path: Path
):
    viewer = Viewer(service("view", "--port", 0, "--events-dir", tmp_path))
    wait_for_nodes(client, "viewer")
    own = Connection(router.endpoint)
    shades = [40, 80, 120, 160, 200]
    with Node("camera", connection=own, publishes=[COMPRESSED, TRACKS, EVENTS]) as node:
        wait_until(lambda: node.wanted(EVENTS))
        for shade in shades:
            sent = node.publish_picture(COMPRESSED, np.full((48, 64), shade, np.uint8))
            track = Track(id=1, state="confirmed", x=9.0, y=9.0, box=(shade, 5, 9, 9), area=9.0)
            node.publish(TRACKS, Tracks(header=sent.frame.header, tracks=(track,)))
            if shade == 120:
                header = sent.frame.header
        event = TrackEvent(header=header, event="started", id=1, x=9.0, y=9.0)
        node.publish(EVENTS, event)
        (found,) = wait_until(lambda: kept(viewer))
    assert (found["seq"], found["frames_later"]) == (2, 0)
    assert found["box"] == [120, 5, 9, 9]
    jpeg = viewer.get(f"/events/{found['picture']}.jpg").body
    shade = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE).mean()
    assert shade == pytest.approx(120, abs=2)


def test_a_box_of_another_frame_than_the_picture_is_left_out(
    service: Service, client: zenoh.Session, camera: Camera, tmp_path: Path
):
    viewer = Viewer(service("view", "--port", 0, "--events-dir", tmp_path))
    wait_for_nodes(client, "viewer")
    camera.seq, camera.tracks_behind = 5, 1
    wait_until(lambda: camera.publish(5) or kept(viewer), poll_s=0.3)
    (found,) = kept(viewer)
    assert (found["frames_later"], found["box"]) == (0, None)
    assert found["picture"]


def test_no_events_are_kept_without_a_folder(service: Service):
    viewer = Viewer(service("view", "--port", 0))
    answer = json.loads(viewer.get("/events").text)
    assert answer == {"kept": False, "fault": "", "events": []}
    for path in ("/events.csv", "/events/1.jpg"):
        assert viewer.get(path).status == 404


def test_an_event_names_the_recording_that_it_triggered_and_the_command_that_shows_it(
    service: Service, client: zenoh.Session, camera: Camera, tmp_path: Path
):
    folders = ("--events-dir", tmp_path / "events", "--recordings-dir", tmp_path)
    viewer = Viewer(service("view", "--port", 0, *folders))
    black_box = ("--last", "5s", "--after", "0.5s", "--on-event", "line_crossed")
    service("recorder", *black_box, "--output", tmp_path / "run.mcap")
    wait_for_nodes(client, "viewer", "recorder")
    wait_until(lambda: camera.publish(1, "line_crossed") or kept(viewer), poll_s=0.3)
    (event,) = kept(viewer)
    path = f"/events/{event['number']}/recordings"
    found, *_ = wait_until(lambda: json.loads(viewer.get(path).text)["recordings"])
    file = tmp_path / found["file"]
    assert file in tmp_path.glob("run-*-line_crossed*.mcap")
    assert found["command"].startswith(f"zv view {file} --start ")
    assert viewer.get("/events/99/recordings").status == 404
    shown = Viewer(service(*shlex.split(found["command"])[1:], "--port", 0))
    assert shown.get("/healthz").status == 200


def test_a_folder_that_cannot_be_used_is_a_warning_and_the_viewer_goes_on(
    service: Service, client: zenoh.Session, camera: Camera, router, tmp_path: Path
):
    (tmp_path / "file").touch()
    viewer = Viewer(service("view", "--port", 0, "--events-dir", tmp_path / "file"))
    wait_for_nodes(client, "viewer")

    def is_told() -> bool:
        camera.publish(1)
        said = zv(router.endpoint, "node", "info", "viewer").stdout
        return "events are not kept" in said and "not_kept" in said

    wait_until(is_told, poll_s=0.3)
    assert viewer.get("/events").status == 503
    assert viewer.get("/healthz").status == 200
    assert viewer.program.interrupt() == 0
