"""What one does with the page by mouse and keys has its effect."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.support.pictures.encoded import jpeg
from tests.support.viewer.browser import CAMERA, Running, Tab
from tests.support.viewer.page_server import PageServer, header, served_page, stream
from tests.support.waiting import wait_until
from zenoh_vision.image.codecs import picture_size

SERVICES = ()
"""A viewer alone: of it the pages come, and from the test what they are told."""

REAR = "vision/rear/image/compressed"
TRUTH = "vision/front/truth"
NODE = "edge_front"
SECTION = f".node-parameters[data-node={NODE}]"
LOW = f"{SECTION} .parameter[data-name=low]"
FIELD = f"{LOW} input[type=number]"
SLIDER = f"{LOW} input[type=range]"
SHOWN = f"document.querySelector('{LOW}').dataset.value"
REFUSAL = f"document.querySelector('{LOW} .refusal')"
FOCUSED = "document.activeElement.getAttribute('href') || document.activeElement.textContent"


@pytest.fixture
def opened(browser: Any, system: Running) -> Iterator[tuple[Tab, PageServer]]:
    streams = stream(CAMERA), stream(REAR), stream(TRUTH, "vision.Tracks.v1")
    with served_page(browser, system.address, *streams) as (tab, server):
        yield tab, server


def say_low(server: PageServer, value: float) -> None:
    """Tell the page the value of the edge detector's parameter."""
    about = {"type": "float", "minimum": 0, "maximum": 1000, "choices": None, "unit": ""}
    low = {"node": NODE, "name": "low", "value": value, "default": 40.0, "description": "", **about}
    server.tell("parameters", node=NODE, parameters=[low])


def open_parameters(tab: Tab, server: PageServer, scope: str = "control") -> None:
    """Open the page on the panel of parameters, of which a node has one."""
    server.scope = scope
    tab.open()
    server.wait_for(CAMERA)
    tab.page.keyboard.press("e")
    about = {"service": "edge", "alive": True, "cameras": ["front"]}
    server.tell("nodes", nodes=[{"node": NODE, **about}])
    say_low(server, 40.0)
    tab.page.wait_for_selector(FIELD)


def test_a_parameter_is_set_refused_until_a_value_is_right_reset_and_saved(
    opened: tuple[Tab, PageServer], tmp_path: Path
) -> None:
    tab, server = opened
    open_parameters(tab, server)
    tab.page.fill(SLIDER, "0")
    assert server.answer()["values"] == {"low": 0}
    say_low(server, 0.0)
    tab.wait(f"{SHOWN} === '0'")
    tab.page.fill(FIELD, "500")
    tab.page.keyboard.press("Enter")
    asked = server.answer(ok=False, error="low = 500 is above high = 100", allowed="at most high")
    assert (asked["node"], asked["values"]) == (NODE, {"low": 500})
    words = tab.wait(f"{REFUSAL}.checkVisibility() && {REFUSAL}.textContent")
    assert words == "low = 500 is above high = 100. Allowed: at most high"
    assert tab.page.input_value(FIELD) == "0"
    tab.page.fill(FIELD, "41")
    tab.page.keyboard.press("Enter")
    assert server.answer()["values"] == {"low": 41}
    say_low(server, 41.0)
    tab.wait(f"{SHOWN} === '41' && !{REFUSAL}.checkVisibility()")
    tab.page.click(f"{LOW} .reset")
    assert server.answer()["values"] == {"low": 40}
    with tab.page.expect_download() as download:
        tab.page.click(f"{SECTION} >> text=Save as TOML")
        assert server.answer(toml="low = 41.0\n")["op"] == "dump"
    assert download.value.suggested_filename == f"{NODE}.toml"
    download.value.save_as(tmp_path / "edge.toml")
    assert (tmp_path / "edge.toml").read_text() == "low = 41.0\n"


def test_a_text_that_is_being_typed_survives_a_change_by_another(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    open_parameters(tab, server)
    tab.page.fill(FIELD, "500")
    say_low(server, 45.0)
    tab.wait(f"{SHOWN} === '45'")
    assert tab.page.input_value(FIELD) == "500"
    tab.page.keyboard.press("Enter")
    server.answer(ok=False, error="low = 500 is above high = 100")
    tab.wait(f"document.querySelector('{FIELD}').value === '45'")


def test_a_page_for_viewing_shows_parameters_read_only_and_says_why(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    open_parameters(tab, server, "view")
    assert tab.page.is_disabled(FIELD)
    assert "opened with the address for viewing only" in tab.page.inner_text("#view-only")
    enabled = f"{SECTION} :is(input, select, button):not(:disabled)"
    assert tab.page.locator(enabled).all_inner_texts() == ["Save as TOML"]


def test_one_click_shows_all_steps_of_the_same_frame_without_boxes_and_the_parameters(
    browser: Any, system: Running
) -> None:
    topics = ("smoothed", "magnitude", "direction", "suppressed", "thresholded")
    edges = "vision/front/edges/compressed"
    keys = [CAMERA, *(f"vision/front/edges/{topic}/compressed" for topic in topics), edges]
    streams = [stream(key) for key in keys]
    truth = stream(TRUTH, "vision.Tracks.v1")
    with served_page(browser, system.address, *streams, truth) as (tab, server):
        tab.open(edges)
        server.wait_for(edges)
        tab.page.click("#steps")
        assert tab.page.is_visible("#panel-parameters")
        track = {"id": 1, "state": "confirmed", "x": 9, "y": 9, "box": [5, 5, 9, 9], "area": 9}
        for key in (*keys, TRUTH):
            server.wait_for(key)
        steps = "[...document.querySelectorAll('.pane')].map((one) => one.dataset.step).join()"
        seqs = "[...document.querySelectorAll('canvas.picture')].map((one) => one.dataset.seq)"
        boxes = "[...document.querySelectorAll('canvas.overlay')].map((one) => one.drawn.marks)"
        server.tell("message", key=TRUTH, header=header(1, CAMERA), body={"tracks": [track]})
        for key in keys:
            server.show_grey(key, 1, 50)
        tab.wait(f"{steps} === '{','.join(['true'] * 7)}'")
        assert tab.page.evaluate(seqs) == ["1"] * 7
        marks = tab.page.evaluate(boxes)
        assert [len(each) for each in marks] == [1, 0, 0, 0, 0, 0, 0]  # they cover small steps
        numbers = iter(range(2, 1000))
        some = ",".join(3 * ["true"] + 4 * ["false"])

        def is_behind() -> bool:
            seq = next(numbers)
            for key in keys[:3]:  # the others never come
                server.show_grey(key, seq, 50)
            return bool(tab.page.evaluate(f"{steps} === '{some}'"))

        wait_until(is_behind, poll_s=0.2)
        assert tab.page.evaluate(seqs)[3:] == ["1"] * 4


def test_a_picture_is_saved_as_sent_and_with_its_overlay_though_the_page_paints_no_more(
    opened: tuple[Tab, PageServer], tmp_path: Path
) -> None:
    tab, server = opened
    tab.open(CAMERA)
    server.wait_for(TRUTH)
    tab.page.evaluate("window.requestAnimationFrame = () => 1")
    for seq in (7, 8):
        sent = jpeg(np.full((48, 64, 3), 10 * seq, np.uint8))
        about = header(seq, CAMERA, encoding="bgr8")
        box = {"id": 1, "state": "confirmed", "x": 20, "y": 20, "box": [10, 10, 20, 20], "area": 9}
        server.tell("message", key=TRUTH, header=about, body={"tracks": [box]})
        server.show(CAMERA, sent, about, mime="image/jpeg")
        tab.wait(f"document.querySelector('#figure-frame').textContent === '{seq}'")
        found = {}
        for key, file in (("s", "frame.jpg"), ("Shift+S", "drawn.png")):
            with tab.page.expect_download() as download:
                tab.page.keyboard.press(key)
            assert download.value.suggested_filename.startswith(
                f"vision_front_image_compressed_1_{seq}."
            )
            download.value.save_as(tmp_path / file)
            found[file] = (tmp_path / file).read_bytes()
        saved = found["frame.jpg"]
        at = saved.index(b"\xff\xfe")
        length = int.from_bytes(saved[at + 2 : at + 4], "big")
        assert saved[:at] + saved[at + 2 + length :] == sent
        facts = json.loads(saved[at + 4 : at + 2 + length].removeprefix(b"vision.Header "))
        assert facts == {"key": CAMERA, **about}
        assert b"tEXtvision.Header\0" in found["drawn.png"]
        assert picture_size(found["drawn.png"]) == (64, 48)
        drawn = cv2.imread(str(tmp_path / "drawn.png"))
        assert abs(int(drawn[40, 50, 0]) - 10 * seq) <= 2
        assert drawn[20, 10].max() > 200  # the left side of the box


def test_all_can_be_done_with_keys_alone(opened: tuple[Tab, PageServer]) -> None:
    tab, server = opened
    open_parameters(tab, server)
    keys = tab.page.keyboard
    keys.press("e")
    assert tab.page.is_hidden("#dock")
    keys.press("?")
    assert tab.page.is_visible("#help")
    keys.press("Escape")
    assert not tab.page.is_visible("#help")
    for key, place in (("ArrowRight", CAMERA), ("ArrowRight", REAR), ("ArrowLeft", CAMERA)):
        keys.press(key)
        assert tab.page.evaluate(FOCUSED) == f"#{place}"
    assert tab.page.evaluate("document.activeElement.matches(':focus-visible')")
    keys.press("Enter")
    tab.wait("document.body.dataset.view === 'large'")
    tab.page.focus("#pause")
    for key, name in (("ArrowRight", "◂"), ("ArrowRight", "▸"), ("ArrowLeft", "◂")):
        keys.press(key)  # along the toolbar, and the picture stays
        assert tab.page.evaluate(FOCUSED) == name
    tab.page.focus("#pause")
    keys.press("ArrowLeft")  # to its end
    assert tab.page.evaluate("Boolean(document.activeElement.closest('[role=toolbar]'))")
    assert tab.page.evaluate(FOCUSED) != "Pause"
    keys.press("e")
    assert tab.page.is_visible("#panel-parameters")
    tab.page.focus(SLIDER)
    keys.press("ArrowRight")
    assert server.answer()["values"]["low"] > 40
    keys.press("Escape")
    assert not tab.page.is_visible("#dock")
    keys.press("Escape")
    assert tab.page.is_visible("#wall")
    assert tab.page.evaluate(FOCUSED) == f"#{CAMERA}"


def test_single_keys_can_be_switched_off_and_stay_off(opened: tuple[Tab, PageServer]) -> None:
    tab, _ = opened
    tab.open()
    tab.page.keyboard.press("h")
    tab.page.wait_for_selector("#panel-health:visible")
    tab.page.click("#help-button")
    tab.page.uncheck("#shortcuts")
    tab.page.click("#help button")
    tab.page.keyboard.press("p")
    tab.page.reload()
    tab.wait("document.querySelectorAll('.tile').length === 2")
    tab.page.keyboard.press("p")
    tab.page.keyboard.press("?")
    assert not tab.page.is_visible("#panel-plots")
    assert not tab.page.is_visible("#help")
