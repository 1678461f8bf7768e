"""The address of a viewer with a token: what of it stays in the browser, and who may link to it."""

from __future__ import annotations

from typing import Any

from tests.support.viewer.browser import Running, tab

FLAGS = ("--token", "a-token-for-this-test-1")
SERVICES = ()


def test_the_address_bar_has_no_token_and_the_page_is_opened_by_reload_and_link_without_it(
    browser: Any, system: Running
) -> None:
    bare = system.address.partition("?")[0]
    is_up = "document.querySelector('#link').dataset.state === 'up'"
    with tab(browser, system.address) as shown:
        shown.page.route(
            "http://wiki.test/", lambda route: route.fulfill(content_type="text/html", body=text)
        )
        text = f'<a id="link" href="{system.address}#vision/front/image/compressed">camera</a>'
        shown.page.goto("http://wiki.test/")
        shown.page.click("#link")  # on a page of another site
        shown.wait(is_up)
        assert shown.page.url == f"{bare}#vision/front/image/compressed"
        assert shown.page.evaluate("history.length") == 3  # nothing with the token in between
        shown.page.reload()
        shown.wait(is_up)
        text = f'<a id="link" href="{bare}">camera</a>'
        shown.page.goto("http://wiki.test/")
        shown.page.click("#link")
        shown.wait(is_up)
        assert shown.complaints == []
