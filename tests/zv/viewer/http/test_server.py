"""An error that nobody expects, on the event loop: it is seen, wherever it happens."""

import asyncio
import logging
import threading
from typing import Any

import pytest

from tests.support.viewer.serving import FakeNode, serving
from tests.support.waiting import wait_until
from zenoh_vision.messages import Level
from zv.viewer.discovery.monitor import SystemMonitor
from zv.viewer.discovery.network import Mailbox
from zv.viewer.http import server


@pytest.fixture
def node() -> FakeNode:
    return FakeNode()


def fail(*_: object) -> None:
    raise KeyError("nobody expects this")


def test_the_process_ends_with_the_error_of_what_has_to_run_forever(node, monkeypatch):
    monkeypatch.setattr(SystemMonitor, "_settle_soon", fail)
    with pytest.raises(KeyError, match="nobody expects this"), serving(node):
        assert node.stopped.wait(10)


def test_the_loop_says_that_it_is_alive(node, monkeypatch):
    said = threading.Event()
    monkeypatch.setattr(node.health, "loop_alive", said.set)
    with serving(node):
        assert said.wait(10)


def test_clients_that_are_slow_to_go_are_no_error_at_the_end(node, monkeypatch):
    async def slow(_: object) -> None:
        await asyncio.sleep(60)

    monkeypatch.setattr(server.web.AppRunner, "cleanup", slow)
    monkeypatch.setattr(server, "STOP_S", 0.2)
    with serving(node) as running:
        pass
    assert not running._thread.is_alive()
    assert not node.stopped.is_set()


@pytest.mark.parametrize("how", ["callback", "task"])
def test_an_error_that_no_caller_sees_is_logged_once_and_the_node_is_in_error_for_a_while(
    node, monkeypatch, caplog, how
):
    monkeypatch.setattr(server, "FAULTY_S", 1.0)
    monkeypatch.setattr(server, "ALIVE_S", 0.01)

    async def task() -> None:
        fail()

    with caplog.at_level(logging.ERROR), serving(node) as running:
        for _ in range(5):
            work = fail if how == "callback" else lambda: running._loop.create_task(task()) and None
            running._loop.call_soon_threadsafe(work)
        wait_until(lambda: node.health.diagnostics().level == Level.ERROR)
        assert "unexpected KeyError" in node.health.failure()
        wait_until(lambda: node.health.diagnostics().level == Level.OK)
    assert len(caplog.records) == 1
    assert "nobody expects this" in caplog.text


def test_a_client_that_breaks_its_connection_is_no_error(node, caplog):
    def broken() -> None:
        raise ConnectionResetError

    with serving(node) as running:
        running._loop.call_soon_threadsafe(broken)
        after = threading.Event()
        running._loop.call_soon_threadsafe(after.set)
        assert after.wait(10)
        assert node.health.failure() == ""
    assert not caplog.records


async def test_an_event_that_fails_does_not_hold_up_those_behind_it() -> None:
    taken: list[str] = []
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(lambda *_: None)

    def take(key: Any, _: object) -> None:
        taken.append(key[0])
        if key[0] == "a":
            fail()

    mailbox = Mailbox(loop, take)
    for name in "abc":
        mailbox.put((name, bool, ""), True)
    async with asyncio.timeout(10):
        while len(taken) < 3:
            await asyncio.sleep(0)
    assert taken == ["a", "b", "c"]
