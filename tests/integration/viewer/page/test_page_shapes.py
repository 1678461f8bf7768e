"""Zones and lines are drawn with the mouse, kept by the tracker, and shown with their counts."""

from __future__ import annotations

import json
from collections.abc import Iterator

import msgpack
import pytest

from tests.support.listening import Listener, open_client, wait_for_nodes
from tests.support.typist import zv
from tests.support.viewer.browser import CAMERA, Open, Running, Tab, running
from tests.support.viewer.browser import tab as a_tab
from tests.support.waiting import wait_until

TRACKS = "vision/front/tracks"


@pytest.fixture(scope="module")
def system(browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    """A synthetic camera and its tracker."""
    with running(tmp_path_factory.mktemp("system")) as found:
        found.service("camera", "--rate", 10)
        found.service("tracker")
        with open_client(found.router.endpoint) as client:
            wait_for_nodes(client, "camera_front", "tracker_front")
        yield found


@pytest.fixture
def tab(open_tab: Open, system: Running) -> Tab:
    """The camera in the large view, while shapes are edited; there are none at first."""
    _zv(system, "param", "set", "tracker_front", "zones=", "lines=")
    opened = open_tab(CAMERA)
    opened.wait_until_live(CAMERA)
    opened.wait("!document.querySelector('#shapes-button').disabled")
    opened.page.keyboard.press("z")
    assert opened.page.is_visible("#shapes-bar")
    return opened


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
    page.mouse.move(*_place(tab, 150, 120))
    page.mouse.down()
    page.mouse.move(*_place(tab, 160, 125))
    page.mouse.move(*_place(tab, 170, 130))
    page.mouse.up()
    assert _shapes(system, "zones", "170,130") == "zone1 50,50 150,50 170,130 50,120"
    page.click("#shape-delete")
    wait_until(lambda: _value(system, "zones") == "")
    assert _value(system, "lines") == "gate 200,30 200,200"
    assert tab.complaints == []


def test_a_zone_that_crosses_itself_is_refused_with_the_reason(tab: Tab, system: Running) -> None:
    tab.page.click("#add-zones")
    for corner in ((50, 50), (150, 120), (150, 50), (50, 120), (50, 120)):
        _click(tab, *corner)
    words = tab.wait("document.querySelector('#shape-refusal:not([hidden])')?.textContent")
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


def test_the_counts_of_the_frame_are_written_at_the_shapes(tab: Tab, system: Running) -> None:
    _zv(system, "param", "set", "tracker_front", "lines=gate 200,30 200,200", "zones=a 0,0 9,0 9,9")
    body = {
        "tracks": [],
        "zones": {"a": {"entered": 7, "left": 5, "dwelled": 0, "inside": 2}},
        "lines": {"gate": {"left": 3, "right": 5}},
    }
    wanted = json.dumps(["a: 2 in", "gate: 5 ←  3 →"], ensure_ascii=False, separators=(",", ":"))
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


_DRAWN = "(document.querySelector('canvas.overlay')?.dataset.shapes ?? '')"

PLACE = """([x, y]) => {
    const overlay = document.querySelector("canvas.overlay");
    const [scale, left, top] = overlay.dataset.view.split(" ").map(Number);
    const box = overlay.getBoundingClientRect();
    return [box.left + ((x - left) * scale + overlay.width / 2) / devicePixelRatio,
        box.top + ((y - top) * scale + overlay.height / 2) / devicePixelRatio];
}"""


def _place(tab: Tab, x: float, y: float) -> list[float]:
    """Return where on the screen a point of the frame is."""
    found: list[float] = tab.page.evaluate(PLACE, [x, y])
    return found


def _click(tab: Tab, x: float, y: float) -> None:
    tab.page.mouse.click(*_place(tab, x, y))


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
