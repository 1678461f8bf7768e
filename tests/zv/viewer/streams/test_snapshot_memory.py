"""Snapshots and streams hold no frame whose pixels nobody needs: each may take 100 MB."""

import asyncio
import gc
import threading
import weakref
from collections.abc import Iterator
from unittest.mock import AsyncMock, Mock

import pytest
from aiohttp.test_utils import make_mocked_request

from tests.support.viewer.picture_streams import KEY, SMALL, Source
from tests.support.waiting import DEADLINE_S
from zv.viewer.discovery.system_state import SystemState
from zv.viewer.streams.registry import StreamRegistry
from zv.viewer.web_video_server.handlers import WebVideoServer


@pytest.fixture
def streams(registry, source: Source) -> StreamRegistry:
    """A registry that has one open stream."""
    found = StreamRegistry(registry.context)
    found._pictures[KEY] = source.stream
    return found


@pytest.fixture(autouse=True)
def no_collection() -> Iterator[None]:
    """Only references keep something alive: no cycle is collected by chance."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


async def test_the_refusal_of_a_snapshot_does_not_hold_its_frame(streams, source):
    source.comes()
    frame = weakref.ref(source.stream.newest_frame())

    def refuse(pixels: int) -> None:
        assert pixels == 32 * 24
        raise PermissionError

    with pytest.raises(PermissionError) as refusal:
        await streams.snapshot(KEY, SMALL, refuse)
    source.comes()
    assert frame() is None
    assert refusal.value.__traceback__ is not None


async def test_snapshots_that_wait_for_a_thread_take_the_newest_frame_and_hold_none(
    streams, registry, source
):
    free = threading.Event()
    busy = [registry.pool.submit(free.wait, DEADLINE_S) for _ in range(2)]
    source.comes()
    asked = [asyncio.ensure_future(streams.snapshot(KEY, SMALL, int)) for _ in range(5)]
    for _ in range(3):
        await asyncio.sleep(0)
    source.comes()
    second = weakref.ref(source.stream.newest_frame())
    source.comes()
    assert second() is None
    free.set()
    found = await asyncio.gather(*asked)
    assert all(work.result() for work in busy)
    # Two had their turn, and waited for a thread of the pool only.
    assert [each.header.seq for each in found if each] == [1, 1, 3, 3, 3]


async def test_a_client_of_a_stream_does_not_hold_its_first_frame(streams, source):
    system = SystemState("vision", lambda text, replaces: None)
    system.set_published([KEY])
    parts = asyncio.Semaphore(0)

    async def write(data: bytes) -> None:
        parts.release()

    writer = Mock(write=write, write_headers=AsyncMock(), drain=AsyncMock())
    source.comes()
    first = weakref.ref(source.stream.newest_frame())
    path = f"/stream?topic=/{KEY.partition('/')[2]}"
    request = make_mocked_request("GET", path, writer=writer)
    client = asyncio.ensure_future(WebVideoServer(streams, system).stream(request))
    await parts.acquire()
    await parts.acquire()
    source.comes()
    await parts.acquire()
    assert first() is None
    client.cancel()
    await asyncio.gather(client, return_exceptions=True)
