"""configs/compose/secure.yml: without a certificate nothing, and who is revoked is out soon."""

from __future__ import annotations

import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh

from tests.support.containers.stack import Stack
from tests.support.routing import free_port
from tests.support.secured import Secured
from tests.support.waiting import wait_until
from zenoh_vision.errors import RouterUnreachable
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link

pytestmark = [pytest.mark.compose, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def system(tmp_path_factory: pytest.TempPathFactory) -> Secured:
    return Secured(tmp_path_factory.mktemp("secure") / "security", free_port()).init(
        camera=("front", "back")
    )


@pytest.fixture(scope="module")
def stack(image: str, clone: Path, system: Secured) -> Iterator[Stack]:
    lines = (system.folder / "compose.env").read_text().splitlines()
    settings = dict(line.split("=", 1) for line in lines if not line.startswith("#"))
    settings |= {"ZV_PORT": str(free_port()), "ZV_SECURE_BIND": "127.0.0.1"}
    settings |= {"COMPOSE_PROFILES": "two-cameras,relay,notify,metrics"}
    settings |= {"ZV_METRICS_PORT": str(free_port())}
    settings |= {"ZV_NOTIFY_WEBHOOK": "http://127.0.0.1:9/"}  # where nobody listens
    with Stack(clone, ["secure"], settings) as running:
        yield running


def newest(session: zenoh.Session, key: str) -> bool:
    return any(reply.ok for reply in session.get(key, timeout=2.0))


def page_at(address: str) -> bytes:
    try:
        with urllib.request.urlopen(address, timeout=5) as answer:
            return bytes(answer.read())
    except OSError:
        return b""


def test_a_guest_sees_the_streams_and_nobody_else_sees_anything(stack: Stack, system: Secured):
    guest = Link(system.connection("guest", timeout_s=60.0))
    for suffix in ("image/compressed", "centroid", "edges/compressed"):
        wait_until(lambda key=f"vision/front/{suffix}": newest(guest.session, key), 60)
    for suffix in ("back/image/compressed", "back/centroid", "front/relayed/compressed"):
        wait_until(lambda key=f"vision/{suffix}": newest(guest.session, key), 60)
    wait_until(lambda: newest(guest.session, "@vision/node/notify"), 60)
    address = f"http://{stack.compose('port', 'metrics', '9464').strip()}/metrics"
    wait_until(lambda: b'node_up{node="camera_front"} 1' in page_at(address), 60)
    guest.close()
    for endpoint in (f"tcp/127.0.0.1:{system.port}", f"tls/127.0.0.1:{system.port}"):
        with pytest.raises(RouterUnreachable):
            Link(Connection(connect=endpoint, timeout_s=3.0))


def test_a_container_has_its_own_credentials_only_and_cannot_write_them(stack: Stack):
    of_profiles = ("camera-2", "relay", "notify", "metrics")
    for service in ("camera", "tracker", "edge", "viewer", *of_profiles):
        shown = stack.compose("exec", "-T", service, "ls", "/run/secrets")
        assert shown.split() == ["credentials.json5"]
        written = stack.compose(
            "exec", "-T", service, "sh", "-c", "echo x >/run/secrets/credentials.json5; echo $?"
        )
        assert written.strip() != "0"
    assert stack.compose("exec", "-T", "router", "ls", "/run/security").split() == ["router.json5"]


def test_the_image_has_neither_a_compiler_nor_pip(stack: Stack):
    looked_for = "for each in gcc cc make pip pip3; do command -v $each; done; echo searched"
    assert stack.compose("exec", "-T", "camera", "sh", "-c", looked_for).split() == ["searched"]
    code = "import importlib.util as u; print(u.find_spec('pip'))"
    assert stack.compose("exec", "-T", "camera", "python", "-c", code).strip() == "None"


def test_a_revoked_camera_is_out_within_a_minute_and_the_others_go_on(
    stack: Stack, system: Secured
):
    guest = Link(system.connection("guest", timeout_s=60.0))
    wait_until(lambda: newest(guest.session, "@vision/node/camera_front"), 60)
    begun_s = time.monotonic()
    system.revoke("camera_front")
    wait_until(lambda: "camera_front no rights" in stack.compose("logs", "camera"), 60)
    wait_until(lambda: newest(guest.session, "@vision/node/tracker_front"), 30)
    assert not newest(guest.session, "@vision/node/camera_front")
    assert time.monotonic() - begun_s < 60
    guest.close()


def test_a_container_that_starts_without_its_file_leaves_the_place_for_another(
    stack: Stack, system: Secured
):
    file = system.file("camera_front")
    stack.compose("restart", "camera", check=False)
    assert not file.exists()
    system.add(camera=("front",))
    stack.compose("up", "-d", "--no-build", "--no-deps", "camera")
    guest = Link(system.connection("guest", timeout_s=60.0))
    wait_until(lambda: newest(guest.session, "@vision/node/camera_front"), 60)
    guest.close()
