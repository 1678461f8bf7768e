"""The panel of the events that the viewer keeps: chosen, opened, there when a page is opened."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.listening import open_client, wait_for_nodes
from tests.support.viewer.browser import Open, Running, Tab, running
from tests.support.viewer.client import Viewer
from tests.support.viewer.event_camera import Camera, event_camera
from tests.support.waiting import wait_until

GRAVE = ("serious", "critical")
ROWS = "[...document.querySelectorAll('#event-lines button')].map((one) => one.innerText)"
DIALOG = "document.querySelector('#event-dialog[open]')"


@pytest.fixture(scope="module")
def system(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    folder = tmp_path_factory.mktemp("system")
    with running(folder, "--events-dir", folder / "events") as found:
        yield found


@pytest.fixture(scope="module")
def camera(system: Running) -> Iterator[Camera]:
    """One of which two events are kept, and then one of another, which has no pictures."""
    viewer = Viewer(system.viewer)
    with open_client(system.router.endpoint) as client, event_camera(client) as found:
        wait_for_nodes(client, "viewer")
        found.seq = 3
        events: tuple[dict[str, Any], ...] = (
            {"seq": 1, "kind": "zone_entered"},
            {"seq": 3, "kind": "line_crossed", "zone": "<b>gate</b>", "direction": "left"},
            {"seq": 4, "kind": "zone_entered", "camera": "rear"},
        )
        for count, event in enumerate(events, 1):
            wait_until(
                lambda count=count, event=event: (
                    found.publish(**event)
                    or len(json.loads(viewer.get("/events").text)["events"]) == count
                ),
                poll_s=0.5,
            )
        yield found


def shown(tab: Tab, count: int) -> list[str]:
    """Return the rows, once there are as many."""
    tab.wait(f"{ROWS}.length === {count}")
    found: list[str] = tab.page.evaluate(ROWS)
    return found


def test_events_that_came_before_the_page_and_new_ones_are_found_chosen_and_opened(
    camera: Camera, open_tab: Open
) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    tab = open_tab("?panel=events", bypass_csp=True)
    entered, crossed, rear = shown(tab, 3)[:3]
    assert "front" in entered
    assert "zone entered 13, belt, at 25, 40" in entered
    assert "line crossed 13, <b>gate</b>, left" in crossed
    assert "rear" in rear
    loaded = "[...document.querySelectorAll('#event-lines img')].map((one) => one.naturalWidth)"
    tab.wait(f"String({loaded}) === '320,320'")  # of the rear camera there is none

    tab.page.select_option("#event-kind", "zone_entered")
    shown(tab, 2)
    tab.page.select_option("#event-camera", "front")
    assert shown(tab, 1) == [entered]
    assert tab.page.get_attribute("#event-table", "href") == (
        "events.csv?camera=front&kind=zone_entered"
    )
    tab.page.fill("#event-until", "2020-01-01T00:00")
    shown(tab, 0)
    tab.page.fill("#event-until", "")
    shown(tab, 1)

    found = axe.run(tab.page, context="#panel-events").response["violations"]
    tab.page.click("#event-lines button")
    tab.wait(f"{DIALOG} !== null")
    box = tab.page.evaluate(
        f"['x', 'y', 'width', 'height'].map((one) => {DIALOG}.querySelector('rect')"
        ".getAttribute(one)).join()"
    )
    assert box == "10,20,30,40"
    assert tab.page.get_attribute("#event-view", "viewBox") == "0 0 640 480"
    assert "picture 2 frames later" in tab.page.inner_text("#event-about")
    assert tab.page.inner_text("#event-title") == "front: zone entered 13, belt, at 25, 40"
    found += axe.run(tab.page, context="#event-dialog").response["violations"]
    assert [each["id"] for each in found if each["impact"] in GRAVE] == []
    tab.page.keyboard.press("Escape")
    tab.wait(f"{DIALOG} === null")
    assert tab.page.is_visible("#panel-events")  # the key was for the picture

    tab.page.select_option("#event-camera", "")
    tab.page.select_option("#event-kind", "")
    tab.page.select_option("#event-zone", "belt")
    shown(tab, 2)
    camera.publish(9, "zone_dwell")
    assert "zone dwell 13" in shown(tab, 3)[-1]
    tab.page.reload()
    assert "zone dwell 13" in shown(tab, 4)[-1]
    assert tab.complaints == []
