"""Several cameras in the large view: each with its own newest frame, all paused at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.viewer.browser import CAMERA, SEEN, Running, Tab
from tests.support.viewer.page_server import NOW_NS, PageServer, served_page, stream
from tests.support.waiting import wait_until

SERVICES = ()
"""A viewer alone: of it the pages come, and from the test what they are told."""


REAR = "vision/rear/image/compressed"
SEQS = "[...document.querySelectorAll('canvas.picture')].map((one) => one.dataset.seq).join()"
LIVE = "[...document.querySelectorAll('canvas.picture')].map((one) => one.dataset.live).join()"


@pytest.fixture
def beside(browser: Any, system: Running) -> Iterator[tuple[Tab, PageServer]]:
    """Two cameras side by side."""
    with served_page(browser, system.address, stream(CAMERA), stream(REAR)) as (tab, server):
        tab.open(f"{CAMERA}+{REAR}")
        server.wait_for(REAR)
        yield tab, server


def test_two_cameras_are_shown_each_with_its_newest_frame_and_none_waits_for_the_other(
    beside: tuple[Tab, PageServer],
) -> None:
    tab, server = beside
    for seq in range(40):  # the other is slow, smaller, and of another epoch
        server.show_grey(CAMERA, seq, 50 + seq)
        if seq % 10 == 0:
            server.show_grey(REAR, seq // 10, 150 + seq, epoch="7", width=32, height=32)
            tab.wait(f"{SEQS} === '{seq},{seq // 10}'")
    tab.wait_for_red(CAMERA, 30, 20, 89)
    tab.wait_for_red(REAR, 30, 20, 180)
    assert tab.page.inner_text(".pane >> nth=1 >> figcaption") == "rear / image"
    numbers = iter(range(4, 1000))

    def only_the_other_is_live() -> bool:
        server.show_grey(REAR, next(numbers), 99, epoch="7", width=32, height=32)
        return bool(tab.page.evaluate(f"{LIVE} === 'false,true'"))

    wait_until(only_the_other_is_live, poll_s=0.1)
    tab.wait_for_red(REAR, 30, 20, 99)
    assert "no picture" in tab.page.inner_text(".pane >> nth=0 >> .pane-state")


def test_the_other_camera_is_chosen_in_the_menu_and_zooms_with_the_first(
    browser: Any, system: Running
) -> None:
    streams = stream(CAMERA), stream(REAR), stream("vision/rear/mask/compressed")
    with served_page(browser, system.address, *streams) as (tab, server):
        tab.open(CAMERA)
        tab.page.click("[popovertarget=beside-menu]")
        menu = "#beside-menu label"
        assert tab.page.locator(menu).all_inner_texts() == ["image", "rear / image"]
        tab.page.click(f"{menu} >> nth=1")
        tab.wait(f"location.hash === '#{CAMERA}+{REAR}'")
        server.wait_for(REAR)
        server.show_grey(CAMERA, 1, 50)
        tab.wait_for_red(CAMERA, 32, 24, 50)
        tab.page.keyboard.press("Escape")
        tab.page.dblclick(f".pane[data-key='{REAR}'] .pane-surface")  # where there is no picture
        tab.wait("document.querySelector('#actual').getAttribute('aria-pressed') === 'true'")
        tab.page.keyboard.press("0")
        server.show_grey(REAR, 1, 150, width=128, height=96)
        tab.wait_for_red(REAR, 64, 48, 150)
        views = "[...document.querySelectorAll('canvas.overlay')].map(({ view }) => view)"
        tab.page.evaluate("document.activeElement.blur()")  # on a toolbar, arrows move along it
        tab.page.keyboard.press("+")
        tab.page.keyboard.press("ArrowLeft")
        first, second = tab.wait(f"{views}[0].x !== 32 && {views}")
        assert first["scale"] == pytest.approx(2 * second["scale"])
        assert [second["x"], second["y"]] == pytest.approx([2 * first["x"], 2 * first["y"]])
        tab.page.keyboard.press("0")
        tab.wait(f"{views}[0].x === 32 && {views}[1].x === 64")
        tab.page.mouse.dblclick(*tab.place(REAR, 96.5, 24.5))  # its pixel, one to one in both
        first, second = tab.wait(f"{views}.every((one) => one.scale === 1) && {views}")
        assert [second["x"], second["y"]] == pytest.approx([2 * first["x"], 2 * first["y"]])
        assert abs(second["x"] - 96.5) <= 1
        assert abs(second["y"] - 24.5) <= 1
        tab.page.mouse.wheel(0, -300)
        tab.wait(f"{views}[0].scale > 1.2")
        tab.page.keyboard.press("1")
        tab.wait(f"{views}.every((one) => one.scale === 1)")


def test_a_stream_of_the_camera_with_an_epoch_of_its_own_is_shown_apart(
    browser: Any, system: Running
) -> None:
    mine = "vision/front/mine/compressed"
    with served_page(browser, system.address, stream(CAMERA), stream(mine)) as (tab, server):
        tab.open(f"{CAMERA}+{mine}")
        server.wait_for(mine)
        numbers = iter(range(1000))

        def is_shown() -> bool:
            seq = next(numbers)
            server.show_grey(CAMERA, seq, 50)
            server.show_grey(mine, seq, 150, epoch="of its own")
            return bool((tab.page.evaluate(SEEN, [mine, 30, 20]) or {}).get("red") == 150)

        wait_until(is_shown, poll_s=0.05)


def stamp(ms: float) -> str:
    return str(NOW_NS + round(ms * 1e6))


def test_a_pause_shows_both_at_the_same_instant_and_how_far_they_are_apart(
    beside: tuple[Tab, PageServer],
) -> None:
    tab, server = beside
    apart = "[...document.querySelectorAll('.pane-apart')].map((one) => one.textContent).join()"
    for seq in range(3):
        server.show_grey(REAR, seq + 10, 150, stamp_ns=stamp(100 * seq - 12.4))
        server.show_grey(CAMERA, seq, 50, stamp_ns=stamp(100 * seq))
        tab.wait(f"{SEQS} === '{seq},{seq + 10}'")
    # One more of the other, which has no frame beside it yet.
    server.show_grey(REAR, 13, 150, stamp_ns=stamp(300 - 12.4))
    tab.wait(f"{SEQS} === '2,13'")
    assert tab.page.evaluate(apart) == ","
    tab.page.keyboard.press("Space")
    tab.wait(f"{SEQS} === '2,12'")
    tab.wait(f"{apart} === ',\\u221212.4 ms'")
    tab.page.keyboard.press("Space")
    tab.wait(f"{apart} === ','")


def test_while_paused_nothing_is_sent_and_a_step_gets_one_frame(
    beside: tuple[Tab, PageServer],
) -> None:
    tab, server = beside
    for seq in range(3):
        server.show_grey(CAMERA, seq, 50, stamp_ns=stamp(100 * seq))
        server.show_grey(REAR, seq + 10, 150, stamp_ns=stamp(100 * seq + 9))
        tab.wait(f"{SEQS} === '{seq},{seq + 10}'")
    tab.page.keyboard.press("Space")
    assert tab.page.inner_text("#large-state") == "paused"
    for key in (CAMERA, REAR):
        server.wait_for(key, watched=False)
    tab.page.keyboard.press(",")
    tab.wait(f"{SEQS} === '1,11'")
    tab.page.keyboard.press(".")
    tab.wait(f"{SEQS} === '2,12'")
    tab.page.keyboard.press(".")
    for key, seq in ((CAMERA, 7), (REAR, 17)):
        server.wait_for(key)
        server.show_grey(key, seq, 99)
        server.wait_for(key, watched=False)
    tab.wait(f"{SEQS} === '7,17'")
    tab.page.keyboard.press("Space")
    for key in (CAMERA, REAR):
        server.wait_for(key)
