"""Who cannot see the page or use a mouse can do what others can: the rules of axe, and keys."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.viewer.browser import CAMERA, Open, Running, Tab, tab

GRAVE = ("serious", "critical")
PANELS = ("none", "parameters", "plots", "graph", "message", "events", "health", "log")
PLACES = (*(f"?panel={name}" for name in PANELS), f"{CAMERA}?panel=none")
COLOURS = {"runOnly": {"type": "rule", "values": ["color-contrast", "link-in-text-block"]}}
THEMES: dict[str, dict[str, Any]] = {"light": COLOURS, "dark": {}}
"""The rules that are tried in each: what is not a colour is the same in both."""

FOCUSED = "document.activeElement.textContent || document.activeElement.ariaLabel"


def test_axe_finds_nothing_serious_on_the_wall_in_the_large_view_and_on_any_panel(
    browser: Any, system: Running
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    found = []
    # Its script is not one of the page, whose policy forbids others.
    with tab(browser, system.address, color_scheme="dark", bypass_csp=True) as opened:
        for place in PLACES:
            opened.page.goto("about:blank")
            opened.open(place)
            if CAMERA in place:
                opened.wait_until_live(CAMERA)
            else:
                opened.wait("document.querySelectorAll('.tile').length >= 3")
            if "graph" in place:
                opened.wait("document.querySelector('#graph a')")
            for theme, rules in THEMES.items():
                opened.page.emulate_media(color_scheme=theme)
                opened.wait(f"document.documentElement.dataset.theme === '{theme}'")
                violations = axe.run(opened.page, options=rules).response["violations"]
                found += [
                    (place, theme, each["id"], each["nodes"][0]["html"][:120])
                    for each in violations
                    if each["impact"] in GRAVE
                ]
    assert found == []


def focused(opened: Tab) -> str:
    text: str = opened.page.evaluate(FOCUSED)
    return text


def test_arrow_keys_move_along_a_toolbar_and_not_the_picture(open_tab: Open) -> None:
    opened = open_tab(CAMERA)
    opened.wait_until_live(CAMERA)
    opened.page.focus("#pause")
    for key, name in (("ArrowRight", "◂"), ("ArrowRight", "▸"), ("ArrowLeft", "◂")):
        opened.page.keyboard.press(key)
        assert focused(opened) == name
    opened.page.focus("#pause")
    opened.page.keyboard.press("ArrowLeft")
    assert opened.page.evaluate("Boolean(document.activeElement.closest('[role=toolbar]'))")
    assert focused(opened) != "Pause"


def test_single_keys_can_be_switched_off_and_stay_off(open_tab: Open) -> None:
    opened = open_tab()
    opened.page.keyboard.press("h")
    opened.page.wait_for_selector("#panel-health:visible")
    opened.page.click("#help-button")
    opened.page.uncheck("#shortcuts")
    opened.page.click("#help button")
    opened.page.keyboard.press("p")
    opened.page.reload()
    opened.wait("document.querySelectorAll('.tile').length >= 3")
    opened.page.keyboard.press("p")
    opened.page.keyboard.press("?")
    assert not opened.page.is_visible("#panel-plots")
    assert not opened.page.is_visible("#help")


def test_a_tile_says_whether_its_stream_is_live(open_tab: Open) -> None:
    opened = open_tab()
    label = f"document.querySelector('.tile[data-key=\"{CAMERA}\"] a')?.ariaLabel"
    opened.wait(f"{label} === 'Show front / image large, live'")


def test_the_values_of_a_node_are_read_with_their_names(open_tab: Open) -> None:
    opened = open_tab("?panel=health")
    row = "#health details[data-node=camera_front] summary"
    opened.wait(
        f"/level (OK|WARN).*rate .*p50 .*p99 .*lost/s.test("
        f"document.querySelector('{row}')?.textContent)"
    )


def test_without_javascript_the_page_is_the_list_of_streams_with_links_and_pictures(
    browser: Any, system: Running
) -> None:
    with tab(browser, system.address, java_script_enabled=False) as opened:
        opened.open()
        link = opened.page.locator("a", has=opened.page.locator("img")).first
        link.wait_for()
        assert opened.page.url == f"{system.address}streams"
        opened.page.locator(f"img[src*='{CAMERA}']").wait_for()
        link.click()
        opened.page.wait_for_url("**/stream_viewer?topic=/vision/front/**")
        opened.page.locator("img").wait_for()
