"""What the panels do with all that a server says: how much they keep, and when it was."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest

from tests.support.viewer.browser import Running, Tab
from tests.support.viewer.page_server import NOW_NS, PageServer, served_page, stream
from tests.support.waiting import wait_until

SERVICES = ()
"""A viewer alone: of it the pages come, and from the test what they are told."""


CENTROID = "vision/front/centroid"
LINES = 1000
MINUTE_NS = 60 * 10**9
SLACK_S = 25
"""How long a busy machine may take for a test; what is compared is two minutes apart."""

# A clock that can be put forward; and the plots by the elements that they are in.
KEEP_PLOTS = """
    const now = performance.now.bind(performance);
    performance.now = () => now() + (window.passed ?? 0);
    let made;
    Object.defineProperty(window, "uPlot", { get: () => made, set: (Plot) => {
        made = Object.assign(function (options, data, place) {
            return place.plot = new Plot(options, data, place);
        }, Plot);
    } });
"""

# The plot of a title.
PLOT = """(title => [...document.querySelectorAll(".plot")]
    .find((one) => one.querySelector("h3").firstChild.data === title)?.querySelector("div").plot)"""

LABELS = (".legend", "small:last-child")

# How many seconds before now the first line of a plot is seen, one number for each column.
AGES = f"""(title => {{
    const plot = {PLOT}(title);
    const {{ canvas }} = plot.ctx;
    const colour = document.createElement("canvas").getContext("2d");
    colour.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--series-1");
    colour.fillRect(0, 0, 1, 1);
    const wanted = colour.getImageData(0, 0, 1, 1).data;
    const {{ width, height }} = canvas;
    const from = plot.bbox.top + 8; // below the marks of events
    const copy = new OffscreenCanvas(width, height).getContext("2d");
    copy.drawImage(canvas, 0, 0);
    const {{ data }} = copy.getImageData(0, 0, width, height);
    const isLine = (at) => data[at + 3] > 120
        && [0, 1, 2].every((part) => Math.abs(data[at + part] - wanted[part]) < 40);
    const columns = [...Array(width).keys()].filter((x) =>
        [...Array(height).keys()].slice(from, from + plot.bbox.height).some((y) =>
            isLine(4 * (y * width + x))));
    return columns.map((x) => (plot.scales.x.max - plot.posToVal(x, "x", true)) / 1000);
}})"""


@pytest.fixture
def opened(browser: Any, system: Running) -> Iterator[tuple[Tab, PageServer]]:
    """The page, and who talks to it."""
    centroid = stream(CENTROID, "vision.Centroid.v1")
    with served_page(browser, system.address, centroid) as (found, server):
        found.page.add_init_script(KEEP_PLOTS)
        found.open()
        found.wait("document.querySelector('#link').dataset.state === 'up'")
        yield found, server


def test_the_log_keeps_the_last_1000_lines_whether_it_was_open_or_not(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    tab.page.keyboard.press("l")
    for number in range(LINES + 100):
        at_ns = str(NOW_NS + number * 10**6)
        server.tell("log", at_ns=at_ns, level="INFO", node="", text=f"line {number}")
    texts = "[...document.querySelectorAll('#log-lines li')].map((one) => one.lastChild.data)"
    last = f"line {LINES + 99}"
    tab.wait(f"{texts}.at(-1) === '{last}'")
    kept = [f"line {number}" for number in range(100, LINES + 100)]
    assert tab.page.evaluate(texts) == kept
    from_end = "(({ scrollHeight: all, scrollTop: top, clientHeight: seen }) => all - top - seen)"
    assert tab.page.evaluate(f"{from_end}(document.querySelector('#log-lines'))") < 2
    tab.page.keyboard.press("l")
    server.tell("log", at_ns=str(NOW_NS), level="INFO", node="", text="unseen")
    tab.page.keyboard.press("l")
    tab.wait(f"{texts}.at(-1) === 'unseen'")
    assert tab.page.evaluate(texts) == [*kept[1:], "unseen"]
    assert tab.page.evaluate(f"{from_end}(document.querySelector('#log-lines'))") < 2


def test_a_plot_shows_what_is_under_the_pointer_zooms_and_keeps_half_an_hour(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    events = "vision/front/events"
    about = {CENTROID: "vision.Centroid.v1", events: "vision.TrackEvent.v1"}
    server.tell("streams", streams=[stream(key, type_) for key, type_ in about.items()])
    tab.page.keyboard.press("p")
    wait_until(lambda: server.hear() and server.watches(events))
    wait_until(lambda: server.watches(CENTROID))
    _tell_centroids(server)
    crossed = {"event": "line_crossed", "id": 7, "zone": "gate", "direction": "in"}
    server.tell("message", key=events, header=None, body=crossed)
    plot = f"{PLOT}('Centroid x')"
    section = f"{plot}.root.closest('.plot')"
    legend, moment = (f"{section}.querySelector('{part}').textContent" for part in LABELS)
    tab.wait(f"{legend} === 'x 400'")
    span = f"({plot}.scales.x.max - {plot}.scales.x.min)"
    assert abs(tab.page.evaluate(span) - 300_000) < 1

    left, top, width = tab.page.evaluate(
        f"(({{ left, top, width }}) => [left, top, width])({plot}.over.getBoundingClientRect())"
    )
    newest = f"{plot}.valToPos({plot}.data[0].at(-1), 'x')"
    tab.wait(f"{newest} < {width - 3}")
    tab.page.mouse.move(left + 0.8 * width, top + 20)
    tab.page.mouse.down()
    tab.page.mouse.move(left + width - 1, top + 20, steps=3)
    tab.page.mouse.up()
    tab.wait(f"Math.abs({span} - 60_000) < 2000")
    tab.page.mouse.move(left + tab.page.evaluate(newest), top + 30)
    tab.wait(f"/^x [14]00line crossed 7, gate, in$/.test({legend})")
    assert tab.page.evaluate(f"/^\\d\\d:\\d\\d:\\d\\d$/.test({moment})")
    others = "[...document.querySelectorAll('.plot h3')].map((one) => one.lastChild.textContent)"
    moments = set(tab.page.evaluate(others)) - {""}  # of plots that have any data
    assert len(moments) == 1
    tab.page.mouse.move(left + 5, top + 30)  # where nothing came
    tab.wait(f"{legend} === 'x \u2013'")

    tab.page.click("#plot-newest")
    tab.wait(f"Math.abs({span} - 300_000) < 1 && document.querySelector('#plot-newest').disabled")
    tab.page.evaluate("window.passed = 600_000")
    tab.wait(f"{legend} === 'x 400' && {moment}.startsWith('newest value 10 min')")
    assert tab.page.evaluate(f"{AGES}('Centroid x')") == []
    tab.page.select_option("#plot-span", "30")
    tab.wait(f"{AGES}('Centroid x').some((age) => Math.abs(age - 600) < {SLACK_S})")


def test_closed_panels_and_a_hidden_page_ask_for_nothing_and_draw_nothing(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    number = {"node": "edge_front", "name": "low", "type": "float", "value": 1.0, "default": 1.0}
    about = {"minimum": 0, "maximum": 9, "choices": None, "unit": "", "description": ""}
    controls = "document.querySelectorAll('#parameters .parameter').length"

    def shown() -> list[str]:
        server.hear()
        return [one["kinds"] for one in server.asked if one["op"] == "show"][-1]

    wait_until(lambda: shown() == ["health"])
    server.tell("nodes", nodes=[{"node": "edge_front", "alive": True, "cameras": ["front"]}])
    server.tell("parameters", node="edge_front", parameters=[number | about])
    server.tell("log", at_ns=str(NOW_NS), level="INFO", node="", text="all is told")
    for key, kind in (("g", "matches"), ("l", "log"), ("e", "parameters")):
        assert tab.page.evaluate(controls) == 0
        tab.page.keyboard.press(key)
        wait_until(lambda kind=kind: shown() == ["health", kind])
    tab.wait(f"{controls} === 1")
    tab.page.keyboard.press("p")
    wait_until(lambda: shown() == ["health"] and server.watches(CENTROID))
    _hide(tab, True)
    wait_until(lambda: shown() == [])
    wait_until(lambda: server.hear() and server.asked[-1]["op"] == "unwatch")
    drawn = "(window.drawn ??= [], window.drawn.length)"
    tab.page.evaluate(
        """() => {
            window.drawn = [];
            const clear = CanvasRenderingContext2D.prototype.clearRect;
            CanvasRenderingContext2D.prototype.clearRect = function (...given) {
                window.drawn.push(this.canvas.className);
                clear.apply(this, given);
            };
        }"""
    )
    server.tell("nodes", nodes=[{"node": "edge_front", "alive": True, "cameras": ["rear"]}])
    tab.page.evaluate("new Promise((done) => setTimeout(done, 1500))")  # three drawings
    assert tab.page.evaluate(drawn) == 0
    _hide(tab, False)
    wait_until(lambda: shown() == ["health"])
    tab.wait(drawn)


def test_the_health_of_a_camera_has_names_for_its_values_and_says_how_far_its_source_is_behind(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    node = {"node": "camera_front", "service": "camera", "version": "1", "host": "a", "pid": 7}
    server.tell("nodes", nodes=[node | {"alive": True, "cameras": ["front"]}])
    known = {"level": 0, "message": "ok", "uptime_s": 9.0, "counters": {}, "rate_hz": 30.0}
    known |= {"latency_ms": {"p50": 1.0, "p99": 2.0}}
    about = "document.querySelector('#health .about')?.textContent"
    tab.page.keyboard.press("h")

    def tell(**fields: object) -> None:
        diagnostics = known | fields
        at_ns, name = str(NOW_NS), "camera_front"
        server.tell("health", node=name, diagnostics=diagnostics, lost="0", at_ns=at_ns)

    tell(source_lag_ms=41.5)
    tab.wait(f"{about}?.endsWith(', its source is 42 ms behind the capture')")
    row = tab.page.text_content("#health details[data-node=camera_front] summary")
    assert row == "camera_frontlevel OKrate 30.0 Hzp50 1p99 2lost 0"
    tell()
    tab.wait(f"!{about}.includes('behind')")


def test_a_number_of_an_unknown_message_is_plotted_and_an_event_is_listed(
    opened: tuple[Tab, PageServer],
) -> None:
    tab, server = opened
    keys = {"brightness": "my.Brightness.v1", "events": "vision.TrackEvent.v1"}
    streams = [stream(f"vision/front/{topic}", schema) for topic, schema in keys.items()]
    server.tell("streams", streams=streams)
    header = {"camera": "front", "epoch": "1", "seq": 7, "stamp_ns": str(NOW_NS)}
    tab.page.keyboard.press("p")
    tab.page.select_option("#plot-topic", "brightness")
    wait_until(lambda: server.hear() and server.watches("vision/front/brightness"))
    brightness = {"regions": [{"mean": 12.5, "name": "left"}], "mean": -3.5}
    server.tell("message", key="vision/front/brightness", header=header, body=brightness)
    offered = "[...document.querySelector('#plot-field').options].map((one) => one.value).join()"
    tab.wait(f"{offered} === ',regions.0.mean,mean,header.epoch,header.seq,header.stamp_ns'")
    tab.page.select_option("#plot-field", "regions.0.mean")
    tab.page.click("#plot-add")
    server.tell("message", key="vision/front/brightness", header=header, body=brightness)
    plot = "document.querySelector('#field-plots .plot:last-child')"
    tab.wait(f"{plot}.querySelector('.legend').textContent === 'regions.0.mean 12.5'")
    assert json.loads(tab.page.evaluate("localStorage.getItem('zv.plots')"))[-1] == [
        "brightness", "regions.0.mean",
    ]  # fmt: skip
    tab.page.click("button[aria-label='Remove the plot of Brightness regions.0.mean']")
    assert "Brightness" not in tab.page.inner_text("#field-plots")

    tab.page.keyboard.press("v")
    wait_until(lambda: server.hear() and server.watches("vision/front/events"))
    tab.wait("document.querySelector('#event-lines').dataset.empty === 'No event yet.'")
    event = {"event": "line_crossed", "id": 7, "zone": "<b>gate</b>", "direction": "in"}
    server.tell(
        "message", key="vision/front/events", header=header, body=event | {"x": 3, "y": 4.4}
    )
    server.tell("message", key="vision/front/events", header=None, body={"event": ["?"] * 99})
    lines = "[...document.querySelectorAll('#event-lines li')].map((one) => one.lastChild.data)"
    found = tab.wait(f"{lines}.length === 2 && {lines}")
    assert found[0] == "line crossed 7, <b>gate</b>, in, at 3, 4"
    assert len(found[1]) <= 60


def _hide(tab: Tab, hidden: bool) -> None:
    """Make a page believe that its tab is hidden, or shown again."""
    value = json.dumps(hidden)
    tab.page.evaluate(
        "() => { Object.defineProperty(document, 'hidden', "
        f"{{ configurable: true, get: () => {value} }});"
        " document.dispatchEvent(new Event('visibilitychange')); }"
    )


def _tell_centroids(server: PageServer) -> None:
    """Tell of a centroid that jumps, by a camera whose clock is an hour behind."""
    for seq in range(10):
        header = {"camera": "front", "epoch": "1", "seq": seq, "width": 640, "height": 480}
        stamp_ns = str(NOW_NS - 60 * MINUTE_NS)
        place = {"x": 400 if seq % 2 else 100, "y": 200, "box": [90, 190, 20, 20], "area": 400.0}
        server.tell("message", key=CENTROID, header=header | {"stamp_ns": stamp_ns}, body=place)
