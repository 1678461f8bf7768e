"""zv notify: events with their picture at a webhook and at an MQTT broker."""

from __future__ import annotations

import asyncio
import json
import socket
import subprocess
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from email import message_from_bytes
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import aiomqtt
import cv2
import numpy as np
import pytest
import zenoh

from tests.integration.conftest import Service
from tests.support.headers import header
from tests.support.listening import wait_for_nodes
from tests.support.processes import need
from tests.support.routing import free_port
from tests.support.typist import zv
from tests.support.waiting import wait_until
from zenoh_vision.messages import TrackEvent

JPEG = bytes(cv2.imencode(".jpg", np.full((24, 32, 3), 90, np.uint8))[1])


class Hook:
    """An HTTP server that keeps what is posted, after answering 503 so many times."""

    def __init__(self, failures: int = 0) -> None:
        self.posted: list[dict[str, Any]] = []
        self.failed = 0
        hook = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                length = int(self.headers["Content-Length"])
                body = self.rfile.read(length)
                if hook.failed < failures:
                    hook.failed += 1
                    self.send_error(503)
                    return
                kind = self.headers["Content-Type"].encode()
                parts = message_from_bytes(b"Content-Type: " + kind + b"\r\n\r\n" + body)
                hook.posted.append(
                    {
                        "key": self.headers["Idempotency-Key"],
                        **{
                            part.get_param("name", header="content-disposition"): (
                                part.get_content_type(),
                                part.get_payload(decode=True),
                            )
                            for part in parts.get_payload()
                        },
                    }
                )
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_: object) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_address[1]}/event"
        Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture
def picture(client: zenoh.Session) -> Iterator[None]:
    """A camera that answers a query with its newest picture, as every stream does."""
    key = "vision/front/image/compressed"

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, JPEG, encoding="image/jpeg")

    queryable = client.declare_queryable(key, answer)
    yield
    queryable.undeclare()


def publish(client: zenoh.Session, seq: int, kind: str = "zone_entered", **fields: object) -> None:
    about = {
        "header": header(seq, stamp_ns=time.time_ns()),
        "event": kind,
        "id": seq,
        "zone": "belt",
    }
    event = TrackEvent(**{**about, "x": 3.0, "y": 4.0, "inside": 1, **fields})
    encoding = "application/msgpack;vision.TrackEvent.v1"
    client.put("vision/front/events", event.to_bytes(), encoding=encoding)


def test_an_event_and_its_picture_are_posted_once_also_after_failures(
    service: Service, client: zenoh.Session, picture: None
):
    hook = Hook(failures=2)
    service("notify", "--webhook", hook.url)
    wait_for_nodes(client, "notify")

    def is_posted() -> bool:
        publish(client, 1)  # the same event each time: it counts once
        return bool(hook.posted)

    wait_until(is_posted, poll_s=0.3)
    publish(client, 2, "started")
    publish(client, 3, "zone_left", inside=0)
    wait_until(lambda: len(hook.posted) == 2)
    hook.close()
    assert hook.failed == 2
    kind, text = hook.posted[0]["event"]
    fields = json.loads(text)
    assert kind == "application/json"
    assert (fields["event"], fields["id"], fields["zone"], fields["inside"]) == (
        *("zone_entered", 1, "belt"),
        1,
    )
    assert hook.posted[0]["key"] == fields["uid"]
    assert hook.posted[0]["picture"] == ("image/jpeg", JPEG)
    assert json.loads(hook.posted[1]["event"][1])["event"] == "zone_left"


def test_what_nobody_takes_is_told_and_counted(service: Service, client: zenoh.Session, router):
    url = f"http://127.0.0.1:{free_port()}/"
    program = service("notify", "--webhook", url, "--keep-trying", "2s", "--no-picture")
    wait_for_nodes(client, "notify")

    def is_told() -> bool:
        publish(client, int(time.monotonic() * 100))
        said = zv(router.endpoint, "node", "info", "notify").stdout
        return "webhook: Cannot connect" in said and "undelivered" in said

    wait_until(is_told, poll_s=0.3)
    assert program.interrupt() == 0


def test_without_a_receiver_it_is_wrong_use(router):
    done = zv(router.endpoint, "notify")
    assert done.returncode == 2
    assert "nobody receives the events; allowed: --webhook URL, --mqtt" in done.stderr


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[int]:
    """Mosquitto with a user and a password; its port."""
    program = need("mosquitto", "mosquitto")
    port = free_port()
    passwords = tmp_path / "passwords"
    passwords.touch(mode=0o600)
    subprocess.run(
        [need("mosquitto_passwd", "mosquitto"), "-b", str(passwords), "me", "s:cret"], check=True
    )
    file = tmp_path / "mosquitto.conf"
    file.write_text(f"listener {port} 127.0.0.1\npassword_file {passwords}\nuser root\n")
    with subprocess.Popen([program, "-c", str(file)], stderr=subprocess.DEVNULL) as process:
        wait_until(lambda: listens(port))
        yield port
        process.terminate()


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def listen(port: int, found: list[tuple[str, bytes, bool]], wanted: int) -> None:
    async def run() -> None:
        async with aiomqtt.Client("127.0.0.1", port, username="me", password="s:cret") as mqtt:
            await mqtt.subscribe("#", qos=1)
            async for message in mqtt.messages:
                found.append((str(message.topic), bytes(message.payload), bool(message.retain)))
                if len([topic for topic, _, _ in found if topic.endswith("/events")]) >= wanted:
                    return

    asyncio.run(asyncio.wait_for(run(), 60))


def test_a_broker_gets_events_pictures_zones_and_what_home_assistant_needs(
    service: Service, client: zenoh.Session, picture: None, broker: int
):
    found: list[tuple[str, bytes, bool]] = []
    with ThreadPoolExecutor(1) as beside:
        listening = beside.submit(listen, broker, found, 2)
        service("notify", "--mqtt", f"mqtt://me:s%3Acret@127.0.0.1:{broker}")
        wait_for_nodes(client, "notify")
        wait_until(lambda: found == [("zenoh_vision/status", b"online", False)])  # without an event

        def is_there() -> bool:
            publish(client, 1)
            return any(topic == "zenoh_vision/front/events" for topic, _, _ in found)

        wait_until(is_there, poll_s=0.3)
        publish(client, 2, "zone_left", inside=0)
        listening.result(60)
    by_topic: dict[str, list[bytes]] = {}
    for topic, payload, _ in found:
        by_topic.setdefault(topic, []).append(payload)
    assert by_topic["zenoh_vision/status"] == [b"online"]
    assert by_topic["zenoh_vision/front/picture"] == [JPEG, JPEG]
    assert by_topic["zenoh_vision/front/zone/belt"] == [b"ON", b"OFF"]
    assert [json.loads(each)["event"] for each in by_topic["zenoh_vision/front/events"]] == [
        "zone_entered",
        "zone_left",
    ]
    zone = json.loads(by_topic["homeassistant/binary_sensor/notify/front_zone_belt/config"][0])
    assert (zone["state_topic"], zone["device_class"]) == (
        "zenoh_vision/front/zone/belt",
        "occupancy",
    )
    assert zone["availability_topic"] == "zenoh_vision/status"
    camera = json.loads(by_topic["homeassistant/camera/notify/front_picture/config"][0])
    assert camera["topic"] == "zenoh_vision/front/picture"
    assert len(by_topic["homeassistant/sensor/notify/front_event/config"]) == 1


def test_a_zone_is_right_also_where_its_events_are_not_sent(
    service: Service, client: zenoh.Session, broker: int
):
    found: list[tuple[str, bytes, bool]] = []
    with ThreadPoolExecutor(1) as beside:
        listening = beside.submit(listen, broker, found, 1)
        url = f"mqtt://me:s%3Acret@127.0.0.1:{broker}"
        service("notify", "--mqtt", url, "--events", "line_crossed", "--no-picture")
        wait_for_nodes(client, "notify")

        def is_on() -> bool:
            publish(client, 1)
            return ("zenoh_vision/front/zone/belt", b"ON", False) in found

        wait_until(is_on, poll_s=0.3)
        publish(client, 2, "zone_left", inside=0)
        publish(client, 3, "line_crossed", zone="gate", inside=None)
        listening.result(60)
    zones = [payload for topic, payload, _ in found if topic.endswith("/zone/belt")]
    assert zones == [b"ON", b"OFF"]
    sent = [json.loads(payload) for topic, payload, _ in found if topic.endswith("/events")]
    assert [each["event"] for each in sent] == ["line_crossed"]
