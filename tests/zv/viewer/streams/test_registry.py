"""How many streams are subscribed to, and who may have them."""

import asyncio

import pytest

from zv.viewer.streams.registry import MAX_KEYS, StreamRegistry, TooManyStreams
from zv.viewer.streams.rendering import RenderOptions
from zv.viewer.websocket.session import MAX_WATCHES

SAME = RenderOptions()


def watch_all(registry: StreamRegistry, client: str) -> int:
    """Watch streams that nobody else does, as many as one client may; return how many."""
    for number in range(MAX_WATCHES):
        key = f"vision/{client}/x{number}/compressed"
        try:
            registry.pictures(key, SAME, asyncio.Event(), has=number)
        except TooManyStreams:
            return number
    return MAX_WATCHES


def test_clients_that_watch_all_they_can_leave_each_other_its_share(registry):
    streams = StreamRegistry(registry.context)
    streams.clients = 10
    watched = [watch_all(streams, f"c{client}") for client in range(10)]
    assert watched[:8] == [MAX_WATCHES] * 8  # which are all 256
    assert watched[8:] == [MAX_KEYS // 10] * 2


def test_what_somebody_watches_is_no_further_stream(registry):
    streams = StreamRegistry(registry.context)
    streams.clients = 8
    for client in range(8):
        watch_all(streams, f"c{client}")
    streams.pictures("vision/c0/x0/compressed", SAME, has=MAX_WATCHES)
    with pytest.raises(TooManyStreams, match="the maximum is then 32"):
        streams.pictures("vision/c0/more/compressed", SAME, has=MAX_WATCHES)
