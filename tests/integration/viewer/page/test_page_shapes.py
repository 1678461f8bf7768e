"""Zones and lines are drawn with the mouse, kept by the tracker, and shown with their counts."""

from __future__ import annotations

import json

import msgpack
import pytest

from tests.support.listening import Listener, open_client
from tests.support.typist import zv
from tests.support.viewer.browser import CAMERA, Open, Running, Tab
from tests.support.viewer.browser import tab as a_tab
from tests.support.waiting import wait_until

SERVICES = ("camera", "tracker")

TRACKS = "vision/front/tracks"
REFUSAL = "document.querySelector('#shape-refusal')"


@pytest.fixture
def tab(open_tab: Open, system: Running) -> Tab:
    """The camera in the large view, while shapes are edited; there are none at first."""
    _zv(system, "param", "set", "tracker_front", "zones=", "lines=", "regions=", "ignore=")
    opened = open_tab(CAMERA)
    opened.wait_until_live(CAMERA)
    opened.wait("!document.querySelector('#shapes-button').disabled")
    return _drawing(opened)


def test_a_zone_and_a_line_are_drawn_named_moved_and_deleted(tab: Tab, system: Running) -> None:
    page = tab.page
    page.click("#add-zones")
    corners = [(50, 50), (150, 50), (150, 120), (50, 120)]
    for corner in (*corners, corners[0]):
        _click(tab, *corner)
    assert _shapes(system, "zones", "zone1") == "zone1 50,50 150,50 150,120 50,120"
    page.click("#add-lines")
    _click(tab, 200, 30)
    _click(tab, 200, 200)
    assert _shapes(system, "lines", "line1") == "line1 200,30 200,200"
    assert page.input_value("#shape-name") == "line1"
    page.fill("#shape-name", "gate")
    page.keyboard.press("Enter")
    assert _shapes(system, "lines", "gate") == "gate 200,30 200,200"
    # The corner at the lower right is dragged; the picture stays where it is.
    page.mouse.move(*tab.place(CAMERA, 150, 120))
    page.mouse.down()
    page.mouse.move(*tab.place(CAMERA, 160, 125))
    page.mouse.move(*tab.place(CAMERA, 170, 130))
    page.mouse.up()
    assert _shapes(system, "zones", "170,130") == "zone1 50,50 150,50 170,130 50,120"
    page.click("#shape-delete")
    wait_until(lambda: _value(system, "zones") == "")
    assert _value(system, "lines") == "gate 200,30 200,200"
    assert tab.complaints == []


def test_regions_are_drawn_as_zones_are(tab: Tab, system: Running) -> None:
    for kind, name, left in (("regions", "region1", 20), ("ignore", "ignored1", 170)):
        tab.page.click(f"#add-{kind}")
        corners = [(left, 40), (left + 100, 40), (left + 100, 140)]
        for corner in (*corners, corners[0]):
            _click(tab, *corner)
        wanted = " ".join(f"{x},{y}" for x, y in corners)
        assert _shapes(system, kind, name) == f"{name} {wanted}"
    tab.wait(f"{_DRAWN}.split(' | ').sort().join() === 'ignored1,region1'")
    assert tab.complaints == []


def test_each_change_is_taken_back_and_none_of_another(tab: Tab, system: Running) -> None:
    page = tab.page
    page.click("#add-zones")
    for corner in ((50, 50), (150, 50), (300, 10)):
        _click(tab, *corner)
    page.keyboard.press("Control+z")  # the corner that was wrong
    for corner in ((150, 120), (50, 50)):
        _click(tab, *corner)
    drawn = "zone1 50,50 150,50 150,120"
    assert _shapes(system, "zones", "zone1") == drawn
    page.mouse.move(*tab.place(CAMERA, 150, 120))
    page.mouse.down()
    page.mouse.move(*tab.place(CAMERA, 160, 130))
    page.mouse.up()
    moved = _shapes(system, "zones", "160,130")
    page.click("#shape-delete")
    wait_until(lambda: _value(system, "zones") == "")
    page.keyboard.press("Control+z")
    assert _shapes(system, "zones", "zone1") == moved
    page.click("#shape-undo")
    wait_until(lambda: _value(system, "zones") == drawn)
    _zv(system, "param", "set", "tracker_front", "zones=theirs 10,10 90,10 90,90")
    tab.wait(f"{_DRAWN}.includes('theirs')")
    page.keyboard.press("Control+z")
    words = tab.wait(f"{REFUSAL}.checkVisibility() && {REFUSAL}.textContent")
    assert words == "zones was changed by another meanwhile"
    assert _value(system, "zones") == "theirs 10,10 90,10 90,90"
    assert page.is_disabled("#shape-undo")
    assert tab.complaints == []


def test_a_zone_that_crosses_itself_is_refused_with_the_reason(tab: Tab, system: Running) -> None:
    tab.page.click("#add-zones")
    for corner in ((50, 50), (150, 120), (150, 50), (50, 120), (50, 120)):
        _click(tab, *corner)
    words = tab.wait(f"{REFUSAL}.checkVisibility() && {REFUSAL}.textContent")
    assert words == (
        "'zone1': the edge from point 1 to 2 crosses or touches the edge from point 3 to 4"
    )
    assert _value(system, "zones") == ""
    tab.page.keyboard.press("Escape")
    assert tab.page.is_hidden("#shapes-bar")
    assert tab.page.is_visible("#large")


def test_a_change_by_another_is_drawn_and_escape_gives_up_what_is_begun(
    tab: Tab, system: Running
) -> None:
    _zv(system, "param", "set", "tracker_front", "lines=gate 200,30 200,200; far world 0,0 1,1")
    tab.wait(f"{_DRAWN}.includes('gate')")
    assert "far" not in tab.page.evaluate(_DRAWN)
    tab.page.click("#add-lines")
    _click(tab, 50, 50)
    tab.page.keyboard.press("Escape")
    _click(tab, 60, 20)
    tab.page.keyboard.press("Escape")
    assert tab.page.is_hidden("#shapes-bar")
    assert _value(system, "lines") == "gate 200,30 200,200; far world 0,0 1,1"


def test_of_two_who_draw_at_once_the_later_is_told_and_overwrites_nothing(
    tab: Tab, system: Running
) -> None:
    _zv(system, "param", "set", "tracker_front", "zones=mine 50,50 150,50 150,120")
    tab.wait(f"{_DRAWN}.includes('mine')")
    tab.page.mouse.move(*tab.place(CAMERA, 150, 120))
    tab.page.mouse.down()
    tab.page.mouse.move(*tab.place(CAMERA, 160, 125))
    both = "mine 50,50 150,50 150,120; theirs 200,10 300,10 300,90"
    _zv(system, "param", "set", "tracker_front", f"zones={both}")
    tab.page.mouse.up()
    words = tab.wait(f"{REFUSAL}.checkVisibility() && {REFUSAL}.textContent")
    assert words == "zones of tracker_front was changed meanwhile"
    assert _value(system, "zones") == both
    tab.wait(f"{_DRAWN}.includes('theirs')")
    tab.page.mouse.move(*tab.place(CAMERA, 150, 120))
    tab.page.mouse.down()
    tab.page.mouse.move(*tab.place(CAMERA, 170, 130))
    tab.page.mouse.up()
    moved = both.replace("150,120", "170,130")
    assert _shapes(system, "zones", "170,130") == moved
    assert tab.page.is_hidden("#shape-refusal")


def test_a_finger_drags_a_corner_downwards_while_the_whole_frame_is_shown(
    open_tab: Open, system: Running
) -> None:
    _zv(system, "param", "set", "tracker_front", "zones=mine 50,50 150,50 150,120", "lines=")
    tab = open_tab(CAMERA, has_touch=True)
    tab.wait(f"{_DRAWN}.includes('mine')")
    _drawing(tab)
    touch = tab.page.context.new_cdp_session(tab.page)
    for kind, *points in (
        ("touchStart", (150, 120)), ("touchMove", (150, 150)), ("touchMove", (150, 180)),
        ("touchMove", (150, 200)), ("touchEnd",),
    ):  # fmt: skip
        places = [dict(zip("xy", tab.place(CAMERA, *point), strict=True)) for point in points]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})
    assert _shapes(system, "zones", "150,200") == "mine 50,50 150,50 150,200"


def test_arrow_keys_move_a_corner_or_a_shape_by_pixels_and_not_the_picture(
    tab: Tab, system: Running
) -> None:
    _zv(system, "param", "set", "tracker_front", "zones=mine 50,50 150,50 150,120")
    tab.wait(f"{_DRAWN}.includes('mine')")
    before = tab.place(CAMERA, 10, 24)
    _click(tab, 150, 120)
    for key in ("ArrowRight", "ArrowRight", "ArrowDown", "Shift+ArrowLeft"):
        tab.page.keyboard.press(key)
    assert _shapes(system, "zones", "142,121") == "mine 50,50 150,50 142,121"
    _click(tab, 100, 50)  # an edge
    tab.page.keyboard.press("ArrowUp")
    assert _shapes(system, "zones", "142,120") == "mine 50,49 150,49 142,120"
    tab.page.keyboard.press("Control+z")
    assert _shapes(system, "zones", "142,121") == "mine 50,50 150,50 142,121"
    assert tab.place(CAMERA, 10, 24) == before
    assert tab.page.is_hidden("#shape-refusal")


def test_the_counts_of_the_frame_are_written_at_the_shapes(tab: Tab, system: Running) -> None:
    _zv(system, "param", "set", "tracker_front", "lines=gate 200,30 200,200", "zones=a 0,0 9,0 9,9")
    body = {
        "tracks": [],
        "zones": {"a": {"entered": 7, "left": 5, "dwelled": 0, "inside": 2}},
        "lines": {"gate": {"left": 3, "right": 5}},
    }
    wanted = "a: 2 in | gate: 5 ←  3 →"
    tab.page.evaluate("localStorage.setItem('zv.overlays', '{\"tracks\": true}')")
    tab.page.reload()
    with open_client(system.router.endpoint) as session:
        frames = Listener(session, CAMERA)
        publisher = session.declare_publisher(TRACKS)

        def counted() -> bool:
            header = frames.wait_for(1)[-1].header
            publisher.put(msgpack.packb({"header": header} | body))
            return bool(tab.page.evaluate(_DRAWN) == wanted)

        wait_until(counted)
    assert tab.complaints == []


def test_a_page_for_viewing_shows_the_shapes_and_cannot_draw(browser, system: Running) -> None:
    _zv(system, "param", "set", "tracker_front", "lines=gate 200,30 200,200")
    viewer = system.service("view", "--port", 0, "--token", "of-16-characters-and-more")
    address = viewer.lines(r"view only: (\S+)")[0][1]
    with a_tab(browser, address) as shown:
        shown.open(CAMERA).wait_until_live(CAMERA)
        shown.wait(f"{_DRAWN}.includes('gate')")
        shown.page.keyboard.press("z")
        assert shown.page.is_disabled("#shapes-button")
        assert shown.page.is_hidden("#shapes-bar")


_DRAWN = "(document.querySelector('canvas.overlay')?.drawn?.shapes.join(' | ') ?? '')"


def _drawing(tab: Tab) -> Tab:
    """Begin to draw; a frame has been painted since, as large as is left beside the bar."""
    tab.page.keyboard.press("z")
    assert tab.page.is_visible("#shapes-bar")
    seq = "document.querySelector('canvas.picture').dataset.seq"
    for _ in range(2):
        tab.wait(f"{seq} !== '{tab.page.evaluate(seq)}'")
    return tab


def _click(tab: Tab, x: float, y: float) -> None:
    tab.page.mouse.click(*tab.place(CAMERA, x, y))


def _value(system: Running, name: str) -> str:
    done = zv(system.router.endpoint, "param", "get", "tracker_front", name, "--json")
    found: str = json.loads(done.stdout)["value"]
    return found


def _shapes(system: Running, name: str, wanted: str) -> str:
    """Return the tracker's text as soon as it has something wanted in it."""
    return wait_until(lambda: (found := _value(system, name)) and wanted in found and found)


def _zv(system: Running, *arguments: str) -> None:
    done = zv(system.router.endpoint, *arguments)
    assert done.returncode == 0, done.stderr
