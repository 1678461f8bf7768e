"""Render docs/images/viewer.png: the page of the viewer as Chromium shows it.

Starts a router, the synthetic camera, tracker, edge detector and viewer on free ports, opens the
page at one stream with the edges beside it, and keeps what it shows. Run it from the top of the
repository, with one of Debian's chromium-headless-shell and chromium installed:

    make screenshots
"""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import cv2
import msgpack
import numpy as np
import zenoh
from playwright.sync_api import Page, sync_playwright
from zenoh.handlers import RingChannel

from tests.support.viewer.chromium import NO_CHROMIUM, chromium

TARGET = Path(__file__).parent / "viewer.png"
IMAGE = "vision/front/image/compressed"
EDGES = "vision/front/edges/compressed"
SIZE = {"width": 1440, "height": 720}
RATE_HZ = 10
"""Of the camera: low enough that a busy machine loses no frame."""

ZONE = "belt 400,250 630,250 630,470 400,470"
LINE = "gate 230,250 230,470"
LEVELS = 64
"""Of each colour: the textures of the room make a picture of 256 too large for a README."""

SETTLED_FRAME = 10 * RATE_HZ
"""The page is opened at this frame: while five programs start, a small machine may lose some."""

SHOWN_FRAME = 14 * RATE_HZ
LEAST_TRACKS = 3
LIVE = f"""() => document.querySelectorAll(".pane[data-step=true][data-live=true]").length === 2
    && document.querySelector("canvas.picture").dataset.overlay === "joined"
    && Number(document.querySelector("canvas.picture").dataset.seq) >= {SHOWN_FRAME}
    && !Number(document.getElementById("health-count").textContent)
    && Number.parseFloat(document.getElementById("figure-rate").textContent) > {0.9 * RATE_HZ}"""
"""The frame is there, and the machine is quiet: figures of a busy one would misinform."""


def main() -> None:
    """Start the system, wait for the frame, write the file."""
    browser_path = chromium()
    if browser_path is None:
        raise SystemExit(NO_CHROMIUM)
    endpoint, port = f"tcp/127.0.0.1:{_free_port()}", _free_port()
    with ExitStack() as stack, sync_playwright() as playwright:
        for command in (
            ["router", "--listen", endpoint],
            ["camera", "--connect", endpoint, "--noise", "0", "--rate", str(RATE_HZ)],
            ["tracker", "--connect", endpoint, "--zones", ZONE, "--lines", LINE],
            ["edge", "--connect", endpoint],
        ):
            _start(stack, command)
        viewer = _start(stack, ["view", "--connect", endpoint, "--port", str(port)])
        assert viewer.stdout is not None
        address = viewer.stdout.readline().decode().strip()
        browser = playwright.chromium.launch(executable_path=browser_path, args=["--no-sandbox"])
        page = browser.new_page(viewport=SIZE, color_scheme="dark")
        _keep(page, f"{address}#{IMAGE}+{EDGES}", endpoint)
        browser.close()


def _keep(page: Page, address: str, endpoint: str) -> None:
    config = {"mode": "client", "connect": {"endpoints": [endpoint]}}
    states: list[str] = []
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))) as session:
        newest = session.declare_subscriber("vision/front/tracks", RingChannel(1))
        while msgpack.unpackb(newest.recv().payload.to_bytes())["header"]["seq"] < SETTLED_FRAME:
            pass
        page.goto(address)
        page.keyboard.press("e")
        while len(states) < LEAST_TRACKS or set(states) != {"confirmed"}:
            page.wait_for_function(LIVE, timeout=120_000)
            tracks = msgpack.unpackb(newest.recv().payload.to_bytes())["tracks"]
            states = [track["state"] for track in tracks]
    shown = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    step = 256 // LEVELS
    coarse = (shown // step * step).astype(np.uint8)
    cv2.imwrite(str(TARGET), coarse, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    print(f"{TARGET}: {TARGET.stat().st_size / 1000:.0f} kB")


def _start(stack: ExitStack, command: list[str]) -> subprocess.Popen[bytes]:
    process = subprocess.Popen(  # noqa: S603 - our own
        [sys.executable, "-m", "zv", *command],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
    )
    stack.callback(process.wait, 10)
    stack.callback(process.terminate)
    return process


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


if __name__ == "__main__":
    main()
