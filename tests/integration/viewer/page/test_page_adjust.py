"""How one picture is shown: turned, stretched, coloured, smaller, and with its true values."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.viewer.browser import CAMERA, Running, Tab
from tests.support.viewer.page_server import PageServer, header, png, served_page, stream
from tests.support.waiting import wait_until

SERVICES = ()
"""A viewer alone: of it the pages come, and from the test what they are told."""


WIDTH, HEIGHT = 64, 48
DEPTH = "vision/front/depth/compressed"


@pytest.fixture
def opened(browser: Any, system: Running) -> Iterator[tuple[Tab, PageServer]]:
    streams = stream(CAMERA), stream(DEPTH)
    with served_page(browser, system.address, *streams) as (found, server):
        yield found, server


def test_a_picture_is_turned_and_stretched_and_keeps_its_coordinates_and_values(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    _open(tab, server, CAMERA)
    assert server.watches(CAMERA) == [{"values": True}]
    grey = np.full((HEIGHT, WIDTH), 50, np.uint8)
    grey[:, WIDTH // 2 :] = 100  # left and right half
    server.show(CAMERA, png(grey), header(7, CAMERA))
    tab.wait_for_red(CAMERA, 10, 24, 50)
    tab.wait_for_red(CAMERA, 54, 24, 100)
    tab.page.keyboard.press("r")  # a quarter clockwise: left is above
    tab.wait_for_red(CAMERA, 24, 10, 50)
    tab.wait_for_red(CAMERA, 24, 54, 100)
    tab.page.keyboard.press("c")
    tab.wait_for_red(CAMERA, 24, 10, 0)
    tab.wait_for_red(CAMERA, 24, 54, 255)
    assert tab.page.inner_text(".pane-scale").split() == ["50", "100"]
    tab.page.mouse.move(*tab.place(CAMERA, 24, 10))
    # The point (24, 10) of what is shown is (10, 48 - 24) of the frame, give or take the pixel.
    tab.wait("/^(9|10), (23|24) = 50$/.test(document.querySelector('#pixel').textContent)")
    tab.page.keyboard.press("c")
    tab.wait_for_red(CAMERA, 24, 54, 100)
    assert tab.page.is_hidden(".pane-scale")

    tab.page.click("#adjust-button")
    tab.wait("document.querySelector('#histogram-text').textContent.startsWith('0 to 255')")
    tab.page.select_option("#range", "fixed")
    tab.page.fill("#range-low", "90")
    tab.page.fill("#range-high", "80")
    tab.page.keyboard.press("Tab")
    assert tab.page.get_attribute("#range-high", "aria-invalid") == "true"
    tab.page.fill("#range-high", "110")
    streams = [stream(CAMERA), stream(DEPTH), stream("vision/front/mask/compressed")]
    server.tell("streams", streams=streams)
    tab.wait("document.querySelectorAll('#beside-own label').length === 3")
    assert tab.page.input_value("#range-high") == "110"  # what is typed stays
    tab.page.keyboard.press("Tab")
    tab.wait_for_red(CAMERA, 24, 54, 128)  # 10 of 20
    assert tab.page.is_enabled("#colour-map")
    server.show(CAMERA, png(np.dstack([grey, grey, 0 * grey])), header(8, CAMERA, encoding="bgr8"))
    tab.wait("document.querySelector('#colour-map').disabled")  # of a picture in colours
    tab.page.click("#adjust-menu [data-by=flipped]")
    before = len(server.watches(CAMERA))
    tab.page.reload()
    wait_until(lambda: server.hear() and len(server.watches(CAMERA)) > before)
    kept = json.loads(tab.page.evaluate("localStorage.getItem('zv.orientations')"))
    assert kept == {"front": "270m"}
    server.show(CAMERA, png(grey), header(9, CAMERA))
    tab.wait_for_red(CAMERA, 24, 54, 128)


def test_a_smaller_size_is_asked_for_and_in_the_address_which_has_no_token(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    _open(tab, server, CAMERA)
    server.show(
        CAMERA, png(np.zeros((HEIGHT, WIDTH), np.uint8)), header(7, CAMERA, width=640, height=480)
    )
    tab.wait_until_live(CAMERA)
    tab.page.evaluate("document.cookie = 'zv_token_0=a-secret'")
    tab.page.click("#transfer-button")
    tab.page.select_option("#transfer-width", "320")
    tab.page.select_option("#transfer-quality", "40")
    wanted = {"width": 320, "quality": 40}
    wait_until(lambda: server.hear() and server.watches(CAMERA)[-1] == wanted | {"values": True})
    origin = tab.address.rstrip("/")
    topic = f"topic=/{CAMERA}&width=320&quality=40"
    assert tab.page.input_value("#address-stream") == f"{origin}/stream?{topic}"
    assert tab.page.input_value("#address-snapshot") == f"{origin}/snapshot?{topic}"
    tab.page.check("#transfer-own")
    tab.page.keyboard.press("Escape")
    tab.page.click("a.back")
    wait_until(lambda: server.hear() and server.watches(CAMERA)[-1] == wanted)  # its tile
    tile = wait_until(lambda: server.hear() and server.watches(DEPTH))[-1]
    assert tile["width"] == 320  # of the choice for all streams, since the tile is wider
    assert tile["quality"] == 40


def test_depth_shows_true_values_with_its_scale_and_is_saved_with_16_bits(
    opened: tuple[Tab, PageServer], tmp_path: Path
) -> None:
    tab, server = opened
    _open(tab, server, DEPTH)
    depth = np.full((HEIGHT, WIDTH), 2000, np.uint16)
    depth[:, 32:] = 2345
    depth[:, :4] = 0  # no reading
    # As the server sends 16 bits: the high byte red, the low byte green, its own grey blue.
    grey = np.where(depth > 0, 1 + (depth - 2000.0) * 254 / 1000, 0)
    rgb = np.dstack([depth >> 8, depth & 255, grey]).astype(np.uint8)
    sent = {"depth": {"min": 2000, "max": 3000, "values": True}}
    head = header(7, DEPTH, encoding="16UC1")
    server.show(DEPTH, png(rgb[:, :, ::-1]), head, **sent)
    tab.wait_for_red(DEPTH, 20, 24, 0)
    tab.wait_for_red(DEPTH, 50, 24, 88)  # 345 of 1000 of 255
    assert tab.page.inner_text(".pane-scale").split() == ["2.000", "m", "3.000", "m"]
    for place, text in (((50, 24), "2.345 m"), ((20, 24), "2.000 m"), ((2, 24), "no reading")):
        tab.page.mouse.move(*tab.place(DEPTH, *place))
        tab.wait(f"document.querySelector('#pixel').textContent.endsWith('= {text}')")
    tab.page.click("#adjust-button")
    tab.page.select_option("#colour-map", "viridis")
    tab.wait_for_red(DEPTH, 20, 24, 0x44)
    tab.page.keyboard.press("Escape")
    with tab.page.expect_download() as download:
        tab.page.keyboard.press("s")
    download.value.save_as(tmp_path / "depth.png")
    saved = cv2.imread(str(tmp_path / "depth.png"), cv2.IMREAD_UNCHANGED)
    assert saved.dtype == np.uint16
    assert np.array_equal(saved, depth)
    assert b"tEXtvision.Header\0" in (tmp_path / "depth.png").read_bytes()


def test_keys_change_nothing_while_the_stream_is_not_there(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    _open(tab, server, CAMERA)
    tab.page.evaluate("location.hash = 'vision/side/image/compressed'")
    tab.wait("document.querySelector('#unknown').checkVisibility()")
    for key in ("r", "m", "c", "u", "s"):
        tab.page.keyboard.press(key)
    assert tab.page.evaluate("Object.keys(localStorage).join()") in ("", "zv.panel")
    assert tab.page.is_hidden("#transfer-menu")
    assert tab.page.is_disabled("#adjust-button")
    tab.page.evaluate(f"location.hash = '{CAMERA}'")
    tab.wait("!document.querySelector('#adjust-button').disabled")


def test_a_layout_in_the_address_says_which_streams_in_which_order_and_what_is_hidden(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    absent = "vision/side/image/compressed"
    place = f"?only={DEPTH}+{absent}+{CAMERA}&columns=2&hide=top+bars&panel=log&columns=99"
    _open(tab, server, place)
    tiles = "[...document.querySelectorAll('.tile')].map((one) => one.dataset.key).join()"
    tab.wait(f"{tiles} === '{DEPTH},{absent},{CAMERA}'")
    assert tab.page.inner_text("#banner") == (
        "In the address, columns = 99 is not allowed; allowed: 1 to 8"
    )
    assert tab.page.is_hidden("#top")
    assert tab.page.is_hidden("#filter")
    assert tab.page.is_visible("#panel-log")
    columns = "getComputedStyle(document.querySelector('#tiles')).gridTemplateColumns.split(' ')"
    assert tab.page.evaluate(f"{columns}.length") == 2
    assert tab.page.evaluate("localStorage.getItem('zv.panel')") != '"log"'
    tab.page.keyboard.press("Escape")
    tab.wait(f"location.hash === '#?only={DEPTH}+{absent}+{CAMERA}&columns=2&panel=log'")
    assert tab.page.is_visible("#top")

    tab.page.click("#wall [popovertarget=layout-menu]")
    tab.page.click(f"[aria-label='{CAMERA} earlier']")
    tab.wait(f"{tiles} === '{DEPTH},{CAMERA},{absent}'")
    assert tab.page.evaluate("document.activeElement.ariaLabel") == f"{CAMERA} earlier"
    tab.page.click(f"#layout-streams [data-key='{absent}'] label")
    tab.page.select_option("#layout-columns", "")
    tab.wait(f"{tiles} === '{DEPTH},{CAMERA}'")
    address = tab.page.input_value("#layout-address")
    assert address == f"{tab.address.rstrip('/')}/#?only={DEPTH}+{CAMERA}&panel=log"
    tab.page.keyboard.press("Escape")
    tab.page.click(f".tile[data-key='{CAMERA}'] a")
    tab.wait(f"location.hash.startsWith('#{CAMERA}?only=')")
    tab.page.click("a.back")
    tab.wait(f"{tiles} === '{DEPTH},{CAMERA}' && document.body.dataset.view === 'wall'")


def test_a_picture_stays_in_its_place_while_its_figures_and_its_state_change(
    opened: tuple[Tab, PageServer],
) -> None:
    """A corner that is clicked meanwhile would be drawn elsewhere."""
    tab, server = opened
    _open(tab, server, CAMERA)
    server.show_grey(CAMERA, 1, 50)
    tab.wait_for_red(CAMERA, 10, 24, 50)
    before = tab.place(CAMERA, 10, 24)
    figures = "document.querySelectorAll('#figures dd')"
    tab.page.evaluate(f"for (const one of {figures}) one.textContent = '9'.repeat(40)")
    assert tab.place(CAMERA, 10, 24) == before
    tab.wait("document.querySelector('#large-state').textContent === 'not live'")
    assert tab.place(CAMERA, 10, 24) == before


def test_menus_are_below_their_buttons_in_browsers_without_css_anchors(
    browser: Any, system: Running
) -> None:
    streams = stream(CAMERA), stream(DEPTH)
    with served_page(browser, system.address, *streams, bypass_csp=True) as (tab, server):
        _open(tab, server, CAMERA)
        style = "[popover] { position-area: none !important; position-anchor: none !important }"
        tab.page.add_style_tag(content=style)
        for menu in ("overlay", "transfer"):  # the first and the last
            button = tab.page.locator(f"[popovertarget={menu}-menu] >> visible=true")
            button.click()
            wait_until_below(tab.page.locator(f"#{menu}-menu"), button)
            moved = tab.page.add_style_tag(content="body { padding-top: 40px }")
            wait_until_below(tab.page.locator(f"#{menu}-menu"), button)
            moved.evaluate("style => style.remove()")
            tab.page.keyboard.press("Escape")


def wait_until_below(menu: Any, button: Any) -> None:
    """Wait until a menu is right below its button, and whole: it is placed once it is open."""

    def is_below() -> bool:
        box, at = menu.bounding_box(), button.bounding_box()
        middle, right = at["x"] + at["width"] / 2, box["x"] + box["width"]
        distance = box["y"] - at["y"] - at["height"]
        return bool(0 <= distance < 8 and 0 <= box["x"] <= middle < right <= 1280)

    wait_until(is_below, explain=lambda: f"{menu.bounding_box()}, {button.bounding_box()}")


def _open(tab: Tab, server: PageServer, place: str) -> None:
    tab.open(place)
    tab.wait("document.querySelector('#link').dataset.state === 'up'")
    wait_until(lambda: server.hear() and any(one["op"] == "watch" for one in server.asked))
