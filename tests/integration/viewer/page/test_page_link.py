"""What the page says of a link that is slow, and of one that it may not use any more."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from tests.support.viewer.browser import CAMERA, Running
from tests.support.viewer.page_server import header, png, served_page, stream
from tests.support.waiting import wait_until

SERVICES = ()
"""A viewer alone: of it the pages come, and from the test what they are told."""

SLOW = r"The link carries 1\.0 Mbit/s: [\d.]+ of \d+ pictures a second fit\."
PICTURE = png(np.full((48, 64), 50, np.uint8))
BANNER = "document.querySelector('#banner').textContent"


def test_on_a_slow_link_it_is_said_how_many_pictures_fit_and_they_stay_live(
    browser: Any, system: Running
) -> None:
    live = "document.querySelector('canvas.picture').dataset.live"
    with served_page(browser, system.address, stream(CAMERA)) as (tab, server):
        tab.open(CAMERA)
        server.wait_for(CAMERA)
        numbers = iter(range(0, 10_000, 30))

        def is_said() -> bool:
            server.show(CAMERA, PICTURE, header(next(numbers), CAMERA), skipped=29)
            server.tell("link", bits_per_s=1_000_000)
            return bool(re.fullmatch(SLOW, tab.page.evaluate(BANNER)))

        wait_until(is_said, poll_s=1.2)  # longer than the silence after which others are not live
        assert tab.page.is_visible("#banner")
        tab.page.evaluate("new Promise((done) => setTimeout(done, 1300))")
        assert tab.page.evaluate(live) == "true"


def test_a_page_whose_session_has_ended_says_so_at_each_attempt(
    browser: Any, system: Running
) -> None:
    attempts: list[Any] = []

    def refuse(socket: Any) -> None:
        attempts.append(socket)
        socket.close()

    with served_page(browser, system.address) as (page, server):
        page.open()
        page.wait("document.querySelector('#link').dataset.state === 'up'")
        page.page.route("**/page/icon.svg", lambda route: route.fulfill(status=401))
        page.page.route_web_socket(re.compile("/live"), refuse)
        server.end()
        page.wait(f"{BANNER}.startsWith('The session has ended.')")
        page.page.evaluate(
            f"""() => {{
                window.seen = new Set();
                new MutationObserver(() => seen.add({BANNER})).observe(
                    document.querySelector('#banner'), {{childList: true, characterData: true}});
            }}"""
        )
        count = len(attempts)
        wait_until(lambda: server.hear() and len(attempts) >= count + 2)
        said = "The session has ended. Open the address that the viewer printed."
        assert page.page.evaluate(f"[{BANNER}, ...seen].filter((text) => text !== '{said}')") == []
        page.complaints.clear()  # of the console about the status
