"""What one does with the page by mouse, keys and fingers has its effect."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.listening import Listener, open_client
from tests.support.processes import HEIGHT, WIDTH
from tests.support.typist import zv
from tests.support.viewer.browser import CAMERA, EDGES, Open, Running, Tab
from tests.support.waiting import wait_until
from zenoh_vision.image.codecs import picture_size

SIGMA = ".node-parameters[data-node=edge_front] .parameter[data-name=sigma]"
BRIGHT = """(() => {
    const canvas = document.querySelector("canvas.picture");
    const small = new OffscreenCanvas(320, 240).getContext("2d");
    small.drawImage(canvas, 0, 0, 320, 240);
    const { data } = small.getImageData(0, 0, 320, 240);
    let sum = 0;
    for (let at = 0; at < data.length; at += 4) sum += data[at];
    return sum;
})()"""


def test_a_slider_changes_the_edges_that_are_shown(open_tab: Open) -> None:
    tab = _with_parameters(open_tab, EDGES)
    _slide(tab, 0)  # no smoothing: noise makes many edges
    many = tab.wait(BRIGHT)
    _slide(tab, 1000)
    tab.wait(f"{BRIGHT} < {many} / 2")
    tab.page.click(f"{SIGMA} .reset")
    tab.wait(f"document.querySelector('{SIGMA}').dataset.value === '1.4'")


def test_one_click_shows_all_steps_of_the_same_frame_and_the_detectors_parameters(
    open_tab: Open,
) -> None:
    tab = open_tab(EDGES)
    tab.wait_until_live(EDGES)
    tab.page.click("#steps")
    frames = tab.wait(
        """(() => {
            const seen = [...document.querySelectorAll("canvas.picture")];
            const steps = [...document.querySelectorAll(".pane")].map((p) => p.dataset.step);
            if (seen.length !== 7 || steps.some((step) => step !== "true")) return null;
            return seen.map((canvas) => `${canvas.dataset.epoch} ${canvas.dataset.seq}`);
        })()"""
    )
    assert len(set(frames)) == 1, frames
    boxes = "[...document.querySelectorAll('canvas.overlay')].map((one) => one.drawn.marks.length)"
    drawn = tab.wait(f"({boxes})[0] && {boxes}")
    assert set(drawn[1:]) == {0}  # boxes would cover the small steps
    tab.page.wait_for_selector(".node-parameters[data-node=edge_front]")
    tab.page.wait_for_selector("#panel-parameters >> text=detector")


def test_a_change_by_another_appears(open_tab: Open, system: Running) -> None:
    tab = _with_parameters(open_tab, EDGES)
    _zv(system, "param", "set", "edge_front", "sigma=2.5")
    tab.wait(f"document.querySelector('{SIGMA} input[type=number]').value === '2.5'")
    _zv(system, "param", "set", "edge_front", "sigma=1.4")


def test_a_refusal_is_shown_until_a_value_is_right_and_the_control_goes_back(
    open_tab: Open,
) -> None:
    tab = _with_parameters(open_tab, EDGES)
    low = SIGMA.replace("sigma", "low")
    tab.page.fill(f"{low} input[type=number]", "500")
    tab.page.keyboard.press("Enter")
    refusal = f"document.querySelector('{low} .refusal')"
    words = tab.wait(f"{refusal}?.checkVisibility() && {refusal}.textContent")
    assert "low = 500 is above high = 100" in words
    assert tab.page.input_value(f"{low} input[type=number]") == "40"
    tab.page.fill(f"{low} input[type=number]", "41")
    tab.page.keyboard.press("Enter")
    tab.wait(f"document.querySelector('{low}').dataset.value === '41'")
    tab.wait(f"!{refusal}.checkVisibility()")
    tab.page.fill(f"{low} input[type=number]", "40")
    tab.page.keyboard.press("Enter")
    tab.wait(f"document.querySelector('{low}').dataset.value === '40'")


def test_a_text_that_is_being_typed_survives_a_change_by_another(
    open_tab: Open, system: Running
) -> None:
    tab = _with_parameters(open_tab, EDGES)
    low = SIGMA.replace("sigma", "low")
    tab.page.fill(f"{low} input[type=number]", "500")
    _zv(system, "param", "set", "edge_front", "low=45")
    tab.wait(f"document.querySelector('{low}').dataset.value === '45'")
    assert tab.page.input_value(f"{low} input[type=number]") == "500"
    tab.page.keyboard.press("Enter")  # refused, since it is above high
    tab.wait(f"document.querySelector('{low} input[type=number]').value === '45'")
    _zv(system, "param", "set", "edge_front", "low=40")


def test_parameters_are_saved_as_the_file_that_config_reads(open_tab: Open, tmp_path: Path) -> None:
    tab = _with_parameters(open_tab, EDGES)
    with tab.page.expect_download() as download:
        tab.page.click(".node-parameters[data-node=edge_front] >> text=Save as TOML")
    assert download.value.suggested_filename == "edge_front.toml"
    download.value.save_as(tmp_path / "edge.toml")
    assert "sigma = 1.4" in (tmp_path / "edge.toml").read_text()


def test_a_saved_picture_is_the_sent_one_with_its_header_in_it(
    open_tab: Open, system: Running, tmp_path: Path
) -> None:
    with open_client(system.router.endpoint) as session:
        sent = Listener(session, CAMERA)
        tab = open_tab(CAMERA)
        tab.wait_until_live(CAMERA)
        for _ in range(10):  # under load the frame may have reached the page and not this test
            with tab.page.expect_download() as download:
                tab.page.keyboard.press("s")
            download.value.save_as(tmp_path / "frame.jpg")
            saved = (tmp_path / "frame.jpg").read_bytes()
            at = saved.index(b"\xff\xfe")
            length = int.from_bytes(saved[at + 2 : at + 4], "big")
            facts = json.loads(saved[at + 4 : at + 2 + length].removeprefix(b"vision.Header "))
            wait_until(lambda seq=facts["seq"]: sent.wait_for(1)[-1].header["seq"] >= seq)
            found = [one for one in sent.messages if one.header["seq"] == facts["seq"]]
            if found:
                break
    assert saved[:at] + saved[at + 2 + length :] == found[0].payload
    assert facts["epoch"] == str(found[0].header["epoch"])
    assert picture_size(saved) == (WIDTH, HEIGHT)


def test_a_picture_is_saved_with_its_overlay_as_png(open_tab: Open, tmp_path: Path) -> None:
    tab = open_tab(CAMERA)
    tab.wait_until_live(CAMERA)
    with tab.page.expect_download() as download:
        tab.page.keyboard.press("Shift+S")
    download.value.save_as(tmp_path / "frame.png")
    saved = (tmp_path / "frame.png").read_bytes()
    assert b"tEXtvision.Header\0" in saved
    assert picture_size(saved) == (WIDTH, HEIGHT)


def test_a_frame_that_is_not_painted_yet_is_saved_too(open_tab: Open, tmp_path: Path) -> None:
    tab = open_tab(CAMERA)
    tab.wait_until_live(CAMERA)
    tab.page.evaluate("window.requestAnimationFrame = () => 1")  # the page paints no more
    number = "document.querySelector('#figure-frame').textContent"
    numbers: set[int] = set()
    while len(numbers) < 3:
        shown = tab.page.evaluate(number)
        with tab.page.expect_download() as download:
            tab.page.keyboard.press("Shift+S")
        name = download.value.suggested_filename
        numbers.add(int(name.split("_")[-1].partition(".")[0]))
        # Chromium drops, without a word, what is over ten downloads a second.
        tab.wait(f"{number} !== '{shown}'")


def test_a_pause_holds_the_frame_and_steps_go_to_its_neighbours(open_tab: Open) -> None:
    tab = open_tab(CAMERA)
    tab.wait_until_live(CAMERA)
    tab.wait("Number(document.querySelector('canvas.picture').dataset.seq) > 0")
    seq = "Number(document.querySelector('canvas.picture').dataset.seq)"
    first = tab.page.evaluate(seq)
    tab.wait(f"{seq} > {first} + 5")
    tab.page.keyboard.press("Space")
    assert tab.page.inner_text("#large-state") == "paused"
    held = tab.page.evaluate(seq)
    tab.page.keyboard.press(",")
    tab.wait(f"{seq} < {held}")
    tab.page.keyboard.press(".")
    tab.wait(f"{seq} === {held}")
    tab.page.keyboard.press("Space")
    tab.wait(f"{seq} > {held} + 2")


def test_zoom_and_pixel_value_under_the_pointer(open_tab: Open) -> None:
    tab = open_tab(EDGES)
    tab.wait_until_live(EDGES)
    tab.page.keyboard.press("1")
    tab.wait("document.querySelector('#zoom').textContent.startsWith('1')")
    pixel = (
        "document.querySelector('#pixel').textContent.match(/^(\\d+, \\d+) = (\\d+)$/)?.slice(1)"
    )

    def pointed_at() -> Any:
        tab.page.hover(".pane-surface")  # its middle, which moves where a button appears above it
        return tab.page.evaluate(pixel)

    place, value = wait_until(pointed_at, poll_s=0.1)
    assert value in {"0", "255"}
    x, y = place.split(", ")
    assert abs(int(x) - WIDTH / 2) <= 1
    assert abs(int(y) - HEIGHT / 2) <= 1
    tab.page.mouse.wheel(0, -300)
    tab.wait("parseFloat(document.querySelector('#zoom').textContent) > 1.2")
    tab.page.keyboard.press("0")
    tab.wait("document.querySelector('#fit').getAttribute('aria-pressed') === 'true'")


def test_all_can_be_done_with_keys_alone(open_tab: Open) -> None:
    tab = open_tab()
    tab.wait_until_live(CAMERA)
    keys = tab.page.keyboard
    keys.press("?")
    assert tab.page.is_visible("#help")
    keys.press("Escape")
    assert not tab.page.is_visible("#help")
    keys.press("ArrowRight")
    assert tab.page.evaluate("document.activeElement.getAttribute('href')") == f"#{CAMERA}"
    assert tab.page.evaluate("document.activeElement.matches(':focus-visible')")
    keys.press("ArrowRight")
    keys.press("ArrowLeft")
    keys.press("Enter")
    tab.wait_until_live(CAMERA)
    keys.press("e")
    assert tab.page.is_visible("#panel-parameters")
    tab.page.focus(f"{SIGMA} input[type=range]")
    before = tab.page.input_value(f"{SIGMA} input[type=number]")
    keys.press("ArrowRight")
    tab.wait(f"document.querySelector('{SIGMA}').dataset.value !== '{before}'")
    keys.press("Escape")
    assert not tab.page.is_visible("#dock")
    keys.press("Escape")
    assert tab.page.is_visible("#wall")
    assert tab.page.evaluate("document.activeElement.getAttribute('href')") == f"#{CAMERA}"


@pytest.mark.parametrize("place", ["", CAMERA], ids=["wall", "large"])
def test_on_a_phone_nothing_is_wider_than_the_screen(open_tab: Open, place: str) -> None:
    phone = {"width": 390, "height": 844}
    tab = open_tab(place, viewport=phone, has_touch=True, is_mobile=True, device_scale_factor=3)
    tab.wait_until_live(CAMERA)
    _check_fits(tab)
    for menu in ("adjust", "transfer") if place else ("layout",):
        tab.page.tap(f"[popovertarget={menu}-menu] >> visible=true")
        assert tab.page.is_visible(f"#{menu}-menu")
        _check_fits(tab)
        tab.page.keyboard.press("Escape")
        assert tab.page.is_hidden(f"#{menu}-menu")
    for panel in ("parameters", "plots", "graph", "events", "health", "log"):
        tab.page.tap(f"#panels [data-panel={panel}]")
        assert tab.page.is_visible(f"#panel-{panel}")
        _check_fits(tab)


def _check_fits(tab: Tab) -> None:
    """Check that the page is no wider than a phone, and that a finger meets its controls."""
    assert tab.page.evaluate("document.documentElement.scrollWidth") <= 390
    small = tab.page.evaluate(
        """[...document.querySelectorAll("button, summary, select, input, .back")]
            .filter((one) => one.checkVisibility() && one.type !== "checkbox"
                && !one.closest("#top, #dock-close"))
            .map((one) => [one.outerHTML.slice(0, 80), one.getBoundingClientRect().height])
            .filter(([, height]) => height < 34)"""
    )
    assert small == []


def _with_parameters(open_tab: Open, place: str) -> Tab:
    tab = open_tab(place)
    tab.wait_until_live(place)
    tab.page.keyboard.press("e")
    tab.page.wait_for_selector(SIGMA)
    return tab


def _slide(tab: Tab, place: int) -> None:
    tab.page.fill(f"{SIGMA} input[type=range]", str(place))
    value = tab.page.input_value(f"{SIGMA} input[type=number]")
    tab.wait(f"document.querySelector('{SIGMA}').dataset.value === '{value}'")


def _zv(system: Running, *arguments: str) -> None:
    assert zv(system.router.endpoint, *arguments).returncode == 0
