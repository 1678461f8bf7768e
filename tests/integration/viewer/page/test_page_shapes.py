"""Zones and lines are drawn with mouse, keys and fingers, and shown with their counts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tests.support.viewer.browser import CAMERA, Running, Tab
from tests.support.viewer.page_server import PageServer, header, served_page, stream

SERVICES = ()
"""A viewer alone: of it the pages come, and from the test what they are told."""

TRACKS = "vision/front/tracks"
EVENTS = stream("vision/front/events", "vision.TrackEvent.v1")
FRAME = {"width": 320, "height": 240}
ZONE = "mine 50,50 150,50 150,120"
DRAWN = "(document.querySelector('canvas.overlay')?.drawn?.shapes.join(' | ') ?? '')"


@contextmanager
def shown(
    browser: Any, system: Running, scope: str = "control", **context: Any
) -> Iterator[tuple[Tab, PageServer]]:
    """Yield the camera in the large view, of a page that may do what ``scope`` permits."""
    streams = stream(CAMERA), stream(TRACKS, "vision.Tracks.v1"), EVENTS
    with served_page(browser, system.address, *streams, **context) as (tab, server):
        server.scope = scope
        tab.open(CAMERA)
        server.wait_for(CAMERA)
        server.tell("nodes", nodes=[{"node": "tracker_front", "cameras": ["front"]}])
        server.show_grey(CAMERA, 1, 50, **FRAME)
        tab.wait_for_red(CAMERA, 10, 24, 50)
        yield tab, server


def say(server: PageServer, **texts: str) -> None:
    """Tell the page the tracker's shapes of each kind."""
    shapes = dict.fromkeys(("zones", "lines", "regions", "ignore"), "") | texts
    parameters = [{"name": name, "value": value} for name, value in shapes.items()]
    server.tell("parameters", node="tracker_front", parameters=parameters)


def begin(tab: Tab) -> None:
    """Begin to draw; the picture has been painted since, as large as is left beside the bar."""
    tab.wait("!document.querySelector('#shapes-button').disabled")
    tab.page.keyboard.press("z")
    assert tab.page.is_visible("#shapes-bar")
    painted = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    for _ in range(2):
        tab.page.evaluate(painted)


def test_a_zone_and_a_line_are_drawn_moved_and_deleted_with_mouse_and_keys(
    browser: Any, system: Running
) -> None:
    with shown(browser, system) as (tab, server):
        page = tab.page
        say(server)
        begin(tab)
        page.click("#add-zones")
        for corner in ((50, 50), (150, 50), (300, 10)):
            page.mouse.click(*tab.place(CAMERA, *corner))
        page.keyboard.press("Control+z")  # the corner that was wrong
        for corner in ((150, 120), (50, 50)):
            page.mouse.click(*tab.place(CAMERA, *corner))
        drawn = "zone1 50,50 150,50 150,120"
        asked = server.answer()
        assert (asked["node"], asked["values"]) == ("tracker_front", {"zones": drawn})
        assert asked["expected"] == {"zones": ""}
        page.click("#add-lines")
        for end in ((200, 30), (200, 200)):
            page.mouse.click(*tab.place(CAMERA, *end))
        assert server.answer()["values"] == {"lines": "line1 200,30 200,200"}
        assert page.input_value("#shape-name") == "line1"
        page.fill("#shape-name", "gate")
        page.keyboard.press("Enter")
        assert server.answer()["values"] == {"lines": "gate 200,30 200,200"}
        page.mouse.move(*tab.place(CAMERA, 150, 120))
        page.mouse.down()
        page.mouse.move(*tab.place(CAMERA, 160, 125))
        page.mouse.move(*tab.place(CAMERA, 170, 130))
        page.mouse.up()
        assert server.answer()["values"] == {"zones": drawn.replace("150,120", "170,130")}
        page.keyboard.press("1")  # no longer the whole frame, which stays where it is
        tab.wait("document.querySelector('canvas.overlay').view.scale === 1")
        before = tab.place(CAMERA, 10, 24)
        for key, place in (("ArrowRight", "171,130"), ("Shift+ArrowUp", "171,120")):
            page.keyboard.press(key)
            assert server.answer()["values"] == {"zones": drawn.replace("150,120", place)}
        assert tab.place(CAMERA, 10, 24) == before
        page.click("#shape-delete")
        assert server.answer(ok=False, error="zones: no (not now)")["values"] == {"zones": ""}
        tab.wait("document.querySelector('#shape-refusal').textContent === 'not now'")
        page.keyboard.press("Escape")
        assert page.is_hidden("#shapes-bar")
        assert page.is_visible("#large")


def test_a_finger_drags_a_corner_downwards_while_the_whole_frame_is_shown(
    browser: Any, system: Running
) -> None:
    with shown(browser, system, has_touch=True) as (tab, server):
        say(server, zones=ZONE)
        begin(tab)
        touch = tab.page.context.new_cdp_session(tab.page)
        for kind, *points in (
            ("touchStart", (150, 120)), ("touchMove", (150, 150)), ("touchMove", (150, 180)),
            ("touchMove", (150, 200)), ("touchEnd",),
        ):  # fmt: skip
            places = [dict(zip("xy", tab.place(CAMERA, *point), strict=True)) for point in points]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})
        assert server.answer()["values"] == {"zones": ZONE.replace("150,120", "150,200")}


def test_a_page_for_viewing_shows_the_shapes_with_the_counts_of_the_frame_and_cannot_draw(
    browser: Any, system: Running
) -> None:
    counts = {
        "tracks": [],
        "zones": {"a": {"entered": 7, "left": 5, "dwelled": 0, "inside": 2}},
        "lines": {"gate": {"left": 3, "right": 5}},
    }
    with shown(browser, system, scope="view") as (tab, server):
        say(server, zones="a 0,0 9,0 9,9", lines="gate 200,30 200,200; far world 0,0 1,1")
        tab.wait(f"{DRAWN} === 'a | gate'")
        server.wait_for(TRACKS)
        server.tell("message", key=TRACKS, header=header(2, CAMERA, **FRAME), body=counts)
        server.show_grey(CAMERA, 2, 60, **FRAME)
        tab.wait(f"{DRAWN} === 'a: 2 in | gate: 5 ←  3 →'")
        tab.page.keyboard.press("z")
        assert tab.page.is_disabled("#shapes-button")
        assert tab.page.is_hidden("#shapes-bar")
