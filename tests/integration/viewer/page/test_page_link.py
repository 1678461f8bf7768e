"""What the page shows at the end of a slow link, and of one that it may not use any more."""

from __future__ import annotations

import itertools
import re
import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

from tests.support.pictures.encoded import full_hd_jpeg
from tests.support.publishing import Paced
from tests.support.viewer.browser import CAMERA, Running, tab
from tests.support.viewer.page_server import served_page
from tests.support.viewer.slow_link import ONE_MBIT, SlowLink
from zenoh_vision.image.frame import Frame
from zenoh_vision.messages import Header
from zenoh_vision.node.node import Node
from zenoh_vision.topics import COMPRESSED, RAW
from zenoh_vision.transport.connection import Connection

SERVICES = ()
"""A viewer alone: of it the pages come, and from the test what they are told."""


NOTE_WHEN_SHOWN = """() => {
    const picture = document.querySelector("canvas.picture");
    new MutationObserver(() => { window.shownAt = performance.now(); })
        .observe(picture, {attributeFilter: ["data-seq"]});
}"""
LIVE_BETWEEN_PICTURES = (
    "document.querySelector('canvas.picture').dataset.live === 'true'"
    " && performance.now() - shownAt > 1500"
)
"""Longer than the silence of 1 s after which a stream of a usual rate is not live."""


def test_on_a_slow_link_the_newest_pictures_are_shown_and_why_not_more(
    browser: Any, system: Running
) -> None:
    # The link carries a picture for longer than the page waits for a sign of life.
    picture = full_hd_jpeg(quality=87)
    assert len(picture) > 6 * ONE_MBIT
    port = urlsplit(system.address).port
    assert port is not None
    frames = _frames(picture)
    connection = Connection(connect=system.router.endpoint)
    with (
        Node("camera", camera="front", connection=connection, publishes=[COMPRESSED, RAW]) as node,
        Paced(30, lambda: node.publish_picture("image/compressed", next(frames))),
        SlowLink(port, ONE_MBIT) as link,
        tab(browser, f"http://127.0.0.1:{link.port}/") as page,
    ):
        page.open(CAMERA)
        seen = "document.querySelector('canvas.picture')?.dataset.seq"
        first = int(page.wait(seen))
        page.page.evaluate(NOTE_WHEN_SHOWN)
        second = int(page.wait(f"{seen} !== '{first}' && {seen}"))
        assert second > first + 1  # those between were skipped
        page.wait(
            r"/^The link carries [\d.]+ [Mk]bit\/s: [\d.]+ of \d+ pictures a second fit\.$/"
            ".test(document.querySelector('#banner').textContent)"
        )
        assert page.page.is_visible("#banner")
        page.wait(LIVE_BETWEEN_PICTURES)
        assert page.complaints == []
        assert sum(line.startswith("GET /live") for line in link.requests) == 1


def _frames(picture: bytes) -> Iterator[Frame]:
    """Yield the picture as frame after frame of a camera."""
    epoch = time.time_ns()
    for seq in itertools.count():
        header = Header(
            camera="front",
            epoch=epoch,
            seq=seq,
            stamp_ns=time.time_ns(),
            width=1920,
            height=1080,
            encoding="bgr8",
            node="camera_front",
        )
        yield Frame(header, picture)


def test_a_page_whose_session_has_ended_says_so_at_each_attempt(
    browser: Any, system: Running
) -> None:
    banner = "document.querySelector('#banner').textContent"
    with served_page(browser, system.address) as (page, server):
        page.open()
        page.wait("document.querySelector('#link').dataset.state === 'up'")
        page.page.route("**/page/icon.svg", lambda route: route.fulfill(status=401))
        page.page.route_web_socket(re.compile("/live"), lambda socket: socket.close())
        server.end()
        page.wait(f"{banner}.startsWith('The session has ended.')")
        seen = page.page.evaluate(  # while it tries to connect every 2 s
            f"""new Promise((done) => {{
                const seen = new Set();
                setInterval(() => seen.add({banner}), 50);
                setTimeout(() => done([...seen]), 5000);
            }})"""
        )
        assert seen == ["The session has ended. Open the address that the viewer printed."]
        page.complaints.clear()  # of the console about the status
