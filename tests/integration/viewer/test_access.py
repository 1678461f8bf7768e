"""Who gets in, over the wire: hosts, origins, tokens, limits, clients that mean no good."""

from __future__ import annotations

import re
import socket
import stat
import time
from contextlib import ExitStack

import numpy as np
import pytest

from tests.integration.conftest import QUICK_ZV, Service
from tests.integration.viewer.conftest import with_router
from tests.support import processes
from tests.support.fork_server import ZV
from tests.support.processes import START_S, Program, environment
from tests.support.publishing import PlainCamera
from tests.support.routing import free_port
from tests.support.viewer.client import Viewer
from tests.support.waiting import DEADLINE_S, wait_until
from zenoh_vision.image import codecs
from zv.viewer.credentials import view_token
from zv.viewer.http.connections import FIRST_REQUEST_S

TOKEN = "0123456789abcdef-token"
TOPIC = "topic=/front/image/compressed"
LIVE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "MDEyMzQ1Njc4OWFiY2RlZg==",
}
NO_REQUESTS = (
    b"GARBAGE\r\n\r\n",
    b"GET / HTTP/9.9\r\n\r\n",
    b"GET /" + b"a" * 20_000 + b" HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\nX: " + b"a" * 20_000 + b"\r\n\r\n",
    b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 500 + b"\r\n",
    b"GET / HTTP/1.1\r\n\r\n",
    b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999999\r\n\r\n",
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    b"\x00" * 5000,
    b"GET /?token=%ff%00 HTTP/1.1\r\nHost: evil\xff\r\n\r\n",
    b"GET /nosuch HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer \xff\xfe\r\n\r\n",
    b"GET /live HTTP/1.1\r\nHost: localhost\r\nOrigin: http://[\r\nUpgrade: x\r\n\r\n",
    b"GET /snapshot?topic=%ff%fe&width=%00 HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET http://[/ HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET /live HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"CONNECT evil.example:443 HTTP/1.1\r\nHost: localhost\r\n\r\n",
)


@pytest.fixture(scope="module")
def standing_guarded(standing_service: Service) -> Viewer:
    """One that asks for a token, for all tests that leave no trace in it."""
    viewer = Viewer(standing_service("view", "--port", 0, "--token", TOKEN, "--wait", 0.2))
    return with_router(viewer, Authorization=f"Bearer {TOKEN}")


def test_a_page_of_another_site_shows_streams_with_the_token_in_their_address_alone(
    standing_viewer, standing_guarded
):
    foreign = {
        "Sec_Fetch_Site": "cross-site",
        "Sec_Fetch_Mode": "no-cors",
        "Sec_Fetch_Dest": "image",
    }
    link = {**foreign, "Sec_Fetch_Mode": "navigate", "Sec_Fetch_Dest": "document"}
    for path in (f"/stream?{TOPIC}&width=4096", f"/snapshot?{TOPIC}", "/"):
        refused = standing_viewer.get(path, **foreign)
        assert (refused.status, "--token" in refused.text) == (403, True)
        assert standing_viewer.get(path, Sec_Fetch_Site="same-origin").status in (200, 404)
        assert standing_viewer.get(path, **link).status in (200, 404)
    assert standing_viewer.get("/healthz", Sec_Fetch_Site="none").status == 200
    path = f"/snapshot?{TOPIC}"
    assert standing_guarded.get(f"{path}&token={TOKEN}", **foreign).status == 404
    opened = standing_guarded.get(f"/?token={TOKEN}")
    cookie = opened.headers["set-cookie"].partition(";")[0]
    assert standing_guarded.get(path, Cookie=cookie).status == 404
    assert standing_guarded.get(path, Cookie=cookie, **foreign).status == 403


def test_a_foreign_host_and_a_foreign_page_are_refused(standing_viewer):
    assert standing_viewer.get("/", Host="evil.example").status == 403
    assert "--allow-host evil.example" in standing_viewer.get("/", Host="evil.example:8080").text
    here = f"localhost:{standing_viewer.port}"
    ros = {"Host": here, "Origin": "http://ros.example"}
    assert standing_viewer.get(f"/snapshot?{TOPIC}", **ros).status == 403
    for origin in ("http://evil.example", "null", f"http://localhost:{standing_viewer.port + 1}"):
        assert standing_viewer.get("/live", Host=here, Origin=origin, **LIVE).status == 403
        assert standing_viewer.get("/", "POST", Host=here, Origin=origin).status == 403
    for method in ("POST", "PUT", "DELETE", "OPTIONS", "TRACE"):
        assert standing_viewer.get("/", method, Host=here).status == 405


def test_without_the_token_nothing_is_served_but_the_health(standing_guarded):
    for path in ("/", f"/snapshot?{TOPIC}", f"/stream?{TOPIC}", "/page/index.html", "/events"):
        answer = standing_guarded.get(path)
        assert answer.status == 401
        assert "token" in answer.text
    assert standing_guarded.get("/live", **LIVE).status == 401
    assert standing_guarded.get("/?token=wrong").status == 401
    assert standing_guarded.get("/healthz").status == 200


def test_any_other_address_or_name_than_loopback_gets_a_token_of_its_own_that_is_kept(
    tmp_path, router, monkeypatch
):
    changed = {**environment(), "XDG_STATE_HOME": str(tmp_path / "state")}
    monkeypatch.setattr(processes, "environment", lambda: changed)
    tokens = set()
    for flags, host in (
        (("--host", "0.0.0.0"), "localhost"),
        (("--allow-host", "cam.example"), "cam.example"),  # as of a proxy
    ):
        arguments = ["view", *flags, "--port", "0", "--connect", router.endpoint]
        with Program(arguments, tmp_path, host, forked=ZV) as program:
            viewer = Viewer(program)
            token = viewer.url.partition("token=")[2]
            tokens.add(token)
            assert viewer.get("/", Host=host).status == viewer.get("/").status == 401
            assert viewer.open(f"/?token={token}", Host=host).status == 200
            assert viewer.get(f"/?token={token}", Host="evil.example").status == 403
    kept = tmp_path / "state" / "zenoh-vision" / "viewer_token"
    assert {kept.read_text().strip()} == tokens
    assert stat.S_IMODE(kept.stat().st_mode) == 0o600


def test_a_taken_port_is_named_with_the_way_out(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        arguments = ["view", "--port", str(port)]
        with Program(arguments, tmp_path, "view", forked=ZV) as program:
            assert program.process.wait(START_S) == 2
    assert re.fullmatch(
        rf"zv: port {port} on 127\.0\.0\.1 is in use, perhaps .*--port PORT.*\n", program.complaints
    )


def test_under_zv_up_the_token_is_in_the_address_and_in_no_command_line(tmp_path, router):
    import psutil

    launch = tmp_path / "up.toml"
    launch.write_text(
        f'[router]\nconnect = "{router.endpoint}"\n[[node]]\nservice = "viewer"\n'
        f'settings = {{ host = "0.0.0.0", port = {free_port()}, token = "{TOKEN}" }}\n'
    )
    changed = {name: value for name, value in environment().items() if name != "ZV_VIEWER_PORT"}
    original, processes.environment = processes.environment, lambda: changed
    try:
        with Program(["up", "--plain", launch], tmp_path, "up", forked=QUICK_ZV) as program:
            program.lines(r"viewer +running.*")
            greeting = program.output.splitlines()
            (child,) = psutil.Process(program.process.pid).children()
            assert TOKEN not in " ".join(child.cmdline())
            url = next(line for line in greeting if line.startswith("viewer: "))
            assert url.endswith(f"/?token={TOKEN}")
            assert f"viewer, view only: {url[8 : -len(TOKEN)]}{view_token(TOKEN)}" in greeting
    finally:
        processes.environment = original


def test_more_clients_than_allowed_are_turned_away_and_places_become_free(service, client):
    viewer = Viewer(service("view", "--port", 0, "--max-clients", 3))
    camera = PlainCamera(client)
    with camera.at(15):
        wait_until(lambda: viewer.get(f"/snapshot?{TOPIC}").status == 200)
        with ExitStack() as clients:
            for _ in range(3):
                next(clients.enter_context(viewer.stream(TOPIC)))
            answer = viewer.get(f"/stream?{TOPIC}")
            assert answer.status == 503
            assert "3 clients" in answer.text
            assert answer.headers["retry-after"]
            assert viewer.get("/live", **LIVE).status == 503
            assert viewer.get(f"/snapshot?{TOPIC}").status == 200
        wait_until(lambda: can_stream(viewer))


def test_clients_that_take_nothing_give_their_places_to_others(service, client):
    viewer = Viewer(service("view", "--port", 0, "--max-clients", 3))
    noise = np.random.default_rng(1).integers(0, 255, (480, 640, 3), np.uint8)
    camera = PlainCamera(client, pictures=(codecs.encode_jpeg(noise, "bgr8", 95),))
    with camera.at(30), ExitStack() as stalled:
        wait_until(lambda: viewer.get(f"/snapshot?{TOPIC}").status == 200)
        for _ in range(3):
            never_reads = stalled.enter_context(connected(viewer.port))
            never_reads.sendall(f"GET /stream?{TOPIC} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        wait_until(lambda: viewer.get("/live", **LIVE).status == 503)
        wait_until(lambda: can_stream(viewer))


def can_stream(viewer: Viewer) -> bool:
    try:
        with viewer.stream(TOPIC) as pictures:
            return bool(next(pictures))
    except AssertionError:
        return False


def test_hundreds_of_connections_without_a_request_do_not_block_others(viewer, client):
    camera = PlainCamera(client)
    with camera.at(15), ExitStack() as opened:
        wait_until(lambda: viewer.get(f"/snapshot?{TOPIC}").status == 200)
        with viewer.stream(TOPIC) as pictures:
            first = next(pictures).seq
            slow = []
            for index in range(240):  # and 60 more that never finish a header
                slow.append(opened.enter_context(connected(viewer.port)))
                if index % 4 == 0:
                    begun = opened.enter_context(connected(viewer.port))
                    begun.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ")
                    slow.append(begun)
                if index % 60 == 0:  # else the queue overflows, and the kernel tries again in 1 s
                    assert viewer.get("/healthz").status == 200
            # Answered in less time than the others have before they are disconnected.
            for _ in range(20):
                began_s = time.monotonic()
                assert viewer.get("/healthz").status == 200
                assert time.monotonic() - began_s < FIRST_REQUEST_S
            assert next(pictures).seq > first
            # None of them stays for long, even if it goes on to send a byte now and then.
            wait_until(lambda: all(is_closed(each) for each in slow))
            assert next(pictures).seq > first


def connected(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), DEADLINE_S)


def is_closed(connection: socket.socket) -> bool:
    try:
        connection.setblocking(False)
        connection.send(b"x")
        return connection.recv(1) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def test_what_is_no_request_is_refused_and_the_next_one_served(standing_viewer):
    for text in NO_REQUESTS:
        with connected(standing_viewer.port) as connection:
            try:
                connection.sendall(text)
                answer = connection.recv(4096)
            except ConnectionError:
                answer = b""
        assert answer == b"" or re.match(rb"HTTP/1\.[01] 4\d\d ", answer), (text[:50], answer)
        assert standing_viewer.get("/healthz").status == 200
    assert "Traceback" not in standing_viewer.program.complaints


def test_its_own_words_do_not_give_the_token_away(standing_guarded):
    standing_guarded.get(f"/nosuch?token={TOKEN}")
    standing_guarded.get(f"/stream?{TOPIC}&width=x&token={TOKEN}")
    assert TOKEN not in standing_guarded.program.complaints
