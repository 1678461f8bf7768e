"""``/stream`` in an ``<img>``: each picture is shown when it comes, the last one too."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from tests.support.listening import open_client
from tests.support.publishing import PlainCamera
from tests.support.viewer.browser import Running, Tab, tab
from tests.support.waiting import wait_until

SERVICES = ()
STREAM = "stream_viewer?topic=/side/image/compressed&type=ros_compressed"
MIDDLE = """() => {
    const shown = document.querySelector("img");
    if (!shown?.naturalWidth) return null;
    const pixel = new OffscreenCanvas(1, 1).getContext("2d");
    pixel.drawImage(shown, 0, 0, 1, 1);
    return pixel.getImageData(0, 0, 1, 1).data[0];
}"""
"""The red of what the ``<img>`` shows, 0 to 255; null while it shows nothing."""


def of_one_grey(level: int) -> bytes:
    pixels = np.full((48, 64, 3), level, np.uint8)
    return bytes(cv2.imencode(".jpg", pixels)[1])


def test_an_img_shows_the_last_picture_though_no_other_follows(
    browser: Any, system: Running
) -> None:
    with (
        open_client(system.router.endpoint) as session,
        tab(browser, system.address + STREAM) as opened,
    ):
        camera = PlainCamera(session, camera="side", pictures=(of_one_grey(180),))
        with camera.at(10):
            opened.page.goto(opened.address, wait_until="commit")
            wait_until(lambda: level(opened) is not None)
        camera.send(of_one_grey(255))
        wait_until(lambda: (level(opened) or 0) > 245, explain=lambda: f"it shows {level(opened)}")


def level(opened: Tab) -> int | None:
    found: int | None = opened.page.evaluate(MIDDLE)
    return found
