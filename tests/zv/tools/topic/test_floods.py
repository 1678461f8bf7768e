"""Streams and messages without end: what the tools keep of them is bounded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import zenoh

from zv.tools.shared.output import Output
from zv.tools.topic import echo
from zv.tools.topic.statistics import MAX_STREAMS, MAX_WAITING, StreamMonitor


class Session:
    """Hands samples to whoever subscribed, as Zenoh's thread does."""

    stopping = False

    def __init__(self) -> None:
        self.receive: Callable[[Any], None] = lambda _: None

    def subscribe(self, _key: str, receive: Callable[[Any], None]) -> None:
        self.receive = receive

    def ask(self, _key: str) -> list[object]:
        return []


class Sample:
    """As much of a sample as the tools look at."""

    attachment = None
    encoding = "text/plain"
    kind = zenoh.SampleKind.PUT

    def __init__(self, key: str, size: int = 1) -> None:
        self.key_expr = zenoh.KeyExpr(key)
        self.payload = zenoh.ZBytes(bytes(size))


def test_of_streams_without_end_only_so_many_are_measured():
    session = Session()
    monitor = StreamMonitor(session, ["vision/**"])
    for n in range(MAX_STREAMS + 500):
        session.receive(Sample(f"vision/a/{n}"))
    monitor.update()
    session.receive(Sample("vision/a/7"))
    monitor.update()
    assert len(monitor.streams) == MAX_STREAMS
    assert monitor.left_out == 500
    assert {s.total for s in monitor.streams if s.key == "vision/a/7"} == {2}


def test_between_two_updates_only_so_many_samples_wait():
    session = Session()
    monitor = StreamMonitor(session, ["vision/**"])
    for _ in range(MAX_WAITING + 500):
        session.receive(Sample("vision/a/b"))
    monitor.update()
    assert [s.total for s in monitor.streams] == [MAX_WAITING]
    assert monitor.left_out == 500


def test_what_waits_to_be_printed_is_bounded_in_bytes(capsys):
    session = Session()
    samples = echo._samples(session, "vision/**", 0.3, Output())
    subscribe, printed = session.subscribe, []

    def flood(key: str, receive: Callable[[Any], None]) -> None:
        subscribe(key, receive)
        for _ in range(100):
            receive(Sample("vision/a/b", 1 << 20))

    session.subscribe = flood
    printed = list(samples)
    assert len(printed) == 16
    assert "some were skipped" in capsys.readouterr().err
