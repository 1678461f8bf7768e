"""Who cannot see the page, or has no JavaScript, gets what others get: the rules of axe, a list."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.viewer.browser import CAMERA, Running, tab

RATE_HZ = 2
GRAVE = ("serious", "critical")
PANELS = ("parameters", "plots", "graph", "message", "events", "health", "log")
COLOURS = {"runOnly": {"type": "rule", "values": ["color-contrast", "link-in-text-block"]}}
THEMES: dict[str, dict[str, Any]] = {"light": COLOURS, "dark": {}}
"""The rules that are tried in each: what is not a colour is the same in both."""

VIOLATIONS = """async ([part, rules]) => {
    const { violations } = await axe.run(part, { resultTypes: ["violations"], ...rules });
    return violations.map(({ id, impact, nodes: [{ html }] }) => ({ id, impact, part, html }));
}"""


def test_axe_finds_nothing_serious_on_the_wall_in_the_large_view_and_on_any_panel(
    browser: Any, system: Running
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    found = []
    # Its script is not one of the page, whose policy forbids others.
    with tab(browser, system.address, color_scheme="dark", bypass_csp=True) as opened:

        def check(part: str) -> None:
            for theme, rules in THEMES.items():
                opened.page.emulate_media(color_scheme=theme)
                opened.wait(f"document.documentElement.dataset.theme === '{theme}'")
                found.extend(opened.page.evaluate(VIOLATIONS, [part, rules]))

        opened.open("?panel=none").wait("document.querySelectorAll('.tile').length >= 3")
        opened.page.evaluate(axe.axe_script)
        check("body")
        for panel in PANELS:
            opened.page.click(f"#panels [data-panel={panel}]")
            if panel == "graph":
                opened.wait("document.querySelector('#graph a')")
            check("#dock")
        opened.page.click("#dock-close")
        opened.open(CAMERA).wait_until_live(CAMERA)
        check("#large")
    assert [each for each in found if each["impact"] in GRAVE] == []


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
