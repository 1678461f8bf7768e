"""Twelve cameras on one wall, and the token that other machines need."""

from __future__ import annotations

from typing import Any

from tests.support.publishing import publish_cameras
from tests.support.viewer.browser import Running, tab

TOKEN = "a-token-for-this-test-1"
SERVICES = ()
FLAGS = ("--token", TOKEN)


def test_twelve_cameras_are_all_live_at_once(browser: Any, system: Running) -> None:
    with (
        publish_cameras(system.router.endpoint, 12, rate_hz=5),
        tab(browser, system.address, viewport={"width": 1920, "height": 1080}) as shown,
    ):
        shown.open()
        shown.wait("document.querySelectorAll('.tile[data-state=live]').length === 12")
        assert shown.complaints == []


def test_without_the_token_there_is_no_page(browser: Any, system: Running) -> None:
    bare = system.address.partition("?")[0]
    with tab(browser, bare) as shown:
        assert shown.page.goto(bare).status == 401
        assert shown.page.query_selector("#wall") is None


def test_with_the_token_there_is_one_and_it_connects(browser: Any, system: Running) -> None:
    assert TOKEN in system.address
    with tab(browser, system.address) as shown:
        shown.open().wait("document.querySelector('#link').dataset.state === 'up'")
        assert shown.complaints == []
