"""Endpoints: one that nothing could ever reach is refused before it is tried."""

from __future__ import annotations

from pathlib import Path

import pytest

from zenoh_vision.cli.flags import ConnectionSettings
from zenoh_vision.config.settings import load_settings
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.node.node import Node
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.endpoints import checked_endpoint
from zenoh_vision.transport.zenoh_config import client_config, router_config
from zv.router.settings import RouterSettings

GOOD = [
    "tcp/127.0.0.1:7447",
    "tcp/[::1]:7447",
    "tls/router.example.org.:7447",
    "tcp/[fe80::1%eth0]:7447",
    "tcp/münchen.example:7447",
    "tcp/0.0.0.0:7447#so_sndbuf=32768",
    "udp/10.0.0.1:7447?rel=0",
    "quic/host_1:1",
    "ws/h:65535",
    "unixsock-stream//tmp/router.sock",
]
BAD = {
    "tcp/127.0.0.1": "(it has no port; did you mean tcp/127.0.0.1:7447?)",
    "tcp/[::1]": "(it has no port; did you mean tcp/[::1]:7447?)",
    "tcp/::1:7447": "(it is not one host and one port; IPv6 is written [::1]:7447)",
    "tcp/host:port": "it is not one host and one port",
    "tcp/host:65536": "ports end at 65535",
    "tcp/router..lan:7447": "(its host cannot be looked up: a part is empty or too long)",
    f"tls/{'r' * 64}.lan:7447": "(its host cannot be looked up: a part is empty or too long)",
    "tcp/:7447": "it is not one host and one port",
    "tcp/": "nothing follows tcp/",
    "unixsock-stream/": "nothing follows",
    "127.0.0.1:7447": "(it begins with none of the protocols; did you mean tcp/127.0.0.1:7447?)",
    "http/host:80": "(it begins with none of the protocols)",
    "": "begins with none of",
}


@pytest.mark.parametrize("text", GOOD)
def test_an_endpoint_with_all_its_parts_is_accepted(text: str):
    assert checked_endpoint(text) == text


@pytest.mark.parametrize(("text", "why"), BAD.items())
def test_an_endpoint_without_a_part_is_refused_with_what_is_allowed(text: str, why: str):
    for model, name in ((ConnectionSettings, "connect"), (RouterSettings, "listen")):
        with pytest.raises(ConfigurationError) as caught:
            load_settings(model, flags={name: text})
        assert f"--{name} = {text!r} is not allowed" in str(caught.value)
        assert why in str(caught.value)
        assert "allowed: PROTOCOL/HOST:PORT such as tcp/192.168.0.2:7447" in str(caught.value)


def test_a_program_of_ones_own_is_told_too():
    said = r"connect = 'tcp/127.0.0.1' is not allowed \(it has no port.*allowed: PROTOCOL/HOST:PORT"
    with (
        pytest.raises(ConfigurationError, match=said),
        Node("mine", connection=Connection("tcp/127.0.0.1")),
    ):
        pass


def test_the_endpoints_in_a_file_of_zenoh_are_checked_too(tmp_path: Path):
    file = tmp_path / "wrong.json5"
    file.write_text('{ connect: { endpoints: ["tcp/127.0.0.1"] } }')
    with pytest.raises(ConfigurationError, match=r"wrong.json5: connect/endpoints = 'tcp/127"):
        client_config(Connection(zenoh_config=str(file)))
    file.write_text('{ listen: { endpoints: ["tcp/0.0.0.0"] } }')
    with pytest.raises(ConfigurationError, match=r"wrong.json5: listen/endpoints = 'tcp/0"):
        router_config("tcp/127.0.0.1:0", str(file))
