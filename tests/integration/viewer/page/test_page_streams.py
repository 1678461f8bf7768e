"""The page shows what is there, moving, and nothing that is gone as if it were there."""

from __future__ import annotations

import os
import signal

from tests.support.listening import open_client
from tests.support.processes import WIDTH, Program
from tests.support.publishing import Paced, raw_frames
from tests.support.routing import free_port
from tests.support.viewer.browser import CAMERA, EDGES, MASK, Open, Running, Tab
from tests.support.waiting import wait_until


def test_every_stream_has_a_tile_that_moves(open_tab: Open) -> None:
    tab = open_tab()
    for key in (CAMERA, MASK, EDGES):
        tab.wait_until_live(key)
    before = tab.pixels(CAMERA)
    _wait_for_other_pixels(tab, CAMERA, before)


def test_a_camera_of_another_program_that_sends_only_raw_pixels_has_a_tile(
    open_tab: Open, system: Running
) -> None:
    tab = open_tab()
    tab.wait_until_live(CAMERA)
    with open_client(system.router.endpoint) as session:
        raw = session.declare_publisher("vision/r1/image")
        with Paced(10, raw_frames(raw)):
            tab.wait_until_live("vision/r1/image")


def test_a_camera_whose_name_is_none_is_named_with_the_rule(
    open_tab: Open, system: Running
) -> None:
    tab = open_tab()
    tab.wait_until_live(CAMERA)
    assert not tab.page.is_visible("#wall-misnamed")
    with open_client(system.router.endpoint) as session:
        keys = [f"vision/{camera}/image/compressed" for camera in ("cam-1", "Front")]
        publishers = [session.declare_publisher(key) for key in keys]
        tab.page.wait_for_selector("#wall-misnamed:visible")
        wait_until(lambda: "Front, cam-1" in tab.page.inner_text("#wall-misnamed"))
        assert "only letters a-z, digits and _" in tab.page.inner_text("#wall-misnamed")
        for publisher in publishers:
            publisher.undeclare()
    tab.page.wait_for_selector("#wall-misnamed", state="hidden")


def test_one_stream_large_moves_and_is_as_it_came(open_tab: Open) -> None:
    tab = open_tab(CAMERA)
    tab.wait_until_live(CAMERA)
    before = tab.pixels(CAMERA)
    _wait_for_other_pixels(tab, CAMERA, before)
    assert tab.page.inner_text("#figure-size").startswith(f"{WIDTH}")
    assert tab.page.inner_text("#large-state") == "live"


def test_an_address_that_is_no_text_shows_the_wall(open_tab: Open) -> None:
    tab = open_tab("%")
    tab.wait_until_live(CAMERA)
    assert tab.page.is_visible("#wall")
    assert tab.complaints == []


def test_a_deep_link_shows_several_streams_of_the_same_frame(open_tab: Open) -> None:
    tab = open_tab(f"{CAMERA}+{MASK}+{EDGES}")
    for _ in range(5):
        frames = tab.wait(
            """(() => {
                const seen = [...document.querySelectorAll("canvas.picture")];
                const steps = [...document.querySelectorAll(".pane")].map((p) => p.dataset.step);
                if (seen.length !== 3 || steps.some((step) => step !== "true")) return null;
                return seen.map((canvas) => `${canvas.dataset.epoch} ${canvas.dataset.seq}`);
            })()"""
        )
        assert len(set(frames)) == 1, frames
        tab.wait(
            f"document.querySelector('canvas.picture').dataset.seq !== '{frames[0].split()[1]}'"
        )


def test_a_camera_that_is_stopped_and_started_is_greyed_and_comes_back(
    open_tab: Open, system: Running
) -> None:
    camera = system.service("camera", "--camera", "side")
    tab = open_tab()
    side = "vision/side/image/compressed"
    tab.wait_until_live(side)
    camera.process.kill()
    tile = f".tile[data-key='{side}']"
    tab.wait(f"document.querySelector(\"{tile}\").dataset.state === 'stopped'")
    assert "since" in tab.wait(f'document.querySelector("{tile} .tile-state").textContent')
    assert tab.page.get_attribute(f"{tile} canvas", "data-live") == "false"
    system.service("camera", "--camera", "side")
    tab.wait_until_live(side)


def test_without_its_viewer_nothing_is_live_until_there_is_one_again(
    open_tab: Open, system: Running
) -> None:
    port = free_port()
    viewer, tab = _with_viewer_of_its_own(open_tab, system, port)
    viewer.process.kill()
    tab.wait("document.querySelector('canvas.picture').dataset.live === 'false'")
    tab.wait("document.querySelector('.pane-state').textContent.includes('not connected')")
    tab.wait("document.querySelector('#link').dataset.state === 'down'")
    system.service("view", "--port", port)
    tab.wait_until_live(CAMERA)
    tab.wait("!document.querySelector('#banner').checkVisibility()")


def test_a_viewer_that_freezes_is_given_up_and_found_again_when_it_thaws(
    open_tab: Open, system: Running
) -> None:
    viewer, tab = _with_viewer_of_its_own(open_tab, system)
    os.kill(viewer.process.pid, signal.SIGSTOP)
    tab.wait("document.querySelector('canvas.picture').dataset.live === 'false'")
    tab.wait("document.querySelector('#link').dataset.state === 'down'")
    os.kill(viewer.process.pid, signal.SIGCONT)
    # The viewer has to find its router again, and Chromium delays attempts after failed ones.
    tab.wait("document.querySelector('canvas.picture').dataset.live === 'true'")


def test_the_page_complains_of_nothing_and_asks_no_other_host(
    open_tab: Open, system: Running
) -> None:
    tab = open_tab()
    tab.wait_until_live(CAMERA)
    for panel in ("parameters", "plots", "graph", "events", "health", "log"):
        tab.page.click(f"#panels [data-panel={panel}]")
        assert tab.page.is_visible(f"#panel-{panel}")
    tab.page.click(f".tile[data-key='{CAMERA}'] a")
    tab.wait_until_live(CAMERA)
    assert tab.complaints == []
    assert tab.hosts == {system.address.split("/")[2]}


def _wait_for_other_pixels(tab: Tab, key: str, before: list[int]) -> None:
    def moved() -> bool:
        return max(abs(a - b) for a, b in zip(before, tab.pixels(key), strict=True)) > 20

    wait_until(moved)


def _with_viewer_of_its_own(open_tab: Open, system: Running, port: int = 0) -> tuple[Program, Tab]:
    viewer = system.service("view", "--port", port)
    tab = open_tab()
    tab.address = viewer.lines(r"http://\S+")[0][0]
    tab.open(CAMERA).wait_until_live(CAMERA)
    return viewer, tab
