"""The panel of messages: any message as a tree, also one that is meant to harm."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.viewer.browser import CAMERA, Running, Tab
from tests.support.viewer.page_server import PageServer, header, served_page, stream
from tests.support.waiting import wait_until

SERVICES = ()
"""A viewer alone: of it the pages come, and from the test what they are told."""

KEY = "vision/front/robot"
ROWS = "[...document.querySelectorAll('#message-rows li')].map((one) => one.innerText)"


@pytest.fixture
def panel(browser: Any, system: Running) -> Iterator[tuple[Tab, PageServer]]:
    """The panel beside the wall."""
    streams = stream(CAMERA), stream(KEY, "my.Robot.v1")
    with served_page(browser, system.address, *streams) as (opened, server):
        opened.page.route("**/schema?name=my.Robot.v1", lambda route: route.fulfill(json=SCHEMA))
        opened.open("?panel=message")
        server.wait_for(KEY)
        yield opened, server


SCHEMA = {
    "properties": {
        "pose": {"$ref": "#/$defs/Pose"},
        "battery": {"type": "number", "description": "charge, percent"},
    },
    "$defs": {"Pose": {"properties": {"x": {"description": "to the right, metres"}}}},
}


def tell(server: PageServer, seq: int = 1, **body: object) -> None:
    about = header(seq, KEY)
    server.tell("message", key=KEY, type="my.Robot.v1", header=about, body=body)


def rows(opened: Tab) -> list[str]:
    return [" ".join(row.split()) for row in opened.page.evaluate(ROWS)]


def test_a_message_is_a_tree_with_what_its_schema_says_and_follows_the_stream(panel) -> None:
    opened, server = panel
    tell(server, pose={"x": 1.5, "y": 2}, battery=80, label="cup")
    wait_until(
        lambda: "battery 80 charge, percent" in rows(opened), explain=lambda: str(rows(opened))
    )
    assert rows(opened)[-5:] == [
        "pose ▾ {2 items}",
        "x 1.5 to the right, metres",
        "y 2",
        "battery 80 charge, percent",
        'label "cup"',
    ]
    tell(server, seq=2, pose={"x": 9, "y": 2}, battery=79, label="cup")
    wait_until(lambda: "x 9 to the right, metres" in rows(opened))
    opened.page.fill("#message-search", "batt")
    wait_until(lambda: rows(opened) == ["battery 79 charge, percent"])
    opened.page.click("#message-hold")
    server.wait_for(KEY, watched=False)


def test_a_message_is_copied_as_json_or_selected_where_the_browser_forbids_that(panel) -> None:
    opened, server = panel
    tell(server, battery=80)
    wait_until(lambda: "battery 80 charge, percent" in rows(opened))
    clipboard = "Object.defineProperty(navigator, 'clipboard', {configurable: true, value: %s})"
    words = "document.querySelector('#message-copy').textContent"
    opened.page.evaluate(clipboard % "undefined")  # as on a page without HTTPS
    opened.page.click("#message-copy")
    opened.wait(f"{words} === 'Ctrl-C'")
    selected = opened.page.evaluate("document.getSelection().toString()")
    assert json.loads(selected) == {"header": header(1, KEY), "battery": 80}
    opened.page.focus("#message-search")
    assert opened.page.is_hidden("#message-json")
    opened.page.evaluate(clipboard % "{writeText: async (text) => (window.copied = text)}")
    opened.wait(f"{words} === 'Copy as JSON'")
    opened.page.click("#message-copy")
    opened.wait(f"{words} === 'Copied'")
    assert json.loads(opened.page.evaluate("copied"))["battery"] == 80
    assert opened.page.is_hidden("#message-json")


def test_a_schema_that_comes_after_its_only_message_is_shown_with_it(panel) -> None:
    opened, server = panel
    held: list[Any] = []
    opened.page.unroute("**/schema?name=my.Robot.v1")
    opened.page.route("**/schema?name=my.Robot.v1", lambda route: held.append(route))
    tell(server, battery=80)
    wait_until(lambda: "battery 80" in rows(opened) and held, explain=lambda: str(rows(opened)))
    held[0].fulfill(json=SCHEMA)
    wait_until(lambda: "battery 80 charge, percent" in rows(opened))


def test_a_click_on_a_number_plots_it(panel) -> None:
    opened, server = panel
    tell(server, list=[{"v": n} for n in range(30)])
    opened.page.fill("#message-search", "29")
    opened.page.click("#message-rows button[data-kind=list]", timeout=5000)
    opened.page.fill("#message-search", "v")
    opened.page.click("#message-rows li:has-text('29') >> nth=-1 >> button[data-kind=number]")
    opened.page.wait_for_selector("#field-plots h3:has-text('Robot list.29.v')")
    server.wait_for(KEY)
    tell(server, seq=2, list=[{"v": n} for n in range(30)])
    legend = "#field-plots .plot:has(h3:has-text('list.29.v')) .legend"
    wait_until(lambda: "29" in opened.page.inner_text(legend).split())


def test_of_a_hostile_message_a_part_is_shown_and_more_on_request_and_nothing_runs(panel) -> None:
    opened, server = panel
    html = {"html": "<img src=x onerror=alert(1)>", "__proto__": {"polluted": 1}}
    tell(server, **html, **{f"f{n}": n for n in range(10_000)})
    wait_until(lambda: len(rows(opened)) == 300)
    assert 'html "<img src=x onerror=alert(1)>"' in rows(opened)
    assert "other fields" in opened.page.inner_text("#message-more")
    opened.page.click("#message-more")
    wait_until(lambda: len(rows(opened)) == 600)
    assert opened.page.evaluate("({}).polluted === undefined")
    assert opened.page.evaluate("document.querySelectorAll('#message-rows img').length") == 0


def test_a_message_of_a_megabyte_is_said_to_be_too_large(panel) -> None:
    opened, server = panel
    server.tell("large", key=KEY, bytes=1_000_000, header=header(1, KEY))
    words = "document.querySelector('#message-words').textContent"
    opened.wait(f"{words}.includes('too many to be shown here') && {words}.includes('1.0 MB')")
    tell(server, seq=2, speed=3)
    wait_until(lambda: "speed 3" in rows(opened))
