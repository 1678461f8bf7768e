"""The wall shows all streams, says which are live, and names those that it cannot show."""

from __future__ import annotations

from typing import Any

from tests.support.viewer.browser import CAMERA, Running
from tests.support.viewer.page_server import NOW_NS, served_page, stream
from tests.support.waiting import wait_until

SERVICES = ()
"""A viewer alone: of it the pages come, and from the test what they are told."""

RAW = "vision/r1/image"


def test_a_camera_that_sends_only_raw_pixels_has_a_tile_also_at_an_address_that_is_no_text(
    browser: Any, system: Running
) -> None:
    with served_page(browser, system.address, stream(CAMERA), stream(RAW)) as (tab, server):
        tab.open("%")
        server.wait_for(RAW)
        server.show_grey(RAW, 1, 50)
        tab.wait_until_live(RAW)
        assert tab.page.is_visible("#wall")


def test_a_camera_whose_name_is_none_is_named_with_the_rule(browser: Any, system: Running) -> None:
    with served_page(browser, system.address, stream(CAMERA)) as (tab, server):
        tab.open()
        server.wait_for(CAMERA)
        assert not tab.page.is_visible("#wall-misnamed")
        server.tell("misnamed", cameras=["Front", "cam-1"])
        tab.page.wait_for_selector("#wall-misnamed:visible")
        words = tab.page.inner_text("#wall-misnamed")
        assert words.startswith("Not shown: Front, cam-1. ")
        assert "only letters a-z, digits and _" in words
        server.tell("misnamed", cameras=[])
        tab.page.wait_for_selector("#wall-misnamed", state="hidden")


def test_the_filter_finds_a_stream_whether_its_letters_or_those_of_the_filter_are_capitals(
    browser: Any, system: Running
) -> None:
    others = "vision/front/Depth/compressed"  # as another program may name its topic
    with served_page(browser, system.address, stream(CAMERA), stream(others)) as (tab, server):
        tab.open()
        server.wait_for(others)
        for words in ("depth", "Depth", "DEPTH front"):
            tab.page.fill("#filter", words)
            tab.wait("document.querySelectorAll('.tile').length === 1")
            assert tab.page.get_attribute(".tile", "data-key") == others
            tab.page.fill("#filter", "")
            tab.wait("document.querySelectorAll('.tile').length === 2")


def test_twelve_cameras_are_all_live_at_once_and_one_that_ends_is_not_whatever_others_do(
    browser: Any, system: Running
) -> None:
    keys = [f"vision/bay_{number:02d}/image/compressed" for number in range(1, 13)]
    tile = f".tile[data-key='{keys[0]}']"
    label = f'document.querySelector("{tile} a").ariaLabel'
    state = f'document.querySelector("{tile} .tile-state").textContent'
    large = {"viewport": {"width": 1920, "height": 1080}}
    with served_page(browser, system.address, *map(stream, keys), **large) as (tab, server):
        tab.open()
        for key in keys:
            server.wait_for(key)
        numbers = iter(range(1000))

        def all_are_live() -> bool:
            seq = next(numbers)
            for key in keys:
                server.show_grey(key, seq, 50)
            count = "document.querySelectorAll('.tile[data-state=live]').length"
            return bool(tab.page.evaluate(f"{count} === 12"))

        wait_until(all_are_live, poll_s=0.2)
        assert tab.page.evaluate(label) == "Show bay_01 / image large, live"
        server.tell("ended", key=keys[0], since_ns=str(NOW_NS))
        tab.wait(f"{state}.startsWith('no picture since')")
        assert tab.page.get_attribute(tile, "data-state") == "stopped"
        assert tab.page.get_attribute(f"{tile} canvas", "data-live") == "false"
        server.tell("streams", streams=[stream(key) for key in (*keys, CAMERA)])
        tab.wait(f"document.querySelector('.tile[data-key=\"{CAMERA}\"]')")
        assert tab.page.evaluate(state).startswith("no picture since")

        def is_live_again() -> bool:
            # While the tiles move, the page may for a moment not watch the stream.
            server.show_grey(keys[0], next(numbers), 50)
            return bool(tab.page.evaluate(f"{state} === ''"))

        wait_until(is_live_again, poll_s=0.1)
