"""``/live``, as the page uses it: nodes, their health and parameters."""

from __future__ import annotations

import tomllib

from tests.support.routing import Router
from tests.support.viewer.client import IMAGE, Viewer

EDGES = "vision/front/edges/compressed"


async def test_a_page_hears_a_tick_also_while_there_is_no_router(viewer: Viewer, router: Router):
    router.kill()
    async with viewer.page() as page:
        await page.text("router", connected=False)
        ticks = [await page.text("tick") for _ in range(2)]
        apart_s = (int(ticks[1]["now_ns"]) - int(ticks[0]["now_ns"])) / 1e9
        assert 1 < apart_s < 6  # when the page gives up


async def test_a_parameter_is_set_for_all_pages_and_a_refusal_says_why(viewer: Viewer, service):
    service("camera", "--rate", 15)
    service("edge")
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


async def test_nodes_that_go_are_told_as_gone_and_forgotten_subscriptions_end(
    viewer: Viewer, service
):
    camera = service("camera", "--rate", 15)
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
        nodes = await page.until("nodes")
        while all(each["alive"] for each in nodes["nodes"]):
            nodes = await page.until("nodes")
        gone = next(each for each in nodes["nodes"] if not each["alive"])
        assert gone["node"] == "camera_front"
        assert gone["since_ns"].isdecimal()
