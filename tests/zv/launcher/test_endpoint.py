"""Where the router listens: a taken port is found before anything is started."""

import socket

import pytest

from zenoh_vision.errors import ConfigurationError
from zenoh_vision.transport.endpoints import local_endpoint
from zv.launcher.starting import free


@pytest.fixture
def taken():
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0", "localhost"])
def test_a_taken_port_is_refused_with_both_ways_out(taken, host):
    with pytest.raises(ConfigurationError) as caught:
        free(f"tcp/{host}:{taken}#so_sndbuf=65536")
    said = str(caught.value)
    reachable = "localhost" if host == "localhost" else "127.0.0.1"
    assert f"--connect tcp/{reachable}:{taken}," in said
    assert "--listen tcp/" in said


def test_a_port_that_a_router_just_left_is_free():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        client = socket.create_connection(("127.0.0.1", port))
        server.accept()[0].close()  # the side that closes first keeps the port a while
        client.close()
    assert free(f"tcp/127.0.0.1:{port}") == f"tcp/127.0.0.1:{port}"


def test_port_0_becomes_a_free_port_that_nodes_can_connect_to():
    found = free("tcp/127.0.0.1:0#so_sndbuf=65536")
    assert found.startswith("tcp/127.0.0.1:")
    assert found.endswith("#so_sndbuf=65536")
    assert int(local_endpoint(found).rsplit(":", 1)[1]) > 0


@pytest.mark.parametrize(
    "listen", ["tcp/192.0.2.1:7447", "tcp/127.0.0.1:99999", "tcp/no.such.host.invalid:7447"]
)
def test_an_address_that_is_not_this_machines_is_refused(listen):
    with pytest.raises(ConfigurationError, match=r"is not possible: .*; allowed: tcp/ADDRESS:PORT"):
        free(listen)


@pytest.mark.parametrize("listen", ["udp/127.0.0.1:7447", "unixsock-stream//tmp/zenoh.sock"])
def test_what_is_not_tcp_is_for_the_router_to_judge(listen):
    assert free(listen) == listen


@pytest.mark.parametrize(
    ("listen", "found"),
    [
        ("tcp/127.0.0.1:7447", "tcp/127.0.0.1:7447"),
        ("tcp/0.0.0.0:7447#so_sndbuf=65536", "tcp/127.0.0.1:7447"),
        ("tls/0.0.0.0:7447", "tls/127.0.0.1:7447"),
        ("tcp/[::]:7000", "tcp/[::1]:7000"),
        ("tcp/10.0.0.0:7447", "tcp/10.0.0.0:7447"),
        ("udp/127.0.0.1:7447?rel=1", "udp/127.0.0.1:7447"),
    ],
)
def test_nodes_on_this_machine_reach_a_router_that_listens_everywhere(listen, found):
    assert local_endpoint(listen) == found
