"""Relays in a circle: each frame goes round once at most, and the node that closes it says so."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import zenoh

from tests.integration.conftest import a_router, some_services
from tests.integration.relay.test_relay import LENS
from tests.support.listening import Listener, newest, open_client, wait_for_nodes
from tests.support.processes import ROOT
from tests.support.routing import free_port, zenohd
from tests.support.typist import zv
from tests.support.waiting import wait_until


@pytest.fixture(params=["embedded", "zenohd"])
def endpoint(request, tmp_path: Path) -> Iterator[str]:
    if request.param == "embedded":
        with a_router(tmp_path) as router:
            yield router.endpoint
        return
    port = free_port()
    here = f"tcp/127.0.0.1:{port}"
    with zenohd(tmp_path, port, "-c", ROOT / "configs" / "router.json5", "-l", here):
        yield here


def said_by(session: zenoh.Session, node: str) -> dict[str, Any]:
    return newest(session, f"@vision/diagnostics/{node}").body


def test_frames_and_calibration_of_a_camera_stay_its_own(endpoint: str, tmp_path: Path):
    (tmp_path / "lens.yaml").write_text(LENS)
    cameras = ["front", "b", "c"]
    with some_services(endpoint, tmp_path) as start, open_client(endpoint) as session:
        infos = Listener(session, "vision/*/camera_info")
        frames = {each: Listener(session, f"vision/{each}/image/compressed") for each in cameras}
        size = ("--width", 320, "--height", 240, "--rate", 10)
        start("camera", *size, "--calibration", tmp_path / "lens.yaml")
        for width, camera, to in zip((300, 280, 260), cameras, ("b", "c", "front"), strict=True):
            start("relay", "--camera", camera, "--to", to, "--region", f"5,5,{width},{width - 80}")
        frames["c"].wait_for(20)
        wait_until(lambda: said_by(session, "relay_front")["counters"].get("relayed_back", 0) > 20)
        back = said_by(session, "relay_front")
        for camera in cameras:
            sent = [each.header for each in frames[camera].messages]
            by = "camera_front" if camera == "front" else f"relay_{camera}"
            assert {header["node"] for header in sent} == {by}
            assert set(Counter(header["seq"] for header in sent).values()) == {1}
        assert sorted(each.key for each in infos.messages) == [
            f"vision/{each}/camera_info" for each in sorted(cameras)
        ]
    assert back["level"] == 1
    assert "relays in a circle: these are pictures of front itself" in back["message"]


def test_a_circle_without_a_camera_is_named_by_the_doctor(endpoint: str, tmp_path: Path):
    with some_services(endpoint, tmp_path) as start, open_client(endpoint) as session:
        for camera, to in (("a", "b"), ("b", "a")):
            start("relay", "--camera", camera, "--to", to)
        wait_for_nodes(session, "relay_a", "relay_b")
        said = "relay_a and relay_b get pictures only from each other"
        wait_until(lambda: said in zv(endpoint, "doctor").stdout, 30)
