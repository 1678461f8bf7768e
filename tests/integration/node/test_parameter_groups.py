"""Parameters that come and go while a node runs, as another program sees them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import msgpack
import pytest
import zenoh

from tests.integration.conftest import a_router
from tests.support.listening import ask, open_client
from tests.support.waiting import wait_until
from tests.zenoh_vision.config.test_parameter_groups import Dials, LensSettings
from zenoh_vision import Connection, Node, ParameterStore

ALL = "@vision/param/lamp_front"


@dataclass
class System:
    """A node with a group of parameters that can be plugged in, and a client that listens."""

    client: zenoh.Session
    store: ParameterStore[LensSettings]
    dials: Dials
    heard: list[tuple[str, Any]] = field(default_factory=list)

    def listen(self, sample: zenoh.Sample) -> None:
        there = sample.kind == zenoh.SampleKind.PUT
        value = msgpack.unpackb(sample.payload.to_bytes())["value"] if there else "gone"
        self.heard.append((str(sample.key_expr).removeprefix(f"{ALL}/"), value))

    def listed(self) -> Mapping[str, Any]:
        (reply,) = ask(self.client, ALL)
        return {one["name"]: one["value"] for one in reply.body["parameters"]}

    def set(self, **values: int) -> zenoh.Reply:
        named = {name.replace("__", "."): value for name, value in values.items()}
        (reply,) = self.client.get("@vision/set/lamp_front", payload=msgpack.packb(named))
        return reply


@pytest.fixture
def system(tmp_path) -> Iterator[System]:
    store = ParameterStore(LensSettings())
    with (
        a_router(tmp_path) as router,
        Node("lamp", connection=Connection(router.endpoint), parameters=store),
        open_client(router.endpoint) as client,
    ):
        found = System(client, store, Dials())
        client.declare_subscriber(f"{ALL}/*", found.listen)
        wait_until(lambda: bool(ask(client, ALL)))
        yield found


def test_they_are_published_when_they_come_set_like_others_and_deleted_when_they_go(
    system: System,
):
    assert "dial.zoom" not in system.listed()
    system.store.add(system.dials)
    wait_until(lambda: ("dial.zoom", 0) in system.heard)
    assert system.listed()["dial.zoom"] == 0
    assert system.set(dial__zoom=57, power=3).ok
    wait_until(lambda: {("dial.zoom", 50), ("power", 3)} <= set(system.heard))
    assert ask(system.client, f"{ALL}/dial.zoom")[0].body["value"] == 50
    system.store.remove(system.dials)
    wait_until(lambda: ("dial.zoom", "gone") in system.heard)
    assert "dial.zoom" not in system.listed()


def test_a_refusal_names_the_parameter_and_what_is_allowed(system: System):
    system.store.add(system.dials)
    refused = system.set(dial__zoom=101, power=3).err
    assert refused is not None
    assert msgpack.unpackb(refused.payload.to_bytes()) == {
        "error": "dial.zoom = 101 is not allowed",
        "allowed": "up to 100",
    }
    assert system.listed()["power"] == 50


def test_those_that_go_after_their_node_has_ended_are_no_failure(tmp_path, caplog):
    store, dials = ParameterStore(LensSettings()), Dials()
    with a_router(tmp_path) as router:
        with Node("lamp", connection=Connection(router.endpoint), parameters=store):
            store.add(dials)
        store.remove(dials)  # as a camera's controls do when its device is closed
    assert "a watcher of parameters failed" not in caplog.text
