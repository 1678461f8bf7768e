"""The page shows what is there, moving, and nothing that is gone as if it were there."""

from __future__ import annotations

import os
import signal

from tests.support.processes import WIDTH
from tests.support.routing import free_port
from tests.support.viewer.browser import CAMERA, EDGES, MASK, Open, Running, Tab
from tests.support.waiting import wait_until

PHONE = {
    "viewport": {"width": 390, "height": 844},
    "has_touch": True,
    "is_mobile": True,
    "device_scale_factor": 3,
}
PANELS = ("parameters", "plots", "graph", "events", "health", "log")


def test_every_stream_has_a_tile_that_moves_and_the_page_asks_no_other_host(
    open_tab: Open, system: Running
) -> None:
    tab = open_tab()
    for key in (CAMERA, MASK, EDGES):
        tab.wait_until_live(key)
    before = tab.pixels(CAMERA)

    def moved() -> bool:
        return max(abs(a - b) for a, b in zip(before, tab.pixels(CAMERA), strict=True)) > 20

    wait_until(moved)
    for panel in PANELS:
        tab.page.click(f"#panels [data-panel={panel}]")
        assert tab.page.is_visible(f"#panel-{panel}")
    tab.page.click(f".tile[data-key='{CAMERA}'] a")
    tab.wait_until_live(CAMERA)
    tab.wait("document.querySelector('#large-state').textContent === 'live'")
    assert tab.page.inner_text("#figure-size").startswith(f"{WIDTH}")
    assert tab.complaints == []
    assert tab.hosts == {system.address.split("/")[2]}


def test_on_a_phone_nothing_is_wider_than_the_screen(open_tab: Open) -> None:
    tab = open_tab(**PHONE)
    for place, menus in (("", ["layout"]), (CAMERA, ["adjust", "transfer"])):
        tab.open(place).wait_until_live(CAMERA)
        _check_fits(tab)
        for menu in menus:
            tab.page.tap(f"[popovertarget={menu}-menu] >> visible=true")
            assert tab.page.is_visible(f"#{menu}-menu")
            _check_fits(tab)
            tab.page.keyboard.press("Escape")
            assert tab.page.is_hidden(f"#{menu}-menu")
    for panel in PANELS:
        tab.page.tap(f"#panels [data-panel={panel}]")
        assert tab.page.is_visible(f"#panel-{panel}")
        _check_fits(tab)


def _check_fits(tab: Tab) -> None:
    """Check that the page is no wider than a phone, and that a finger meets its controls."""
    assert tab.page.evaluate("document.documentElement.scrollWidth") <= 390
    small = tab.page.evaluate(
        """[...document.querySelectorAll("button, summary, select, input, .back")]
            .filter((one) => one.checkVisibility() && one.type !== "checkbox"
                && !one.closest("#top, #dock-close"))
            .map((one) => [one.outerHTML.slice(0, 80), one.getBoundingClientRect().height])
            .filter(([, height]) => height < 34)"""
    )
    assert small == []


def test_a_viewer_that_freezes_or_is_gone_is_given_up_and_found_again(
    open_tab: Open, system: Running
) -> None:
    port = free_port()
    viewer = system.service("view", "--port", port)
    tab = open_tab()
    tab.address = viewer.lines(r"http://\S+")[0][0]
    tab.open(CAMERA).wait_until_live(CAMERA)
    os.kill(viewer.process.pid, signal.SIGSTOP)
    _wait_until_given_up(tab)
    os.kill(viewer.process.pid, signal.SIGCONT)
    # The viewer has to find its router again, and Chromium delays attempts after failed ones.
    tab.wait_until_live(CAMERA)
    viewer.process.kill()
    _wait_until_given_up(tab)
    tab.wait("document.querySelector('.pane-state').textContent.includes('not connected')")
    system.service("view", "--port", port)
    tab.wait_until_live(CAMERA)
    tab.wait("!document.querySelector('#banner').checkVisibility()")


def _wait_until_given_up(tab: Tab) -> None:
    tab.wait("document.querySelector('canvas.picture').dataset.live === 'false'")
    tab.wait("document.querySelector('#link').dataset.state === 'down'")
