"""What a node logs about its router: one line each for waiting, connected, lost and back."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from threading import Thread
from unittest.mock import Mock

import pytest

from tests.support.routing import Router, free_port
from tests.support.waiting import wait_until
from zenoh_vision.node.node import Node
from zenoh_vision.transport import handshake, link
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.link import Link


def lines(caplog: pytest.LogCaptureFixture) -> list[str]:
    """Return what was logged about the router, with numbers of seconds as N."""
    told = [each for each in caplog.records if each.name == link.__name__]
    return [re.sub(r"\d+\.\d s", "N s", each.getMessage()) for each in told]


def test_a_node_tells_once_that_it_waits_is_connected_lost_its_router_and_has_it_back(
    router: Router, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    caplog.set_level(logging.INFO)
    monkeypatch.setattr(link, "TELL_AFTER_S", 0.2)
    at = f"the router at {router.endpoint}"
    router.kill()
    node = Node("seer", connection=Connection(connect=router.endpoint))
    opening = Thread(target=node.__enter__)
    opening.start()
    try:
        wait_until(lambda: lines(caplog) == [f"waiting for {at}"])
        router.start()
        opening.join(30)
        connected = [f"waiting for {at}", f"connected to {at} after N s"]
        wait_until(lambda: lines(caplog) == connected, explain=lambda: f"{lines(caplog)}")
        router.kill()
        lost = [*connected, f"lost {at}; trying to reach it again until it is back"]
        wait_until(lambda: lines(caplog) == lost, explain=lambda: f"{lines(caplog)}")
        router.start()
        back = [*lost, f"{at} is back after N s"]
        wait_until(lambda: lines(caplog) == back, explain=lambda: f"{lines(caplog)}")
    finally:
        opening.join(30)
        node.__exit__()
    assert lines(caplog) == back


def test_a_file_that_is_gone_when_the_router_is_lost_is_told_once(
    router: Router,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(link, "REPLACE_AFTER_S", 0.1)
    file = tmp_path / "zenoh.json5"
    file.write_text("{}")
    running = Link(Connection(connect=router.endpoint, zenoh_config=str(file)))
    tried = Mock(wraps=link.try_session)
    monkeypatch.setattr(link, "try_session", tried)
    file.unlink()
    router.kill()
    lost = f"lost the router at {router.endpoint}; trying to reach it again until it is back"
    told = [lost, f"--zenoh-config {file}: no such file"]
    try:
        wait_until(lambda: tried.call_count >= 3 and len(lines(caplog)) >= len(told))
    finally:
        running.close()
    assert lines(caplog) == told


def test_a_tool_that_is_refused_after_its_router_was_lost_says_why_once_and_not_each_minute(
    router: Router, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(handshake, "AGAIN_S", 0.0)
    ended = "the certificate of guest ended 2026-11-28 23:50 UTC, and this machine's clock says "
    whys = [f"{ended}2026-11-28 23:{minute} UTC: renew it" for minute in range(51, 60)]
    asked = Mock(side_effect=[*whys, *[""] * 1000])
    running = Link(Connection(connect=router.endpoint, timeout_s=20))
    monkeypatch.setattr(link, "why_refused", asked)
    router.kill()
    lost = f"lost the router at {router.endpoint}; trying to reach it again until it is back"
    try:
        wait_until(lambda: asked.call_count >= 4)
    finally:
        running.close()
    assert lines(caplog) == [lost, whys[0]]


def test_a_wait_that_is_over_at_once_is_not_logged(
    router: Router, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    Link(Connection(connect=router.endpoint, timeout_s=20)).close()
    assert lines(caplog) == [f"connected to the router at {router.endpoint}"]


def test_a_wait_without_limit_is_told_by_tools_too_which_log_warnings_only(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(link, "TELL_AFTER_S", 0.0)
    caplog.set_level(logging.WARNING)
    connection = Connection(connect=f"tcp/127.0.0.1:{free_port()}")
    for _ in range(2):
        with pytest.raises(Exception, match="told to stop"):
            Link(connection, lambda: bool(caplog.records))
    assert lines(caplog) == [f"waiting for the router at {connection.connect}"] * 2
