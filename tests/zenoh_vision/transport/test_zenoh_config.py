"""Zenoh's own configuration files: what they state holds, what they leave open is ours."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zenoh

from tests.support.processes import ROOT
from zenoh_vision.errors import ConfigurationError
from zenoh_vision.stream.sample import MAX_ATTACHMENT_BYTES
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.zenoh_config import (
    LEASE_MS,
    RETRY,
    ROUTER_RUNTIME,
    RUNTIME,
    client_config,
    connect_endpoints,
    listen_endpoints,
    router_config,
)

LISTEN, CONNECT = "tcp/127.0.0.1:4", "tcp/127.0.0.1:5"


@pytest.fixture
def client(tmp_path: Path) -> Callable[[str], zenoh.Config]:
    def config(text: str) -> zenoh.Config:
        (tmp_path / "client.json5").write_text(text)
        return client_config(
            Connection(connect=CONNECT, zenoh_config=str(tmp_path / "client.json5"))
        )

    return config


@pytest.fixture
def router(tmp_path: Path) -> Callable[[str], zenoh.Config]:
    def config(text: str) -> zenoh.Config:
        (tmp_path / "router.json5").write_text(text)
        return router_config(LISTEN, str(tmp_path / "router.json5"))

    return config


def of(config: zenoh.Config, key: str) -> Any:
    return json.loads(config.get_json(key))


def test_an_empty_file_changes_nothing(client, router):
    for given, without in (
        (client("{}"), client_config(Connection(connect=CONNECT))),
        (router("{}"), router_config(LISTEN)),
    ):
        assert str(given) == str(without)


@pytest.mark.parametrize("where", ["multicast", "gossip"])
@pytest.mark.parametrize(
    ("text", "on"),
    [
        ("{ transport: { unicast: { max_links: 2 } } }", False),
        ("{ scouting: { WHERE: { enabled: true } } }", True),
        ("{ scouting: { WHERE: { enabled: false } } }", False),
        ("{ scouting: { timeout: 100 } }", False),
    ],
)
def test_nothing_is_searched_for_unless_the_file_says_so(client, router, where, text, on):
    for config in (client(text.replace("WHERE", where)), router(text.replace("WHERE", where))):
        assert of(config, f"scouting/{where}/enabled") is on


@pytest.mark.parametrize(
    ("text", "listens"),
    [
        ("{}", [LISTEN]),
        ("{ connect: { endpoints: ['tcp/192.0.2.1:7447'] } }", [LISTEN]),
        ("{ listen: { timeout_ms: 100 } }", [LISTEN]),
        ("{ listen: { endpoints: { peer: ['tcp/[::]:7'] } } }", [LISTEN]),
        ("{ listen: { endpoints: ['tcp/0.0.0.0:6'] } }", ["tcp/0.0.0.0:6"]),
        ("{ listen: { endpoints: { router: ['tcp/[::]:7447'] } } }", ["tcp/[::]:7447"]),
        ("{ listen: { endpoints: [] } }", []),
    ],
)
def test_a_router_listens_where_its_file_says_else_where_the_flag_says(router, text, listens):
    assert listen_endpoints(router(text)) == listens


@pytest.mark.parametrize(
    ("text", "connects"),
    [
        ("{}", [CONNECT]),
        ("{ connect: { timeout_ms: 100 } }", [CONNECT]),
        ("{ connect: { endpoints: [] } }", [CONNECT]),
        ("{ connect: { endpoints: { router: ['tcp/h:6'] } } }", [CONNECT]),
        ("{ connect: { endpoints: ['tcp/h:6', 'tcp/h:7'] } }", ["tcp/h:6", "tcp/h:7"]),
        ("{ connect: { endpoints: { client: ['tcp/h:6'] } } }", ["tcp/h:6"]),
    ],
)
def test_a_node_connects_where_its_file_says_else_where_the_flag_says(client, text, connects):
    assert connect_endpoints(client(text)) == connects


def test_lease_and_retries_can_be_stated(client):
    assert of(client("{}"), "transport/link/tx/lease") == LEASE_MS
    assert of(client("{}"), "connect/retry") == RETRY
    slow = "{ transport: { link: { tx: { lease: 9000 } } }, connect: { retry: { RETRY } } }"
    slow = slow.replace("RETRY", "period_init_ms: 5, period_max_ms: 7, period_increase_factor: 3")
    assert of(client(slow), "transport/link/tx/lease") == 9000
    assert of(client(slow), "connect/retry")["period_max_ms"] == 7


def test_a_message_may_be_as_large_as_the_largest_raw_frame_and_no_larger(client, router):
    key = "transport/link/rx/max_message_size"
    for_compose = zenoh.Config.from_file(str(ROOT / "configs/router.json5"))
    for config in (client("{}"), router("{}"), for_compose):
        room = of(config, key) - (7680 * 4320 * 4 + MAX_ATTACHMENT_BYTES)
        assert 1 << 20 <= room < 2 << 20
    stated = "{ transport: { link: { rx: { max_message_size: 5000 } } } }"
    assert of(client(stated), key) == of(router(stated), key) == 5000


def test_the_router_of_compose_has_as_many_threads_as_the_embedded_one():
    compose = (ROOT / "docker-compose.yml").read_text()
    assert f'{RUNTIME}: "{ROUTER_RUNTIME}"' in compose


def test_mode_and_shared_memory_are_not_the_files_to_state(client, router):
    text = "{ mode: 'peer', transport: { shared_memory: { enabled: true } } }"
    for config, mode in ((client(text), "client"), (router(text), "router")):
        assert of(config, "mode") == mode
        assert of(config, "transport/shared_memory/enabled") is False


@pytest.mark.parametrize("text", ["{ lisen: {} }", "{ mode: ", "{ mode: 'rooter' }"])
def test_a_file_that_zenoh_does_not_accept_is_named(router, text):
    with pytest.raises(ConfigurationError, match=r"--zenoh-config .*router\.json5: "):
        router(text)
