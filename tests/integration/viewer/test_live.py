"""``/live``, as the page uses it."""

from __future__ import annotations

import asyncio
import re
import time
import tomllib
from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.listening import Listener
from tests.support.pictures import full_hd_jpeg
from tests.support.publishing import PlainCamera
from tests.support.routing import Router
from tests.support.slow_link import ONE_MBIT, SlowLink
from tests.support.viewer_client import IMAGE, Page, Viewer, run
from tests.support.waiting import wait_until
from zv.viewer.websocket.session import PART_BYTES

EDGES = "vision/front/edges/compressed"
TRUTH = "vision/front/truth"


def test_a_page_learns_who_is_there_and_what_they_send(viewer: Viewer, service):
    service("camera", "--rate", 15)
    service("edge")

    async def test() -> None:
        async with viewer.page() as page:
            assert (await page.text("hello"))["server"] == "viewer"
            streams = {each["key"]: each for each in await page.streams(IMAGE, EDGES, TRUTH)}
            assert (streams[IMAGE]["kind"], streams[IMAGE]["type"]) == ("picture", "image/jpeg")
            assert (streams[TRUTH]["kind"], streams[TRUTH]["type"]) == (
                "message",
                "vision.Tracks.v1",
            )
            assert streams[EDGES]["node"] == "edge_front"
            health = await page.text("health", node="camera_front")
            assert health["at_ns"].isdecimal()
            while not health["diagnostics"]["counters"]["captured"]:  # the first may be too early
                health = await page.text("health", node="camera_front")
        async with viewer.page() as page:  # a page that comes later is told all at once
            await page.text("streams")
            parameters = await page.text("parameters", node="edge_front")
            low = next(each for each in parameters["parameters"] if each["name"] == "low")
            assert (low["minimum"], low["type"]) == (0, "float")
            nodes = [text for text in page.texts if text["op"] == "nodes"][-1]["nodes"]
            assert {"camera_front", "edge_front", "viewer"} <= {each["node"] for each in nodes}
            own = next(each for each in nodes if each["node"] == "viewer")
            assert own["service"] == "viewer"
            assert own["alive"]

    run(test())


def test_a_page_hears_a_tick_also_while_there_is_no_router(viewer: Viewer, router: Router):
    router.kill()

    async def test() -> None:
        async with viewer.page() as page:
            await page.text("router", connected=False)
            ticks = [await page.text("tick") for _ in range(2)]
            apart_s = (int(ticks[1]["now_ns"]) - int(ticks[0]["now_ns"])) / 1e9
            assert 1 < apart_s < 6  # when the page gives up

    run(test())


def test_pictures_come_whole_identified_and_in_the_size_asked_for(viewer: Viewer, service):
    service("camera", "--rate", 15, "--width", 640, "--height", 480)

    async def test() -> None:
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

    run(test())


def test_without_shown_two_pictures_come_and_then_the_newest(viewer: Viewer, client):
    camera = PlainCamera(client)

    async def test() -> None:
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

    with camera.at(60):
        run(test())


def seq_of_newest(viewer: Viewer) -> int:
    """Return the number of the newest picture that the viewer has."""
    return int(viewer.get("/snapshot?topic=/front/image/compressed").headers["x-seq"])


def test_messages_of_a_watched_stream_come_one_by_one(viewer: Viewer, client, service):
    service("camera", "--rate", 15)
    sent = Listener(client, TRUTH)  # a frame that the camera drops has no truth

    async def test() -> None:
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

    run(test())


def test_a_parameter_is_set_for_all_pages_and_a_refusal_says_why(viewer: Viewer, service):
    service("camera", "--rate", 15)
    service("edge")

    async def test() -> None:
        async with viewer.page() as page, viewer.page() as other:
            await page.text("parameters", node="edge_front")
            await other.text("parameters", node="edge_front")
            await page.ask("set", id=1, node="edge_front", values={"low": 10.0, "high": 20})
            reply = await page.text("reply", id=1)
            assert reply["ok"]
            assert reply["revision"] == 1
            for _ in range(2):
                changed = (await other.text("parameter", node="edge_front"))["parameter"]
                assert (changed["name"], changed["value"]) in (("low", 10.0), ("high", 20.0))
            await page.ask("set", id=2, node="edge_front", values={"low": 90.0, "sigma": 1.0})
            refused = await page.text("reply", id=2)
            assert not refused["ok"]
            assert "low = 90 is above high = 20" in refused["error"]
            assert refused["allowed"] == "low at most high"
            await page.ask("set", id=3, node="nobody", values={"low": 1})
            assert "does not answer" in (await page.text("reply", id=3))["error"]
            await page.ask("dump", id=4, node="edge_front")
            toml = tomllib.loads((await page.text("reply", id=4))["toml"])
            assert (toml["low"], toml["high"], toml["sigma"]) == (10.0, 20.0, 1.4)
            await page.ask("watch", key=EDGES)
            while (await page.picture())[0]["header"]["revision"] != 1:
                pass

    run(test())


def test_a_page_gets_of_panels_what_it_shows_and_all_of_it_when_it_begins_to(
    viewer: Viewer, service
):
    service("camera", "--rate", 15)

    async def test() -> None:
        async with viewer.page() as other, viewer.page("?show=") as page:
            await page.streams(IMAGE)
            for _ in range(2):  # what others get meanwhile
                await other.text("health", node="camera_front")
            await page.text("tick")
            await page.text("tick")
            assert {text["op"] for text in page.texts} <= {
                "hello", "router", "nodes", "streams", "tick",
            }  # fmt: skip
            await page.ask("show", kinds=["parameters", "log", "matches"])
            assert (await page.text("log"))["text"]
            await page.text("matches")
            await page.text("parameters", node="camera_front")
            await page.ask("show", kinds=["health"])
            await page.text("health", node="camera_front")
            before = len(page.texts)
            await other.ask("set", id=1, node="camera_front", values={"rate": 14.0})
            await other.text("parameter", node="camera_front")
            await page.text("health", node="camera_front")
            await page.text("health", node="camera_front")
            since = {text["op"] for text in page.texts[before:]}
            assert not since & {"parameter", "parameters", "log", "matches"}
            await page.ask("show", kinds=["everything"])
            assert (await page.text("error"))["text"]

    run(test())


def test_a_stream_that_stops_is_said_to_have_ended_and_goes_on_by_itself(
    viewer: Viewer, service, router: Router
):
    camera = service("camera", "--rate", 15)

    async def test() -> None:
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
            assert not (await until(page, "router"))["connected"]
            await until_ended(page)
            router.start()
            while True:  # on a busy machine the first are old
                found, _ = await page.picture()
                if found["header"]["epoch"] >= head["header"]["epoch"] and found["age_ms"] < 1000:
                    break
            said = {text["text"] for text in page.texts if text["op"] == "log"}
            while not {"the router is gone", "the router is there"} <= said:
                said.add((await until(page, "log"))["text"])

    run(test())


def lives(page: Page) -> dict[str, bool]:
    """Return which streams are live, by what the page was told last."""
    streams = [text for text in page.texts if text["op"] == "streams"][-1]["streams"]
    return {each["key"]: each["live"] for each in streams}


async def until(page: Page, op: str) -> dict[str, Any]:
    """Return the next text of this kind; pictures before it are taken."""
    while True:
        found = await page.next()
        if isinstance(found, tuple):
            await page.ask("shown", key=found[0]["key"])
        elif found["op"] == op:
            return found


async def until_ended(page: Page) -> dict[str, Any]:
    return await until(page, "ended")


def test_a_key_without_frames_is_silent_for_as_long_as_it_is_watched(quick_service):
    viewer = Viewer(quick_service("view", "--port", 0))

    async def test() -> None:
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
                found = re.match(
                    rf"no frame on {IMAGE} for (\d+) s", health["diagnostics"]["message"]
                )
            silent_s, up_s = int(found[1]), health["diagnostics"]["uptime_s"]
            assert silent_s <= time.monotonic() - watched_s + 0.5  # which it is rounded by
            assert silent_s <= up_s - before_s + 0.5

    run(test())


def test_a_slow_link_carries_the_newest_pictures_in_parts_and_is_not_given_up(
    viewer: Viewer, client
):
    picture = full_hd_jpeg()
    size, camera = len(picture), PlainCamera(client, pictures=(picture,))
    at_sending: dict[int, int] = {}  # number of a frame -> bytes that the link had carried

    async def test() -> None:
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

    def send() -> None:
        at_sending[camera.seq] = link.carried
        camera.send()

    with SlowLink(viewer.port, ONE_MBIT) as link, camera.at(30, send):
        run(test())
    assert sum(line.startswith("GET /live") for line in link.requests) == 1


def jpeg_size(payload: bytes) -> tuple[int, int]:
    pixels = cv2.imdecode(np.frombuffer(payload, np.uint8), cv2.IMREAD_COLOR)
    return pixels.shape[1], pixels.shape[0]


def test_nodes_that_go_are_told_as_gone_and_forgotten_subscriptions_end(viewer: Viewer, service):
    camera = service("camera", "--rate", 15)

    async def test() -> None:
        async with viewer.page() as page:
            await page.streams(IMAGE)
            await page.ask("watch", key=IMAGE)
            await page.picture()
            # The list may have come before the picture: what came so far counts, too.
            while not any(
                IMAGE in each.get("subscribes", ())
                for text in page.texts
                if text["op"] == "nodes"
                for each in text["nodes"]
            ):
                await page.text("nodes")
            camera.process.kill()
            nodes = await until(page, "nodes")
            while all(each["alive"] for each in nodes["nodes"]):
                nodes = await until(page, "nodes")
            gone = next(each for each in nodes["nodes"] if not each["alive"])
            assert gone["node"] == "camera_front"
            assert gone["since_ns"].isdecimal()

    run(test())
