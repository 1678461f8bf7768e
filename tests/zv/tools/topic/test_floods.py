"""Streams and messages without end: what the tools keep of them is bounded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any
from unittest.mock import Mock

import pytest
import zenoh

from zenoh_vision.messages import Header
from zenoh_vision.transport.connection import Connection
from zv.tools.shared import statistics
from zv.tools.shared.discovery import Discovery
from zv.tools.shared.output import Output
from zv.tools.shared.statistics import MAX_STREAMS, MAX_WAITING, StreamMonitor
from zv.tools.topic import echo
from zv.tools.topic.list import observe
from zv.tools.topic.measure import HZ, _measure_once, _within


class Session:
    """Hands samples to whoever subscribed, as Zenoh's thread does; waits in simulated time."""

    stopping = False
    namespace = "vision"
    connection = Connection(timeout_s=5.0)

    def __init__(self, rate_hz: float = 0.0) -> None:
        self.receive: Callable[[Any], None] = lambda _: None
        self.rate_hz, self.sent, self.end_s, self.time_s = rate_hz, 0, 0.0, 0.0

    def clock(self) -> float:
        return self.time_s

    def wait(self, seconds: float, until: Callable[[], object] = lambda: False) -> bool:
        self.end_s += seconds
        while not until() and self.rate_hz and (self.sent + 1) / self.rate_hz <= self.end_s:
            self.sent += 1
            self.time_s = self.sent / self.rate_hz
            self.receive(Sample("vision/a/b"))
        self.time_s = self.end_s = self.time_s if until() else self.end_s
        return True

    def subscribe(self, _key: str, receive: Callable[[Any], None]) -> Mock:
        self.receive = receive
        return Mock()

    def ask(self, _key: str) -> list[object]:
        return []


class Sample:
    """As much of a sample as the tools look at."""

    attachment: zenoh.ZBytes | None = None
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
    assert {s.samples.count for s in monitor.streams if s.key == "vision/a/7"} == {2}


def test_between_two_updates_only_so_many_samples_wait():
    session = Session()
    monitor = StreamMonitor(session, ["vision/**"])
    for _ in range(MAX_WAITING + 500):
        session.receive(Sample("vision/a/b"))
    monitor.update()
    assert [s.samples.count for s in monitor.streams] == [MAX_WAITING]
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


def test_a_long_measurement_counts_every_message_in_bounded_memory():
    session = Session(rate_hz=60)
    monitor = StreamMonitor(session, ["vision/**"])
    (found,), seconds = _measure_once(HZ, 900.0, session, monitor, Output())
    record = found.record()
    assert record["messages"] == 60 * 900 + 1  # 2.7 times what may wait
    assert record["rate_hz"] == pytest.approx(60)
    assert (record["min_ms"], record["max_ms"]) == pytest.approx((1000 / 60, 1000 / 60), abs=0.001)
    assert seconds == pytest.approx(900)
    assert monitor.left_out == 0
    assert list(found.failures(60, 0.01, None)) == []
    assert len(list(found.failures(30, 0.1, None))) == 1


def test_a_long_list_shows_the_rate_of_all_messages():
    session = Session(rate_hz=600)
    found = Discovery(nodes=(), publishers={}, subscribers={}, answered=True)
    (entry,) = observe(session, found, "vision/**", 60.0, None, everything=True)
    assert entry.rate_hz == pytest.approx(600, rel=0.001)


def test_a_moving_window_with_too_many_messages_is_shorter_and_its_rate_right(monkeypatch):
    monkeypatch.setattr(statistics, "MAX_RECENT", 1000)
    session = Session(rate_hz=100)
    monitor = StreamMonitor(session, ["vision/**"], moving=True)
    for _ in range(50):
        session.wait(1.0)
        monitor.update()
    (found,) = _within(HZ, monitor, 0.0, session.time_s)
    record = found.record()
    assert record["messages"] == 1000  # the newest 10 s
    assert record["rate_hz"] == pytest.approx(100)
    assert record["seconds"] == pytest.approx(10, abs=0.1)


def numbered(seq: int) -> Sample:
    """Return a sample of a camera, with its number."""
    sample = Sample("vision/a/image/compressed")
    header = Header(camera="a", epoch=1, seq=seq, stamp_ns=1, width=1, height=1, node="camera_a")
    sample.attachment = zenoh.ZBytes(header.to_bytes())
    return sample


def test_a_stream_that_was_silent_for_long_is_hidden_and_has_lost_what_it_missed():
    session = Session()
    monitor = StreamMonitor(session, ["vision/**"], moving=True)

    def lost(at_s: float, *numbers: int) -> list[int | None]:
        session.time_s = at_s
        for seq in numbers:
            session.receive(numbered(seq))
        monitor.update()
        return [found.stream.lost for found in _within(HZ, monitor, at_s - 5.0, at_s)]

    assert lost(1.0, 0, 1) == [0]
    assert lost(12.0) == []
    assert lost(13.0, 9, 10) == [7]  # 2 to 8


def test_if_there_is_no_room_a_silent_stream_makes_it(monkeypatch):
    monkeypatch.setattr(statistics, "MAX_STREAMS", 1)
    session = Session()
    monitor = StreamMonitor(session, ["vision/**"], moving=True)
    session.receive(Sample("vision/a/b"))
    monitor.update()
    assert _within(HZ, monitor, 6.0, 11.0) == []
    session.receive(Sample("vision/a/c"))
    monitor.update()
    assert [each.key for each in monitor.streams] == ["vision/a/c"]
