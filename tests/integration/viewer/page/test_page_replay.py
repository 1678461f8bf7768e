"""``zv view run.mcap``: a recording in the page, with a time line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgpack
import pytest

from tests.support.fork_server import ZV
from tests.support.processes import Program
from tests.support.recordings import frames, write
from tests.support.viewer.browser import CAMERA, Running, Tab, tab
from tests.support.viewer.page_server import PageServer, header, served_page, stream
from tests.support.waiting import wait_until
from zv.bag.record import Record

SERVICES = ()
"""A viewer alone: of it the page comes that is told what a player says."""

FRAMES = frames(90)
REPLAY = "vision/player/replay"


def event_at(frame: Record) -> Record:
    header = {**frame.header, "node": "tracker_front"}
    fields = {"header": header, "event": "line_crossed", "id": 1, "zone": "gate"}
    return replace(
        frame,
        key="vision/front/events",
        payload=msgpack.packb({**fields, "direction": "left", "x": 1.0, "y": 2.0}),
        encoding="application/msgpack;vision.TrackEvent.v1",
        attachment=msgpack.packb(header),
    )


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Iterator[Tab]:
    """The page of a viewer that plays a recording of 3 s with an event at 2 s."""
    run = write(tmp_path / "run.mcap", FRAMES, [event_at(FRAMES[60])])
    with Program(["view", run, "--port", "0"], tmp_path, "view", forked=ZV) as viewer:
        address = viewer.lines(r"http://\S+")[0][0]
        with tab(browser, address) as shown:
            yield shown.open()
        assert viewer.interrupt() == 0


def at_s(page: Tab) -> float:
    text = page.page.text_content("#replay-time").split(" / ")[0]
    minutes, seconds = text.split(":")
    return 60 * float(minutes) + float(seconds)


def test_a_recording_is_shown_with_its_events_and_controlled(page: Tab):
    page.wait("!document.getElementById('replay').hidden")
    page.wait_until_live(CAMERA)
    place = page.wait("document.querySelector('#replay-marks i')?.style.left")
    assert float(place.removesuffix("%")) == pytest.approx(100 * 2 / 2.967, abs=1)
    # It stays at the end, paused.
    page.wait("document.getElementById('replay-play').textContent === 'Play'")
    assert at_s(page) == pytest.approx(3.0, abs=0.1)
    page.page.click("#replay-marks i")  # to the second before the event
    wait_until(lambda: at_s(page) == pytest.approx(1.0, abs=0.1), explain=lambda: page.text)
    for _ in range(3):  # a frame is 33 ms, and tenths are shown
        page.page.click("#replay-step")
    wait_until(lambda: at_s(page) == pytest.approx(1.1, abs=0.06), explain=lambda: page.text)
    page.page.select_option("#replay-speed", "0.25")
    page.page.click("#replay-play")
    wait_until(lambda: 1.2 < at_s(page) < 2.9, explain=lambda: page.text)
    assert not page.complaints


@pytest.fixture
def told(browser: Any, system: Running) -> Iterator[tuple[Tab, PageServer]]:
    """The wall, as a page that a test tells what a player says."""
    with served_page(browser, system.address, stream(REPLAY, "vision.Replay.v1")) as (page, server):
        page.open()
        server.wait_for(REPLAY)
        yield page, server


def tell(server: PageServer, **state: object) -> None:
    """Say where a player is."""
    usual = {"node": "player", "paused": True, "speed": 1, "loop": False, "step": 0, "marks": []}
    place = {"length_s": 4.0, "position_s": 1.0, "file": "run.mcap"}
    server.tell("message", key=REPLAY, header=header(1, REPLAY), body=usual | place | state)


def test_a_speed_that_a_player_was_given_by_another_is_offered_once(told: Any):
    page, server = told
    choices = "[...document.getElementById('replay-speed').options].map((one) => one.value)"
    for speed in (3, 1, 3, 0):
        tell(server, speed=speed)
        page.wait(f"document.getElementById('replay-speed').value === '{speed}'")
    usual = ["0.1", "0.25", "0.5", "1", "2", "4", "8"]
    assert page.page.evaluate(choices) == [*usual, "3", "0"]


def test_events_of_another_recording_as_long_as_the_one_before_are_shown(told: Any):
    page, server = told
    places = "[...document.querySelectorAll('#replay-marks i')].map((one) => one.style.left).join()"
    for file, moments, shown in (("a", (1, 2), "25%,50%"), ("b", (0, 3), "0%,75%")):
        tell(server, file=file, marks=[{"at_s": at, "event": "entered"} for at in moments])
        page.wait(f"document.getElementById('replay-file').textContent === '{file}'")
        assert page.page.evaluate(places) == shown
