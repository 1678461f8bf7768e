"""The page in Firefox: pictures with their boxes, every panel, and a zone that is drawn."""

from __future__ import annotations

import asyncio
import json
import time
from pathlib import Path

import pytest

from tests.integration.conftest import Service
from tests.support.routing import Router
from tests.support.typist import zv
from tests.support.viewer.client import Viewer
from tests.support.viewer.firefox import PATIENCE_S, firefox_page

CAMERA = "vision/front/image/compressed"
PANELS = {
    "e": "parameters", "p": "plots", "g": "graph", "j": "message", "v": "events", "h": "health",
    "l": "log",
}  # fmt: skip
PICTURE = "document.querySelector('canvas.picture')"
MIDDLE = f"""(() => {{
    const {{ left, top, width, height }} = {PICTURE}.getBoundingClientRect();
    return [left + width / 2, top + height / 2].map(Math.round);
}})()"""


@pytest.fixture
def running(viewer: Viewer, service: Service) -> Viewer:
    service("camera", "--rate", 10)
    service("tracker")
    return viewer


async def until_zones(router: Router, wanted: bool) -> None:
    """Wait until the tracker has zones, or none."""
    until_s = time.monotonic() + PATIENCE_S
    words = ("param", "get", "tracker_front", "zones", "--json")
    while True:
        done = await asyncio.to_thread(zv, router.endpoint, *words)
        if bool(json.loads(done.stdout)["value"]) == wanted:
            return
        assert time.monotonic() < until_s, done.stdout


async def test_the_page_works_in_firefox(running: Viewer, router: Router, tmp_path: Path):
    profile = tmp_path / "profile"
    profile.mkdir()
    async with firefox_page(profile) as page:
        await page.open(running.url)
        tile = f"document.querySelector('.tile canvas[data-key=\"{CAMERA}\"]')"
        await page.wait(f"{tile}?.dataset.live === 'true'")
        await page.open(f"{running.url}#{CAMERA}")
        await page.wait(f"{PICTURE}?.dataset.live === 'true'")
        await page.wait(f"{PICTURE}.dataset.overlay === 'joined'")
        first = await page.evaluate(f"{PICTURE}.dataset.seq")
        await page.wait(f"{PICTURE}.dataset.seq !== '{first}'")
        for key, panel in PANELS.items():
            await page.press(key)
            await page.wait(f"document.body.dataset.panel === '{panel}'")
            if panel == "plots":
                await page.wait("document.querySelector('.plot .legend').textContent.length > 1")
                assert await page.evaluate("document.querySelectorAll('.plot canvas').length") == 5
        await page.press(key)
        await page.wait("document.body.dataset.panel === ''")
        await page.press("z")
        await page.wait("!document.querySelector('#shapes-bar').hidden")
        await page.evaluate("document.querySelector('#add-zones').click()")
        await page.wait("document.querySelector('#shape-words').textContent.includes('corners')")
        x, y = await page.evaluate(MIDDLE)
        for corner in ((x, y), (x + 60, y), (x + 60, y + 40), (x, y)):
            await page.click(*corner)
        await until_zones(router, wanted=True)
        await page.evaluate("document.querySelector('#shape-undo').click()")
        await until_zones(router, wanted=False)
    assert page.complaints == []
