"""Packets are received while nobody decodes, and skipped up to the newest key picture."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from tests.support.waiting import DEADLINE_S, wait_until
from zv.camera.sources import packet_queue
from zv.camera.sources.packet_queue import PacketQueue


@dataclass(frozen=True)
class Part:
    number: int
    is_keyframe: bool = False
    size: int = 10


class Network:
    """Sends what the test says."""

    def __init__(self) -> None:
        self.sent: queue.Queue[Part | Exception | None] = queue.Queue()
        self.closed = threading.Event()
        self.arrived: list[int] = []

    def __iter__(self) -> Iterator[Part]:
        while (each := self.sent.get()) is not None:
            if isinstance(each, Exception):
                raise each
            yield each

    def send(self, *parts: Part | Exception | None) -> None:
        for part in parts:
            self.sent.put(part)


@pytest.fixture
def network() -> Iterator[Network]:
    found = Network()
    yield found
    found.send(None)


def open_queue(network: Network) -> PacketQueue[Part]:
    return PacketQueue(
        iter(network),
        network.closed.set,
        lambda part, _at_s: network.arrived.append(part.number),
        lambda: network.send(None),
    )


def test_packets_come_in_order_and_with_the_time_of_their_arrival(network: Network):
    packets = open_queue(network)
    network.send(Part(0), Part(1), Part(2))
    wait_until(lambda: network.arrived == [0, 1, 2])
    found = [packets.take(DEADLINE_S) for _ in range(3)]
    assert [each.packet.number for each in found] == [0, 1, 2]
    times = [each.arrived_s for each in found]
    assert times == sorted(times)
    packets.close(DEADLINE_S)
    assert network.closed.is_set()


def test_a_stream_that_ends_or_fails_does_so_after_its_last_packet(network: Network):
    packets = open_queue(network)
    network.send(Part(0), OSError("broken"))
    assert packets.take(DEADLINE_S).packet.number == 0
    with pytest.raises(OSError, match="broken"):
        packets.take(DEADLINE_S)
    packets.close(DEADLINE_S)


def test_a_wait_for_a_packet_ends_in_time(network: Network):
    packets = open_queue(network)
    with pytest.raises(TimeoutError):
        packets.take(0.01)
    network.send(None)
    assert packets.take(DEADLINE_S) is None
    packets.close(DEADLINE_S)


def test_packets_are_skipped_up_to_the_newest_key_picture(network: Network):
    packets = open_queue(network)
    network.send(Part(0, True), Part(1), Part(2, True), Part(3), Part(4, True), Part(5))
    wait_until(lambda: network.arrived == [0, 1, 2, 3, 4, 5])
    packets.settle()
    assert packets.take(0).packet.number == 0
    assert packets.skip_to_newest_key() == 3  # 1, 2 and 3
    assert [packets.take(0).packet.number for _ in range(2)] == [4, 5]
    network.send(Part(6))
    wait_until(lambda: network.arrived[-1] == 6)
    packets.settle()
    assert packets.skip_to_newest_key() is None
    assert packets.take(0).packet.number == 6
    packets.close(DEADLINE_S)


def test_the_memory_of_waiting_packets_is_limited(
    network: Network, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(packet_queue, "MAX_WAITING_BYTES", 35)
    packets = open_queue(network)
    network.send(Part(0, True), Part(1), Part(2, True), Part(3))  # over the limit: 0 and 1 go
    network.send(Part(4), Part(5))  # over it again, and no newer key picture: all go
    network.send(Part(6), Part(7, True), Part(8))  # 6 cannot be decoded without them
    wait_until(lambda: network.arrived[-1:] == [8])
    packets.settle()
    assert [packets.take(0).packet.number for _ in range(2)] == [7, 8]
    assert packets.taken_overflow() == 7
    assert packets.taken_overflow() == 0
    packets.close(DEADLINE_S)


def test_closing_ends_a_wait_for_the_network(network: Network):
    packets = open_queue(network)
    packets.close(DEADLINE_S)
    assert network.closed.is_set()
