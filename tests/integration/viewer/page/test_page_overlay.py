"""Boxes are drawn on the frame they belong to, within 3 pixels of the truth."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.listening import Listener, open_client
from tests.support.viewer.browser import CAMERA, TRUTH, Open, Running, Tab
from tests.support.viewer.page_server import PageServer, header, served_page, stream
from tests.support.waiting import wait_until

SERVICES = ("camera",)
RATE_HZ = 30
CENTROID = "vision/front/centroid"
WITHIN_PIXELS = 3
FRAME = {"width": 320, "height": 240}
STATE = "document.querySelector('canvas.picture')?.dataset.overlay"

# In one turn of the page's loop: which frame is shown, and which boxes were drawn on it.
SHOWN = """(() => {
    const { epoch, seq, overlay } = document.querySelector("canvas.picture")?.dataset ?? {};
    if (overlay !== "joined") return null;
    const boxes = document.querySelector("canvas.overlay").drawn.marks;
    return { epoch, seq: Number(seq), boxes };
})()"""

# How far from each side of a box, in the frame's pixels, the nearest coloured pixel is.
GAPS = """([left, top, boxWidth, boxHeight]) => {
    const overlay = document.querySelector("canvas.overlay");
    const { width, height } = overlay;
    const { scale, x, y } = overlay.view;
    const copy = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
    copy.drawImage(overlay, 0, 0);
    const { data } = copy.getImageData(0, 0, width, height);
    const isDrawn = (px, py) => {
        const [column, row] = [Math.round(px), Math.round(py)];
        if (column < 0 || row < 0 || column >= width || row >= height) return false;
        const at = 4 * (row * width + column);
        return data[at + 3] > 200 && Math.max(data[at], data[at + 1], data[at + 2]) > 200;
    };
    const gap = (px, py, dx, dy) => {
        const from = [(px - x) * scale + width / 2, (py - y) * scale + height / 2];
        for (let away = 0; away < 20 * scale; away += 1) {
            for (const sign of [1, -1]) {
                if (isDrawn(from[0] + sign * away * dx, from[1] + sign * away * dy)) {
                    return away / scale;
                }
            }
        }
        return Infinity;
    };
    const [across, down] = [left + 0.7 * boxWidth, top + 0.7 * boxHeight];
    return [gap(left, down, 1, 0), gap(left + boxWidth, down, 1, 0),
        gap(across, top + boxHeight, 0, 1)];
}"""

PLACE = {"x": 1, "y": 2, "box": [3, 4, 5, 6], "area": 7.0}
STRANGE: list[dict[str, Any]] = [
    {},
    {"header": None},
    {"header": {"epoch": "x", "seq": None, "stamp_ns": "y"}},
    {"tracks": None, "x": "1", "y": [2], "box": 3},
    {"tracks": [None, 5, {}, {"box": None}, {"box": {"length": 4}}]},
    PLACE | {"box": [3, 4]},
    PLACE | {"y": None},
    # These are centroids, with more in them than the page knows.
    PLACE | {"tracks": [None, PLACE | {"box": "abcd"}, {"box": [1]}]},
    PLACE | {"tracks": "none", "id": {}, "state": 5},
]


def test_at_30_hz_each_frame_has_the_boxes_of_its_truth(open_tab: Open, system: Running) -> None:
    with open_client(system.router.endpoint) as session:
        truth = Listener(session, TRUTH)
        tab = open_tab(CAMERA)
        assert sum(_frames(tab, truth, 30)) > 0, "no box in 30 frames"


@pytest.mark.quiet
def test_the_page_keeps_up_with_30_hz(open_tab: Open) -> None:
    tab = open_tab(CAMERA)
    tab.wait("parseFloat(document.querySelector('#figure-rate').textContent) > 25")


@pytest.fixture
def opened(browser: Any, system: Running) -> Iterator[tuple[Tab, PageServer]]:
    """The camera in the large view, whose pictures and overlays come from the test."""
    overlays = stream(TRUTH, "vision.Tracks.v1"), stream(CENTROID, "vision.Centroid.v1")
    with served_page(browser, system.address, stream(CAMERA), *overlays) as (tab, server):
        tab.open(CAMERA)
        for key in (CAMERA, TRUTH, CENTROID):
            server.wait_for(key)
        yield tab, server


def track(number: int, box: list[int]) -> dict[str, Any]:
    left, top, width, height = box
    place = {"x": left + width / 2, "y": top + height / 2, "box": box, "area": 1.0}
    return {"id": number, "state": "confirmed", **place}


def test_the_lines_on_the_canvas_are_within_3_pixels_of_the_truth_however_it_is_zoomed(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    boxes = [[20, 30, 60, 40], [150, 20, 41, 77], [200, 130, 100, 90]]
    tracks = [track(number, box) for number, box in enumerate(boxes, 1)]
    about = header(1, CAMERA, **FRAME)
    server.tell("message", key=TRUTH, header=about, body={"tracks": tracks})
    server.tell("message", key=CENTROID, header=about, body=PLACE)
    server.show_grey(CAMERA, 1, 0, **FRAME)  # it would not wait long for its messages
    tab.wait(f"{SHOWN}?.seq === 1")
    scale = "document.querySelector('canvas.overlay').view.scale"
    before = None
    for key in ("0", "-", "1"):
        tab.page.keyboard.press(key)
        tab.wait(f"{scale} !== {json.dumps(before)}")
        before = tab.page.evaluate(scale)
        for box in boxes:
            wait_until(
                lambda box=box: max(tab.page.evaluate(GAPS, box)) <= WITHIN_PIXELS,
                explain=lambda box=box, key=key: f"{key}: {tab.page.evaluate(GAPS, box)}",
            )


def test_without_its_messages_a_picture_is_shown_at_once_and_says_so(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    for seq in range(4):
        about = header(seq, CAMERA, **FRAME)
        server.tell("message", key=TRUTH, header=about, body={"tracks": []})
        if seq == 0:
            server.tell("message", key=CENTROID, header=about, body=PLACE)
        server.show_grey(CAMERA, seq, 50, **FRAME)
        if seq == 0:
            tab.wait(f"{STATE} === 'joined'")
        tab.wait(f"document.querySelector('canvas.picture').dataset.seq === '{seq}'")
    assert tab.page.evaluate(STATE) == "without"
    assert tab.page.get_attribute("canvas.picture", "data-live") == "true"
    # Of the last second, some frames may have had it.
    badge = "document.querySelector('.pane-badge').textContent"
    tab.wait(f"/overlay on 1 of \\d+ frames|without centroid/.test({badge})")


def test_invalid_messages_are_not_drawn_and_cause_no_error(opened: tuple[Tab, PageServer]) -> None:
    tab, server = opened
    tab.page.keyboard.press("p")  # the plots hear the centroid, too
    right = track(1, [10, 20, 30, 40])
    for seq, body in enumerate(STRANGE):
        about = header(seq, CAMERA, **FRAME)
        server.show_grey(CAMERA, seq, 50, **FRAME)
        for key in (TRUTH, CENTROID):
            server.tell("message", key=key, header=about, body=body)
    wrong = [None, 5, {}, {"box": None}, right | {"box": {"length": 4}}, right | {"box": [3, 4]}]
    tracks = [*wrong, right | {"y": None}, right]
    numbers = itertools.count(len(STRANGE))

    def next_shown() -> Any:
        """Send one more frame, as a busy page may show one without its messages."""
        about = header(next(numbers), CAMERA, **FRAME)
        server.tell("message", key=TRUTH, header=about, body={"tracks": tracks})
        server.tell("message", key=CENTROID, header=about, body={"x": "1", **right, "box": None})
        server.show_grey(CAMERA, about["seq"], 50, **FRAME)
        one = tab.page.evaluate(SHOWN)
        return one if one and one["seq"] >= len(STRANGE) else None

    shown = wait_until(next_shown, explain=lambda: tab.text, poll_s=0.1)
    assert [(mark["id"], mark["box"]) for mark in shown["boxes"]] == [(1, right["box"])]


def _frames(tab: Tab, truth: Listener, count: int) -> list[int]:
    """Compare frames that the page shows with the truth off the wire; return boxes in each."""
    found: dict[tuple[str, int], int] = {}
    while len(found) < count:
        shown = tab.wait(SHOWN)
        identity = (shown["epoch"], shown["seq"])
        if identity in found or _is_before(truth, *identity):
            continue
        body = wait_until(lambda one=identity: _of_frame(truth, *one))
        expected = {track["id"]: track["box"] for track in body["tracks"]}
        assert {mark["id"]: mark["box"] for mark in shown["boxes"]} == expected, identity
        found[identity] = len(expected)
    return list(found.values())


def _of_frame(truth: Listener, epoch: str, seq: int) -> dict[str, Any] | None:
    for message in reversed(truth.messages):
        if str(message.header["epoch"]) == epoch and message.header["seq"] == seq:
            return message.body
    return None


def _is_before(truth: Listener, epoch: str, seq: int) -> bool:
    """Tell whether a frame is older than what was heard."""
    first = wait_until(lambda: truth.messages)[0].header
    return str(first["epoch"]) != epoch or first["seq"] > seq
