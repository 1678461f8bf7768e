"""Boxes are drawn on the frame they belong to, within 3 pixels of the truth."""

from __future__ import annotations

from typing import Any

import msgpack
import pytest

from tests.support.listening import Listener, open_client
from tests.support.publishing import publish_cameras
from tests.support.viewer.browser import CAMERA, TRUTH, Open, Running, Tab
from tests.support.waiting import wait_until

RATE_HZ = 30
CENTROID = "vision/front/centroid"
WITHIN_PIXELS = 3
CHOICES = """
    localStorage.setItem("zv.overlays", '{"centroid": false, "tracks": false, "truth": true}');
    localStorage.setItem("zv.trails", "false");
"""

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
    const { data } = overlay.getContext("2d").getImageData(0, 0, width, height);
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
        tab = _with_truth(open_tab)
        assert sum(_frames(tab, truth, 30)) > 0, "no box in 30 frames"


@pytest.mark.quiet
def test_the_page_keeps_up_with_30_hz(open_tab: Open) -> None:
    tab = _with_truth(open_tab)
    tab.wait("parseFloat(document.querySelector('#figure-rate').textContent) > 25")


def test_under_load_boxes_are_on_their_frames_too(open_tab: Open, system: Running) -> None:
    with (
        publish_cameras(system.router.endpoint, 12, rate_hz=10),
        open_client(system.router.endpoint) as session,
    ):
        truth = Listener(session, TRUTH)
        wall = open_tab()
        wall.wait("document.querySelectorAll('.tile[data-state=live]').length >= 10")
        assert _frames(_with_truth(open_tab), truth, 10)


def test_the_lines_on_the_canvas_are_within_3_pixels_of_the_truth(
    open_tab: Open, system: Running
) -> None:
    with open_client(system.router.endpoint) as session:
        truth = Listener(session, TRUTH)
        tab = _with_truth(open_tab)
        wait_until(lambda: truth.messages)
        tab.page.keyboard.press("Space")  # pause: the canvas stays while it is measured
        compared = 0
        for _ in range(200):  # on a busy machine some frames are shown without their overlay
            shown = tab.page.evaluate(SHOWN)
            body = _of_frame(truth, shown["epoch"], shown["seq"]) if shown else None
            for track in body["tracks"] if body else []:
                if min(track["box"][2:]) < 12:
                    continue  # hardly in the picture
                gaps = tab.page.evaluate(GAPS, track["box"])
                if tab.page.evaluate(SHOWN) != shown:
                    break  # one that was taken before the pause was painted after SHOWN
                assert max(gaps) <= WITHIN_PIXELS, (shown, track, gaps)
                compared += 1
            if compared >= 12:
                return
            seq = tab.page.evaluate("document.querySelector('canvas.picture').dataset.seq")
            tab.page.keyboard.press(".")
            tab.wait(f"document.querySelector('canvas.picture').dataset.seq !== '{seq}'")
        raise AssertionError(f"only {compared} boxes in 200 frames")


def test_after_a_restart_of_the_router_boxes_are_on_their_frames_again(
    open_tab: Open, system: Running
) -> None:
    tab = _with_truth(open_tab)
    system.router.kill()
    tab.wait("document.querySelector('canvas.picture').dataset.live === 'false'")
    system.router.start()
    with open_client(system.router.endpoint) as session:
        truth = Listener(session, TRUTH)
        tab.wait_until_live(CAMERA)
        _frames(tab, truth, 10)
    tab.wait("document.querySelector('#link').dataset.state === 'up'")


def test_without_its_tracker_a_picture_is_shown_at_once_and_says_so(
    open_tab: Open, system: Running
) -> None:
    tracker = system.service("tracker", "--camera", "lone")
    system.service("camera", "--camera", "lone", "--rate", 10)
    tab = open_tab("vision/lone/image/compressed")
    joined = "document.querySelector('canvas.picture')?.dataset.overlay"
    tab.page.evaluate("localStorage.setItem('zv.overlays', '{\"truth\": false}')")
    tab.page.reload()
    tab.wait(f"{joined} === 'joined'")
    tracker.process.kill()
    tab.wait(f"{joined} === 'without'")
    tab.wait("document.querySelector('canvas.picture').dataset.live === 'true'")
    tab.wait("document.querySelector('.pane-badge').textContent.includes('without centroid')")


def test_invalid_messages_are_not_drawn_and_cause_no_error(open_tab: Open, system: Running) -> None:
    tab = _with_truth(open_tab)
    tab.page.evaluate("localStorage.removeItem('zv.trails')")
    tab.page.evaluate("localStorage.removeItem('zv.overlays')")
    tab.page.reload()
    tab.wait_until_live(CAMERA)
    tab.page.keyboard.press("p")  # the plots hear the centroid, too
    with open_client(system.router.endpoint) as session:
        frames = Listener(session, CAMERA)
        for _ in range(10):
            before = len(frames.messages)
            wait_until(lambda count=before: len(frames.messages) > count)
            header = frames.messages[-1].header
            for body in STRANGE:
                for key in (TRUTH, CENTROID):
                    session.put(key, msgpack.packb({"header": header} | body))
        seq = frames.messages[-1].header["seq"]
    for _ in range(5):
        shown = tab.wait(f"(() => {{ const one = {SHOWN}; return one?.seq > {seq} && one; }})()")
        assert len({mark["id"] for mark in shown["boxes"]}) == len(shown["boxes"])
        seq = shown["seq"]
    assert tab.complaints == []


def _with_truth(open_tab: Open) -> Tab:
    tab = open_tab()
    tab.page.evaluate(CHOICES)
    tab.open(CAMERA).page.reload()
    tab.wait_until_live(CAMERA)
    return tab


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
