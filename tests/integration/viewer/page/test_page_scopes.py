"""The two addresses of a viewer with a token: the address bar, and who may set parameters."""

from __future__ import annotations

from typing import Any

from tests.support.viewer.browser import Running, tab

TOKEN = "a-token-for-this-test-1"
SERVICES = ("camera", "edge")
FLAGS = ("--token", TOKEN)

LOW = ".node-parameters[data-node=edge_front] .parameter[data-name=low] input[type=number]"
PANEL = '[data-panel="parameters"]'
DISABLED = f"document.querySelector('{LOW}')?.matches(':disabled')"


def test_the_address_bar_has_no_token_and_the_page_goes_on_after_a_reload(
    browser: Any, system: Running
) -> None:
    bare = system.address.partition("?")[0]
    with tab(browser, system.address) as shown:
        shown.page.goto("about:blank")
        place = "vision/front/image/compressed"
        shown.open(place).wait_until_live(place)
        assert shown.page.url == f"{bare}#{place}"
        assert shown.page.evaluate("history.length") == 2  # nothing with the token in between
        shown.page.reload()
        shown.wait_until_live(place)
        assert shown.complaints == []


def test_a_link_on_a_page_of_another_site_opens_it(browser: Any, system: Running) -> None:
    with tab(browser, system.address) as shown:
        shown.page.route(
            "http://wiki.test/", lambda route: route.fulfill(content_type="text/html", body=text)
        )
        for address in (system.address, system.address.partition("?")[0]):
            text = f'<a id="link" href="{address}">camera</a>'
            shown.page.goto("http://wiki.test/")
            shown.page.click("#link")
            shown.wait("document.querySelector('#link').dataset.state === 'up'")


def test_the_address_for_control_sets_parameters(browser: Any, system: Running) -> None:
    with tab(browser, system.address) as shown:
        shown.open().page.click(PANEL)
        shown.wait(f"{DISABLED} === false")
        assert not shown.page.is_visible("#view-only")
        shown.page.fill(LOW, "33")
        shown.page.keyboard.press("Enter")
        shown.wait(f"document.querySelector('{LOW}').closest('.parameter').dataset.value === '33'")


def test_the_address_for_viewing_shows_parameters_read_only_and_says_why(
    browser: Any, system: Running
) -> None:
    address = system.viewer.lines(r"view only: (\S+)")[0][1]
    with tab(browser, address) as shown:
        shown.open().page.click(PANEL)
        shown.wait(f"{DISABLED} === true")
        assert "opened with the address for viewing only" in shown.page.inner_text("#view-only")
        section = ".node-parameters[data-node=edge_front]"
        enabled = f"{section} :is(input, select, button):not(:disabled)"
        assert shown.page.locator(enabled).all_inner_texts() == ["Save as TOML"]
        assert shown.page.url == address.partition("?")[0]
        assert shown.complaints == []
