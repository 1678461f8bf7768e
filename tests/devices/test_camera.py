"""A camera node at real drivers: absent, unplugged, set, still, as its user sees it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zenoh

from tests.integration.conftest import Service, a_router, some_services
from tests.support.cameras.drivers import NAMES, plug_in, unplug
from tests.support.listening import ask, open_client
from tests.support.processes import START_S, Program
from tests.support.typist import type_zv
from tests.support.waiting import wait_until
from zenoh_vision.messages import Header

FIRST = str(NAMES["first"])
SLOW_S = 200.0
"""Deadline in the virtual machine, where programs start slowly."""


@dataclass
class System:
    """A router, what starts services at it, and a client that has heard frames and health."""

    endpoint: str
    start: Service
    client: zenoh.Session
    frames: list[Header]
    health: list[dict[str, Any]]

    def wait(self, condition: Any) -> Any:
        return wait_until(condition, SLOW_S, lambda: str(self.health[-1:]), poll_s=0.1)

    def wait_for_frames(self, count: int = 3) -> None:
        before = len(self.frames)
        self.wait(lambda: len(self.frames) >= before + count)

    def level(self) -> int | None:
        """Return the newest level of the camera's health; None before the first report."""
        return self.health[-1]["level"] if self.health else None

    def control(self, name: str) -> Any:
        replies = ask(self.client, f"@vision/param/camera_front/control.{name}")
        return replies[0].body.get("value") if replies else None

    def set(self, **values: Any) -> zenoh.Reply:
        payload = msgpack.packb({f"control.{name}": value for name, value in values.items()})
        (reply,) = self.client.get("@vision/set/camera_front", payload=payload, timeout=30.0)
        return reply


@pytest.fixture
def system(tmp_path: Path) -> Iterator[System]:
    with (
        a_router(tmp_path) as router,
        some_services(router.endpoint, tmp_path) as start,
        open_client(router.endpoint) as client,
    ):
        found = System(router.endpoint, start, client, [], [])

        def hear_frame(sample: zenoh.Sample) -> None:
            assert sample.attachment is not None
            found.frames.append(Header.from_bytes(sample.attachment.to_bytes()))

        client.declare_subscriber("vision/front/image/compressed", hear_frame)
        client.declare_subscriber(
            "@vision/diagnostics/camera_front",
            lambda sample: found.health.append(msgpack.unpackb(sample.payload.to_bytes())),
        )
        yield found


def test_controls_are_parameters_while_the_device_is_there_and_set_again_when_it_returns(
    system: System, tmp_path: Path
):
    config = tmp_path / "camera.toml"
    config.write_text("[controls]\nbrightness = 77\ngain_automatic = false\ngain = 5\n")
    camera = system.start("camera", "--source", FIRST, "--config", config, "--wait-for-source")
    system.wait_for_frames()
    assert [system.control(name) for name in ("brightness", "gain")] == [77, 5]
    assert system.set(contrast=99).ok is not None
    refused = system.set(contrast=999).err
    assert refused is not None
    assert b"0 to 255" in refused.payload.to_bytes()
    epoch = system.frames[-1].epoch
    gone: list[str] = []
    system.client.declare_subscriber(
        "@vision/param/camera_front/*",
        lambda sample: gone.append(str(sample.key_expr)) if not len(sample.payload) else None,
    )
    unplug()
    try:
        system.wait(lambda: system.level() == 2)
        assert "there is no such device" in system.health[-1]["message"] or (
            "the device is gone" in system.health[-1]["message"]
        )
        system.wait(lambda: "@vision/param/camera_front/control.gain" in gone)
    finally:
        plug_in()
    system.wait(lambda: system.frames[-1].epoch > epoch)
    system.wait(lambda: system.control("contrast") == 99)
    assert [system.control(name) for name in ("brightness", "gain")] == [77, 5]
    system.wait(lambda: system.level() == 0)
    assert camera.interrupt() == 0


def test_a_camera_that_is_absent_is_waited_for_or_ends_with_status_3(system: System):
    unplug()
    try:
        alone = system.start("camera", "--camera", "alone", "--source", FIRST)
        waiting = system.start("camera", "--source", FIRST, "--wait-for-source")
        system.wait(lambda: any(each["level"] == 2 for each in system.health))
        assert "there is no such device" in system.health[-1]["message"]
        assert alone.process.wait(START_S) == 3
        assert f"{FIRST}: there is no such device" in alone.complaints
    finally:
        plug_in()
    system.wait_for_frames()
    assert waiting.interrupt() == 0


def test_a_still_picture_goes_on_in_one_epoch_and_is_warned_of(system: System):
    controls = json.dumps({"osd_text_mode": "None"})
    flags = ("--controls", controls, "--frozen-after", "5", "--width", "320")
    system.start("camera", "--source", FIRST, *flags)
    system.wait_for_frames()
    first = system.frames[-1]

    def is_still() -> bool:
        return system.frames[-1].stamp_ns - first.stamp_ns > 30e9

    system.wait(is_still)
    assert {frame.epoch for frame in system.frames} == {first.epoch}
    assert "has not changed" in system.health[-1]["message"]
    assert system.health[-1]["level"] == 1


def test_zv_param_and_a_live_change_that_the_device_does_not_offer(system: System):
    system.start("camera", "--source", FIRST)
    system.wait_for_frames()

    def zv(*words: str, status: int = 0) -> Any:
        """Return what a command prints, once it ends with a status: the node may be slow here."""

        def done() -> Any:
            found = type_zv([*words], ZV_CONNECT=system.endpoint)
            return found if found.returncode == status else None

        return system.wait(done)

    shown = zv("param", "describe", "camera_front", "control.gain").stdout
    assert "0 to 255; inactive; volatile" in shown
    zv("param", "set", "camera_front", "control.test_pattern=100% Red")
    dumped = zv("param", "dump", "camera_front").stdout
    assert "[controls]" in dumped
    assert 'test_pattern = "100% Red"' in dumped
    assert "\n# gain = " in dumped
    refused = zv("param", "set", "camera_front", "rate=61", status=2).stderr
    assert "rate 61 Hz is not offered; allowed: 320x180: 60, 50" in refused


def test_two_cameras_of_one_machine_publish_side_by_side(system: System):
    both: set[str] = set()
    system.client.declare_subscriber(
        "vision/*/image/compressed", lambda sample: both.add(str(sample.key_expr).split("/")[1])
    )
    programs: list[Program] = [
        system.start("camera", "--camera", name, "--source", str(path))
        for name, path in NAMES.items()
    ]
    system.wait(lambda: both == set(NAMES))
    assert [program.process.poll() for program in programs] == [None, None]
