"""``/live``, as the page uses it: the pictures and messages of streams."""

from __future__ import annotations

import asyncio
import time
from functools import partial
from typing import Any

import numpy as np
import pytest

from tests.support.listening import open_client
from tests.support.publishing import Paced, PlainCamera
from tests.support.routing import Router
from tests.support.viewer.client import IMAGE, Page, Viewer
from zenoh_vision.image import codecs


async def test_the_pictures_of_a_program_that_is_no_node_are_listed_and_shown(
    viewer: Viewer, router: Router
):
    async with viewer.page() as page:
        with (
            open_client(router.endpoint) as program,
            program.declare_publisher(IMAGE),
            PlainCamera(program).at(20),
        ):
            streams = {each["key"]: each for each in await page.streams(IMAGE)}
            assert streams[IMAGE]["node"] == ""
            await page.ask("watch", key=IMAGE)
            assert (await page.picture())[0]["key"] == IMAGE
        while (await page.text("streams"))["streams"][0]["live"]:
            pass


async def test_depth_is_grey_with_its_range_and_has_its_values_for_a_page_that_asks(
    viewer: Viewer, client
):
    depth = np.repeat(np.array([[0, 2000, 2500, 3000]], np.uint16), 12, axis=0)
    send = partial(client.put, IMAGE, codecs.encode_png(depth), encoding="image/png")
    async with viewer.page() as page:
        await page.text("hello")
        with Paced(20, send):  # bare, as of a program that knows no header
            await page.ask("watch", key=IMAGE)
            head, gray = await page.picture()
            assert head["depth"] == {"min": 2000, "max": 3000, "values": False}
            assert codecs.decode_png(gray)[5].tolist() == [0, 1, 128, 255]
            await page.ask("set", id=1, node="viewer", values={"depth_max": 4540})
            await page.ask("watch", key=IMAGE, values=True)
            while not head["depth"]["values"] or head["depth"]["max"] != 4540:
                head, packed = await page.picture()
            blue, green, red = codecs.decode_png(packed)[5].astype(int).T
            assert (256 * red + green).tolist() == [0, 2000, 2500, 3000]
            assert blue.tolist() == [0, 1, 51, 101]  # 1 + 254 * (v - 2000) / 2540


async def test_without_shown_two_pictures_come_and_then_the_newest(viewer: Viewer, client):
    camera = PlainCamera(client)
    with camera.at(60):
        async with viewer.page() as page:
            await page.text("router", connected=True)
            await page.ask("watch", key=IMAGE)
            first, _ = await page.picture(shown=False)
            await page.picture(shown=False)
            seq = camera.seq
            while (newest := await asyncio.to_thread(seq_of_newest, viewer)) < seq + 40:
                pass
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(page.picture(shown=False), 0.3)
            await page.ask("shown", key=IMAGE)
            head, _ = await page.picture(shown=False)
            assert head["header"]["seq"] >= newest
            assert head["skipped"] >= 38
            assert first["skipped"] == head["lost"] == 0


def seq_of_newest(viewer: Viewer) -> int:
    return int(viewer.get("/snapshot?topic=/front/image/compressed").headers["x-seq"])


async def test_a_stream_that_stops_is_said_to_have_ended_and_goes_on_by_itself(
    viewer: Viewer, service, router: Router
):
    camera = service("camera", "--rate", 15)
    async with viewer.page() as page:
        await page.streams(IMAGE)
        await page.ask("watch", key=IMAGE)
        await page.picture()
        begun_ns = time.time_ns()
        camera.process.terminate()
        ended = await until_ended(page)
        # It says when the last picture came: around the request to end, and not when it knew.
        silent_ns = 1_000_000_000
        assert begun_ns - silent_ns < int(ended["since_ns"]) < time.time_ns() - silent_ns
        while lives(page)[IMAGE]:
            await page.next()
        service("camera", "--rate", 15)
        head, _ = await page.picture()
        router.kill()
        assert not (await page.until("router"))["connected"]
        await until_ended(page)
        router.start()
        while True:  # on a busy machine the first are old
            found, _ = await page.picture()
            if found["header"]["epoch"] >= head["header"]["epoch"] and found["age_ms"] < 1000:
                break
        said = {text["text"] for text in page.texts if text["op"] == "log"}
        while not {"the router is gone", "the router is there"} <= said:
            said.add((await page.until("log"))["text"])


def lives(page: Page) -> dict[str, bool]:
    """Return which streams are live, by what the page was told last."""
    streams = [text for text in page.texts if text["op"] == "streams"][-1]["streams"]
    return {each["key"]: each["live"] for each in streams}


async def until_ended(page: Page) -> dict[str, Any]:
    return await page.until("ended")
