"""``/live`` with pages and publishers that do what they should not: no other page notices."""

from __future__ import annotations

import asyncio
from contextlib import suppress

import aiohttp
import numpy as np
import pytest

from tests.support.pictures.encoded import jpeg
from tests.support.publishing import PlainCamera
from tests.support.viewer.client import IMAGE, Page, Viewer
from zv.viewer.websocket.commands import MAX_BYTES, MAX_RATE_HZ


async def test_what_makes_no_sense_is_said_and_the_rest_goes_on(viewer: Viewer, client):
    camera = PlainCamera(client)
    with camera.at(15):
        async with viewer.page() as page:
            for text in ("{", '{"op":"watch","key":"**"}', '{"op":"watch","key":"other/a/b"}'):
                await page.socket.send_str(text)
                assert (await page.text("error"))["text"]
            await page.ask("watch", key=IMAGE)
            assert (await page.picture())[0]["key"] == IMAGE


async def test_more_than_32_watches_are_refused(standing_viewer: Viewer):
    async with standing_viewer.page() as page:
        await page.text("streams")
        for number in range(33):
            await page.ask("watch", key=f"vision/front/x{number}/compressed")
        refused = await page.text("error")
        assert refused["key"] == "vision/front/x32/compressed"
        assert refused["text"].startswith("vision/front/x32/compressed is not watched: 32 ")


@pytest.mark.parametrize(("kind", "code"), [("large", 1009), ("fast", 1008), ("binary", 1008)])
async def test_a_page_that_sends_too_much_is_closed(standing_viewer: Viewer, kind: str, code: int):
    async with standing_viewer.page() as page:
        await page.text("streams")
        if kind == "large":
            await page.socket.send_str("x" * (MAX_BYTES + 1))
        elif kind == "binary":
            await page.socket.send_bytes(b"x")
        message = None
        while message is None:
            if kind == "fast":  # again, if this test was too slow to be fast
                for _ in range(MAX_RATE_HZ + 10):
                    await page.ask("unwatch", key="a")
            with suppress(TimeoutError):
                message = await asyncio.wait_for(no_text(page), 2)
        assert message.type == aiohttp.WSMsgType.CLOSE
        assert message.data == code
    assert standing_viewer.get("/healthz").status == 200


async def no_text(page: Page) -> aiohttp.WSMessage:
    """Return the next that is no text."""
    while (message := await page.socket.receive()).type == aiohttp.WSMsgType.TEXT:
        pass
    return message


async def test_a_page_may_say_much_at_once_and_often_that_it_shows_a_picture(
    standing_viewer: Viewer,
):
    async with standing_viewer.page() as page:
        await page.socket.send_str("x" * MAX_BYTES)
        assert (await page.text("error"))["text"]
        for _ in range(20 * MAX_RATE_HZ):
            await page.ask("shown", key=IMAGE)
        await page.ask("watch", key="**")
        assert "** is not watched" in (await page.text("error"))["text"]


async def test_a_page_that_reads_nothing_costs_the_others_nothing_and_is_left(
    viewer: Viewer, client
):
    noise = np.random.default_rng(1).integers(0, 255, (480, 640, 3), np.uint8)
    camera = PlainCamera(client, pictures=(jpeg(noise),))  # 300 kB: buffers fill soon
    async with viewer.page() as deaf, viewer.page() as page:
        await deaf.ask("watch", key=IMAGE)
        await page.ask("watch", key=IMAGE)
        with camera.at(30):
            head, _ = await page.picture()
        while head["header"]["seq"] != camera.seq - 1:
            head, _ = await page.picture()
        for _ in range(60):  # every frame is shown before the next one comes
            await deaf.ask("shown", key=IMAGE)  # it says that it took it, and reads nothing
            seq = camera.send()
            assert (await page.picture())[0]["header"]["seq"] == seq
