"""Time from capture to painted pixel in Chromium: the page, ``/stream``, and the naive server."""

from __future__ import annotations

import os
import statistics
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from benchmarks.stream import percentiles
from benchmarks.system import System, free_endpoint
from benchmarks.viewer.clients import QUERY, Clients, wait_for
from tests.support.routing import port_answers
from tests.support.viewer.chromium import NO_CHROMIUM, chromium
from zenoh_vision.messages import Header
from zenoh_vision.transport.session import direct
from zv.camera.synthetic.frame_code import MODULUS

RATE_HZ = 29.5
"""Not 30: at half the rate of the screen, every picture would wait as long as the first one."""
OTHERS = (0, 20, 50)
"""Numbers of further clients that read the same server's stream without decoding."""

SHARE = 0.5
"""Of the time of other measurements: there are nine here."""

ROUNDS = 2
WARM_S = 0.7
FLOOR_PICTURES = 60
WATCH = (Path(__file__).parent / "painting.js").read_text()
WINDOW = {"width": 1280, "height": 800}
MOST_SKEW_MS = 2.0
WAYS = {
    "page": ("viewer", "/#vision/front/image/compressed", "canvas.picture"),
    "stream": ("viewer", QUERY.replace("/stream", "/stream_viewer"), "img"),
    "naive": ("naive", QUERY.replace("/stream", "/stream_viewer"), "img"),
}
"""Server, what is opened there, and what shows the picture."""

FLOOR = """async ([address, count]) => {
    const answer = await fetch(address);
    const picture = await answer.blob();
    const canvas = document.body.appendChild(document.createElement("canvas")).getContext("2d");
    const found = [];
    for (let done = 0; done < count; done += 1) {
        await new Promise((resolve) => setTimeout(resolve, 17 + 17 * Math.random()));
        const from = performance.now();
        const bitmap = await createImageBitmap(picture);
        await new Promise((resolve) => requestAnimationFrame(() => {
            found.push(performance.now() - from);
            canvas.drawImage(bitmap, 0, 0);
            resolve();
        }));
    }
    return found;
}"""
"""The minimum: a JPEG in the page is decoded, and painted in the next frame of the screen."""


class Stamps:
    """When each numbered picture of the camera was captured, by its header.

    Args:
        session: Open.
    """

    def __init__(self, session: Any) -> None:
        self.stamp_ns: dict[int, int] = {}
        self.epochs: set[int] = set()
        # The truth is sent for every frame and is small, so it is cheap to receive.
        self._subscriber = session.declare_subscriber("vision/front/truth", direct(self._note))

    def _note(self, sample: Any) -> None:
        header = Header.from_bytes(sample.attachment.to_bytes())
        self.epochs.add(header.epoch)
        self.stamp_ns[header.seq % MODULUS] = header.stamp_ns


def why_not() -> str | None:
    """Return why nothing can be measured here, None if it can."""
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return "playwright is not installed (make puts it into .venv)"
    if chromium() is None:
        return NO_CHROMIUM
    return None


def capture_to_painted(seconds: float) -> dict[str, Any]:
    """Watch a numbered camera of 640x480 at 30 Hz in each way in turn, with and without clients.

    Args:
        seconds: Duration for each way and number of clients, in ``ROUNDS`` parts.

    Returns:
        Milliseconds from the header's stamp to the frame of the screen that has the picture, and
        pictures painted a second; the naive server's over ours; and as the floor, in the same
        Chromium, how long a JPEG takes that is in the page already.
    """
    from playwright.sync_api import sync_playwright

    found: dict[str, Any] = {"load_average": round(os.getloadavg()[0], 2)}
    with ExitStack() as stack:
        system = stack.enter_context(System())
        ports = _start(system)
        session = system.session()
        stack.callback(session.close)
        stamps = Stamps(session)
        playwright = stack.enter_context(sync_playwright())
        browser = playwright.chromium.launch(
            executable_path=chromium(), args=["--no-sandbox", "--disable-dev-shm-usage"]
        )
        stack.callback(browser.close)
        found["floor_ms"] = _floor(browser, ports["viewer"])
        for others in OTHERS:
            row = _turns(browser, ports, stamps, others, seconds / ROUNDS)
            found[f"{others} other clients"] = row
    if len(stamps.epochs) != 1:
        sys.exit("the camera restarted during the measurement")
    return found


def _start(system: System) -> dict[str, int]:
    system.service("camera", "camera", "--numbered", "--rate", f"{RATE_HZ:g}")
    ports = {name: int(free_endpoint().rpartition(":")[2]) for name in ("viewer", "naive")}
    system.service("viewer", "view", "--port", f"{ports['viewer']}")
    system.start("naive", "-m", "benchmarks.viewer.naive", system.endpoint, f"{ports['naive']}")
    for port in ports.values():
        wait_for(lambda port=port: port_answers(port))
    return ports


def _floor(browser: Any, port: int) -> dict[str, float]:
    page = browser.new_page(viewport=WINDOW)
    page.goto(f"http://127.0.0.1:{port}/healthz")
    wait_for(lambda: page.request.get(f"http://127.0.0.1:{port}{_SNAPSHOT}").ok)
    ages: list[float] = page.evaluate(FLOOR, [_SNAPSHOT, FLOOR_PICTURES])
    page.close()
    return _figures(ages)


_SNAPSHOT = QUERY.replace("/stream", "/snapshot")


def _turns(
    browser: Any, ports: dict[str, int], stamps: Stamps, others: int, seconds: float
) -> dict[str, Any]:
    ages: dict[str, list[float]] = {way: [] for way in WAYS}
    rates: dict[str, list[float]] = {way: [] for way in WAYS}
    for _ in range(ROUNDS):
        for way, (server, place, selector) in WAYS.items():
            address = f"http://127.0.0.1:{ports[server]}{place}"
            with Clients(ports[server], others, QUERY):
                painted, elapsed_s = _painted(browser, address, selector, seconds)
            rates[way].append(len(painted) / elapsed_s)
            # The first may have been painted before the observation began.
            ages[way] += [
                at_ms - stamps.stamp_ns[number] / 1e6
                for number, at_ms in painted
                if number in stamps.stamp_ns
            ]
    row: dict[str, Any] = {
        way: {"ms": _figures(ages[way]), "hz": round(statistics.mean(rates[way]), 1)}
        for way in WAYS
    }
    for way in ("page", "stream"):
        row[f"naive_over_{way}"] = {
            name: round(row["naive"]["ms"][name] / row[way]["ms"][name], 2)
            for name in row[way]["ms"]
        }
    return row


def _painted(
    browser: Any, address: str, selector: str, seconds: float
) -> tuple[list[tuple[int, float]], float]:
    """Return number and time (ms since 1970) of each picture that a tab painted in some seconds."""
    page = browser.new_page(viewport=WINDOW)
    try:
        page.goto(address, wait_until="commit")
        page.wait_for_selector(selector, state="attached")
        page.evaluate(WATCH, selector)
        wait_for(lambda: page.evaluate("window.painted.length > 1"))
        page.wait_for_timeout(1000 * WARM_S)
        page.evaluate("window.painted.length = 0")
        began_s = time.monotonic()
        page.wait_for_timeout(1000 * seconds)
        painted, skew_ms = page.evaluate(
            "[window.painted, Date.now() - performance.timeOrigin - performance.now()]"
        )
        elapsed_s = time.monotonic() - began_s
    finally:
        page.close()
    if abs(skew_ms) > MOST_SKEW_MS:
        sys.exit(f"Chromium's clock differs from the machine's by {skew_ms:.1f} ms")
    return [(number, at_ms) for number, at_ms in painted], elapsed_s


def _figures(ages_ms: list[float]) -> dict[str, float]:
    if not ages_ms:
        sys.exit("nothing was painted")
    rounded = {name: round(value, 1) for name, value in percentiles(ages_ms).items()}
    return {**rounded, "max": round(max(ages_ms), 1)}
