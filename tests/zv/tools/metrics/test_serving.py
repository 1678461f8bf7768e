"""The HTTP side alone: addresses, formats, clients that hang or misbehave."""

from __future__ import annotations

import gzip
import re
import socket
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path

import pytest
from prometheus_client.openmetrics.parser import (
    text_string_to_metric_families as parse_openmetrics,
)
from prometheus_client.parser import text_string_to_metric_families as parse
from pydantic import ValidationError

from tests.support.waiting import wait_until
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.health.fleet import Fleet
from zenoh_vision.health.fleet_monitor import FleetMonitor
from zv.tools.metrics.collector import NodeCollector
from zv.tools.metrics.options import MetricsOptions
from zv.tools.metrics.serving import MAX_REQUESTS, serve

ANSWER_S = 30.0


def metrics_at(listen: str) -> AbstractContextManager[str]:
    return serve(listen, NodeCollector(FleetMonitor(Fleet()), lambda: True))


@pytest.fixture
def url() -> Iterator[str]:
    with metrics_at("127.0.0.1:0") as running:
        yield running


def get(url: str, **headers: str) -> tuple[bytes, dict[str, str]]:
    asked = urllib.request.Request(
        url, headers={name.replace("_", "-"): value for name, value in headers.items()}
    )
    with urllib.request.urlopen(asked, timeout=ANSWER_S) as answer:
        return answer.read(), dict(answer.headers)


def connection(url: str) -> socket.socket:
    port = int(url.rpartition(":")[2].partition("/")[0])
    return socket.create_connection(("127.0.0.1", port), ANSWER_S)


def test_a_scrape_is_prometheus_text_with_its_content_type(url: str):
    body, headers = get(url)
    assert headers["Content-Type"].startswith("text/plain; version=0.0.4")
    values = {s.name: s.value for family in parse(body.decode()) for s in family.samples}
    assert values["zenoh_vision_router_up"] == 1
    assert values["process_cpu_seconds_total"] > 0


def test_openmetrics_and_gzip_are_served_on_request(url: str):
    body, headers = get(
        url,
        Accept="application/openmetrics-text; version=1.0.0",
        Accept_Encoding="gzip",
    )
    assert headers["Content-Type"].startswith("application/openmetrics-text")
    assert headers["Content-Encoding"] == "gzip"
    found = {family.name for family in parse_openmetrics(gzip.decompress(body).decode())}
    assert "zenoh_vision_frames_dropped" in found


def test_nothing_can_be_sent_to_it(url: str):
    with pytest.raises(urllib.error.HTTPError, match="405"):
        urllib.request.urlopen(url, data=b"x", timeout=ANSWER_S)


@pytest.mark.parametrize(
    "sent", [b"", b"GET", b"\xff\xfe\r\n\r\n", b"GET /metrics HTTP/1.1\r\nHost: x"], ids=repr
)
def test_a_client_that_leaves_in_the_middle_harms_nobody(
    url: str, sent: bytes, capfd: pytest.CaptureFixture[str]
):
    with connection(url) as client:
        client.sendall(sent)
    assert b"zenoh_vision_router_up 1.0" in get(url)[0]
    assert capfd.readouterr().err == ""


def test_clients_that_hang_are_limited_and_the_next_is_served_when_they_leave(
    url: str,
):
    with ExitStack() as hanging:
        for _ in range(MAX_REQUESTS):
            hanging.enter_context(connection(url)).sendall(b"GET")
        with connection(url) as one_more:
            assert one_more.recv(1) == b""  # turned away at once

    def served() -> bool:
        try:
            return b"zenoh_vision" in get(url)[0]
        except OSError:
            return False

    wait_until(served)


def test_ipv6_is_served_and_its_address_is_written_in_brackets():
    try:
        with metrics_at("[::1]:0") as url:
            assert re.fullmatch(r"http://\[::1\]:\d+/metrics", url)
            assert b"zenoh_vision_router_up" in get(url)[0]
    except ConfigurationError as error:
        pytest.skip(f"this machine has no IPv6: {error}")


def test_a_port_that_is_taken_is_said_with_the_way_out(url: str):
    listen = url.removeprefix("http://").removesuffix("/metrics")
    with pytest.raises(ConfigurationError) as caught, metrics_at(listen):
        pass
    assert str(caught.value) == (
        f"listen = {listen!r}: the port is in use, perhaps by another `zv metrics`; "
        "listen elsewhere with --listen HOST:PORT"
    )


def test_an_address_of_another_machine_is_an_error():
    with (
        pytest.raises(ConfigurationError, match=r"is not possible: .*; allowed: HOST:PORT of"),
        metrics_at("192.0.2.1:9464"),
    ):
        pass


def test_an_unknown_host_is_an_error(monkeypatch: pytest.MonkeyPatch):
    def unknown(*_: object, **__: object) -> None:
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    with (
        pytest.raises(ConfigurationError, match="is not possible: Name or service not known"),
        metrics_at("nowhere:9464"),
    ):
        pass


def test_a_host_whose_name_cannot_be_looked_up_is_an_error():
    with (
        pytest.raises(ConfigurationError, match=r"is not possible: .*; allowed: HOST:PORT of"),
        metrics_at("..:9464"),
    ):
        pass


def test_after_its_end_nobody_listens_any_more():
    with metrics_at("127.0.0.1:0") as url:
        pass
    with pytest.raises(OSError, match="refused"):
        get(url)


@pytest.mark.parametrize("listen", ["127.0.0.1:9464", "localhost:0", "[::1]:65535", "0.0.0.0:80"])
def test_an_address_is_a_host_and_a_port(listen: str):
    assert MetricsOptions(listen=listen).listen == listen


@pytest.mark.parametrize(
    "listen",
    ["", "9464", ":9464", "127.0.0.1", "127.0.0.1:", "h:70000", "h:-1", "::1:9464", "http://h:1"],
)
def test_what_is_no_address_is_refused_with_an_example(listen: str):
    with pytest.raises(ValidationError, match=r"not HOST:PORT, such as 127\.0\.0\.1:9464"):
        MetricsOptions(listen=listen)


def test_only_this_machine_is_served_unless_told_otherwise():
    assert MetricsOptions().listen == "127.0.0.1:9464"


def test_a_health_check_is_told_how_it_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    file = tmp_path / "health"
    monkeypatch.setenv("ZV_HEALTH_FILE", str(file))
    trouble = [""]
    with serve(
        "127.0.0.1:0", NodeCollector(FleetMonitor(Fleet()), lambda: False), lambda: trouble[0]
    ):
        wait_until(lambda: file.exists() and file.read_text() == "ok\n")
        trouble[0] = "the loop has been stuck for 6 s"
        wait_until(lambda: file.read_text() == "trouble: the loop has been stuck for 6 s\n")
