"""``/live``, as the page uses it: the pictures and messages of streams."""

from __future__ import annotations

import asyncio
import re
import time
from functools import partial
from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.listening import Listener, open_client
from tests.support.pictures.encoded import full_hd_jpeg
from tests.support.publishing import Paced, PlainCamera
from tests.support.routing import Router
from tests.support.viewer.client import IMAGE, Page, Viewer
from tests.support.viewer.slow_link import ONE_MBIT, SlowLink
from tests.support.waiting import wait_until
from zenoh_vision.image import codecs
from zv.viewer.websocket.sender import PART_BYTES

EDGES = "vision/front/edges/compressed"
TRUTH = "vision/front/truth"


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


async def test_pictures_come_whole_identified_and_in_the_size_asked_for(viewer: Viewer, service):
    service("camera", "--rate", 15, "--width", 640, "--height", 480)
    async with viewer.page() as page:
        await page.streams(IMAGE)
        await page.ask("watch", key=IMAGE)
        heads = []
        for _ in range(5):
            head, payload = await page.picture()
            assert head["bytes"] == len(payload)
            assert (head["width"], head["height"], head["mime"]) == (640, 480, "image/jpeg")
            assert head["header"]["epoch"].isdecimal()
            stamp_ns = int(head["header"]["stamp_ns"])
            assert 0 < head["age_ms"] <= (time.time_ns() - stamp_ns) / 1e6
            heads.append(head)
        numbers = [head["header"]["seq"] for head in heads]
        assert numbers == sorted(set(numbers))
        await page.ask("watch", key=IMAGE, width=200, height=200)
        while (found := await page.picture())[0]["width"] == 640:
            pass
        assert (found[0]["width"], found[0]["height"]) == (200, 150)
        assert found[0]["header"]["width"] == 640
        pixels = cv2.imdecode(np.frombuffer(found[1], np.uint8), cv2.IMREAD_COLOR)
        assert pixels.shape == (150, 200, 3)


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


async def test_messages_of_a_watched_stream_come_one_by_one(viewer: Viewer, client, service):
    service("camera", "--rate", 15)
    sent = Listener(client, TRUTH)  # a frame that the camera drops has no truth
    async with viewer.page() as page:
        await page.streams(TRUTH)
        await page.ask("watch", key=TRUTH)
        found = [await page.text("message", key=TRUTH) for _ in range(10)]
        numbers = [each["header"]["seq"] for each in found]
        wait_until(lambda: sent.messages[-1].header["seq"] >= numbers[-1])
        published = [message.header["seq"] for message in sent.messages]
        first = published.index(numbers[0])
        assert numbers == published[first : first + 10]
        assert found[0]["body"]["tracks"][0]["box"]
        await page.ask("unwatch", key=TRUTH)


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


async def test_a_key_without_frames_is_silent_for_as_long_as_it_is_watched(quick_service):
    viewer = Viewer(quick_service("view", "--port", 0))
    async with viewer.page() as page:
        before_s = 0.0
        while before_s < 1.5:
            health = await page.text("health", node="viewer")
            before_s = health["diagnostics"]["uptime_s"]
        watched_s = time.monotonic()
        await page.ask("watch", key=IMAGE)
        found = None
        while found is None:
            health = await page.text("health", node="viewer")
            found = re.match(rf"no frame on {IMAGE} for (\d+) s", health["diagnostics"]["message"])
        silent_s, up_s = int(found[1]), health["diagnostics"]["uptime_s"]
        assert silent_s <= time.monotonic() - watched_s + 0.5  # which it is rounded by
        assert silent_s <= up_s - before_s + 0.5


async def test_a_slow_link_carries_the_newest_pictures_in_parts_and_is_not_given_up(
    viewer: Viewer, client
):
    picture = full_hd_jpeg()
    size, camera = len(picture), PlainCamera(client, pictures=(picture,))
    at_sending: dict[int, int] = {}  # number of a frame -> bytes that the link had carried

    def send() -> None:
        at_sending[camera.seq] = link.carried
        camera.send()

    with SlowLink(viewer.port, ONE_MBIT) as link, camera.at(30, send):
        async with viewer.page(port=link.port, max_msg_size=2 * PART_BYTES) as page:
            await page.text("streams")
            await page.ask("watch", key=IMAGE)
            ages, skipped, said = [], 0, []
            while len(ages) < 4 or not said:
                head, payload = await page.picture()
                assert jpeg_size(payload) == (1920, 1080)
                assert head["bytes"] == len(payload)
                ages.append(link.carried - at_sending[head["header"]["seq"]])
                skipped += head["skipped"]
                said = [text["bits_per_s"] for text in page.texts if text["op"] == "link"]
            # A picture that was sent when the one before it had left the viewer.
            assert max(ages) < 3.5 * size
            assert skipped
            assert said[-1] < 16 * ONE_MBIT
            during = [text["op"] for text in page.during]
            assert "tick" in during
    assert sum(line.startswith("GET /live") for line in link.requests) == 1


def jpeg_size(payload: bytes) -> tuple[int, int]:
    pixels = cv2.imdecode(np.frombuffer(payload, np.uint8), cv2.IMREAD_COLOR)
    return pixels.shape[1], pixels.shape[0]
