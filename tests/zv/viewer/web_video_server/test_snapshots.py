"""How many snapshots are made or sent at once."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
from aiohttp import web

from zv.viewer.discovery.system_state import SystemState
from zv.viewer.web_video_server.handlers import MAX_SNAPSHOTS, WebVideoServer


async def test_there_is_a_limit_to_the_snapshots_that_wait_and_places_become_free():
    asked = []

    async def snapshot(*given: object) -> None:
        asked.append(given)
        await asyncio.Event().wait()

    registry: Any = SimpleNamespace(snapshot=snapshot)
    server = WebVideoServer(registry, SystemState("vision", lambda text, replaces: None))
    request: Any = SimpleNamespace(query={"topic": "/front/image/compressed"}, remote="x")
    tasks = [asyncio.ensure_future(server.snapshot(request)) for _ in range(MAX_SNAPSHOTS)]
    await asyncio.sleep(0)
    with pytest.raises(web.HTTPServiceUnavailable):
        await server.snapshot(request)
    assert len(asked) == MAX_SNAPSHOTS
    tasks[0].cancel()
    await asyncio.gather(tasks[0], return_exceptions=True)
    tasks[0] = asyncio.ensure_future(server.snapshot(request))
    await asyncio.sleep(0)
    assert len(asked) == MAX_SNAPSHOTS + 1
    for task in tasks:
        task.cancel()
