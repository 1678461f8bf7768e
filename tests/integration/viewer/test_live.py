"""``/live``, as the page uses it."""

from __future__ import annotations

import asyncio
import re
import time
import tomllib
from collections.abc import Coroutine
from contextlib import suppress
from typing import Any

import aiohttp
import cv2
import msgpack
import numpy as np
import pytest
import zenoh

from tests.support.listening import Listener
from tests.support.pictures import full_hd_jpeg, jpeg
from tests.support.publishing import KEPT, PlainCamera
from tests.support.routing import Router
from tests.support.slow_link import ONE_MBIT, SlowLink
from tests.support.viewer_client import IMAGE, Page, Viewer
from tests.support.waiting import wait_until
from zv.viewer.websocket.commands import MAX_BYTES, MAX_RATE_HZ
from zv.viewer.websocket.session import PART_BYTES

EDGES = "vision/front/edges/compressed"
TRUTH = "vision/front/truth"


def run(test: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(test, 120))


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


def test_what_makes_no_sense_is_said_and_the_rest_goes_on(viewer: Viewer, client):
    camera = PlainCamera(client)

    async def test() -> None:
        async with viewer.page() as page:
            for text in ("{", '{"op":"watch","key":"**"}', '{"op":"watch","key":"other/a/b"}'):
                await page.socket.send_str(text)
                assert (await page.text("error"))["text"]
            await page.ask("watch", key=IMAGE)
            assert (await page.picture())[0]["key"] == IMAGE

    with camera.at(15):
        run(test())


def test_more_than_32_watches_are_refused(standing_viewer: Viewer):
    async def test() -> None:
        async with standing_viewer.page() as page:
            await page.text("streams")
            for number in range(33):
                await page.ask("watch", key=f"vision/front/x{number}/compressed")
            refused = await page.text("error")
            assert refused["key"] == "vision/front/x32/compressed"
            assert refused["text"].startswith("vision/front/x32/compressed is not watched: 32 ")

    run(test())


@pytest.mark.parametrize(
    ("kind", "code"),
    [("large", 1009), ("fast", 1008), ("fast_by_the_word", 1008), ("binary", 1008)],
)
def test_a_page_that_sends_too_much_is_closed(standing_viewer: Viewer, kind: str, code: int):
    async def test() -> None:
        async with standing_viewer.page() as page:
            await page.text("streams")
            if kind == "large":
                await page.socket.send_str("x" * (MAX_BYTES + 1))
            elif kind == "binary":
                await page.socket.send_bytes(b"x")
            message = None
            while message is None:
                if kind.startswith("fast"):  # again, if this test was too slow to be fast
                    for _ in range(MAX_RATE_HZ + 10):
                        await page.ask(
                            "unwatch", key="shown" if kind == "fast_by_the_word" else "a"
                        )
                with suppress(TimeoutError):
                    message = await asyncio.wait_for(no_text(page), 2)
            assert message.type == aiohttp.WSMsgType.CLOSE
            assert message.data == code

    run(test())
    assert standing_viewer.get("/healthz").status == 200


async def no_text(page: Page) -> aiohttp.WSMessage:
    """Return the next that is no text."""
    while (message := await page.socket.receive()).type == aiohttp.WSMsgType.TEXT:
        pass
    return message


def test_a_page_may_say_much_at_once_and_often_that_it_shows_a_picture(standing_viewer: Viewer):
    async def test() -> None:
        async with standing_viewer.page() as page:
            await page.socket.send_str("x" * MAX_BYTES)
            assert (await page.text("error"))["text"]
            for _ in range(20 * MAX_RATE_HZ):
                await page.ask("shown", key=IMAGE)
            await page.ask("watch", key="**")
            assert "** is not watched" in (await page.text("error"))["text"]

    run(test())


def test_broken_pictures_of_a_made_up_run_do_not_silence_the_camera(viewer: Viewer, client):
    camera = PlainCamera(client)
    rogue = PlainCamera(client, epoch=time.time_ns() + 3600 * 10**9)
    broken = camera_jpeg(camera)[:400]

    def send_both() -> None:
        rogue.put(broken, msgpack.packb(rogue.header(camera_jpeg(camera), seq=camera.seq)))
        camera.send()

    async def test() -> None:
        async with viewer.page() as page:
            await page.ask("watch", key=IMAGE)
            for _ in range(20):
                head, _ = await page.picture()
                assert head["header"]["epoch"] == str(camera.epoch)

    with camera.at(30, send_both):
        run(test())


def camera_jpeg(camera: PlainCamera) -> bytes:
    return camera._pictures[0]


def test_a_bad_picture_reaches_no_page_and_is_counted(viewer: Viewer, client):
    camera = PlainCamera(client)

    def send_both() -> None:
        camera.put(b"no picture", msgpack.packb(camera.header()))
        camera.send()

    async def test() -> None:
        async with viewer.page() as page:
            await page.ask("watch", key=IMAGE, width=32, height=32)
            for _ in range(10):
                _, payload = await page.picture()
                assert payload.startswith(b"\xff\xd8")
            health = await page.text("health", node="viewer")
            while not health["diagnostics"]["counters"].get("dropped.not_an_image"):
                health = await page.text("health", node="viewer")
            found = health["diagnostics"]["counters"]
            dropped = sum(count for name, count in found.items() if name.startswith("dropped."))
            assert found["received"] == found["processed"] + dropped + found["pending"]
            assert health["diagnostics"]["level"] == 1

    with camera.at(15, send_both):
        run(test())
    wait_until(lambda: viewer.get("/healthz").status == 200)


def test_a_message_that_is_none_of_its_class_reaches_no_page_and_is_counted(
    viewer: Viewer, client: zenoh.Session
):
    camera = PlainCamera(client)
    good = msgpack.packb({"header": camera.header(), "tracks": []})
    bad = msgpack.packb({"header": camera.header(), "tracks": [None]})

    def send_both() -> None:
        for payload in (bad, b"no msgpack", good):
            client.put(
                TRUTH,
                payload,
                encoding="application/msgpack;vision.Tracks.v1",
                congestion_control=KEPT,
            )

    async def test() -> None:
        async with viewer.page() as page:
            await page.ask("watch", key=TRUTH)
            for _ in range(10):
                assert (await page.text("message"))["body"] == {"tracks": []}
            health = await page.text("health", node="viewer")
            while not health["diagnostics"]["counters"].get("processed"):
                health = await page.text("health", node="viewer")
            found = health["diagnostics"]["counters"]
            assert found["dropped.bad_message"] >= 2 * found["processed"] - 2
            dropped = sum(count for name, count in found.items() if name.startswith("dropped."))
            assert found["received"] == found["processed"] + dropped + found["pending"]

    with camera.at(15, send_both):
        run(test())


def test_a_key_without_frames_is_silent_for_as_long_as_it_is_watched(viewer: Viewer):
    async def test() -> None:
        async with viewer.page() as page:
            while (await page.text("health", node="viewer"))["diagnostics"]["uptime_s"] < 4:
                pass
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
            assert silent_s < up_s - 3

    run(test())


def test_a_page_that_reads_nothing_costs_the_others_nothing_and_is_left(viewer: Viewer, client):
    noise = np.random.default_rng(1).integers(0, 255, (480, 640, 3), np.uint8)
    camera = PlainCamera(client, pictures=(jpeg(noise),))  # 300 kB: buffers fill soon

    async def test() -> None:
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

    run(test())


def test_a_slow_link_carries_the_newest_pictures_in_parts_and_is_not_given_up(
    viewer: Viewer, client
):
    camera = PlainCamera(client, pictures=(full_hd_jpeg(),))
    size = len(camera_jpeg(camera))
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
