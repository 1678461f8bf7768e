"""A running system with the viewer, and its page as Chromium shows it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from tests.integration.conftest import Service, a_router, some_services
from tests.support.processes import Program, missing
from tests.support.routing import Router
from tests.support.viewer.chromium import NO_CHROMIUM, chromium
from tests.support.waiting import wait_until

CAMERA = "vision/front/image/compressed"
EDGES = "vision/front/edges/compressed"
MASK = "vision/front/mask/compressed"
TRUTH = "vision/front/truth"
PATIENCE_S = 40.0

SEEN = """([key, x, y]) => {
    const [canvas, overlay] = document.querySelectorAll(`.pane[data-key="${key}"] canvas`);
    if (!overlay?.view) return null;
    const drawn = Math.round(canvas.clientHeight * devicePixelRatio);
    if (canvas.height !== drawn) return null; // laid out anew, and not drawn since
    const { scale, x: middleX, y: middleY } = overlay.view;
    const [left, top] = [(x - middleX) * scale + canvas.width / 2,
        (y - middleY) * scale + canvas.height / 2];
    const probe = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true });
    probe.drawImage(canvas, -Math.floor(left), -Math.floor(top));
    const box = canvas.getBoundingClientRect();
    return { at: [box.left + left / devicePixelRatio, box.top + top / devicePixelRatio],
        red: probe.getImageData(0, 0, 1, 1).data[0] };
}"""
POLL_S = 0.03
"""Each question to a page takes three processes some milliseconds."""


@dataclass
class Running:
    """A router, services and the viewer; ``address`` is what the viewer printed."""

    router: Router
    service: Service
    viewer: Program
    address: str


@contextmanager
def running(folder: Path, *viewer_flags: object) -> Iterator[Running]:
    """Yield a router with a viewer on a free port; services are started by the test."""
    with (
        a_router(folder) as router,
        router.supervised(),
        some_services(router.endpoint, folder) as service,
    ):
        viewer = service("view", "--port", 0, *viewer_flags)
        address = viewer.lines(r"http://\S+")[0][0]
        yield Running(router, service, viewer, address)


def start_chromium() -> Any:
    """Yield a headless Chromium; skip where there is none."""
    sync = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = chromium() or missing(NO_CHROMIUM)
    with sync.sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=path, args=["--no-sandbox", "--disable-dev-shm-usage"]
        )
        yield browser
        browser.close()


@dataclass
class Tab:
    """One page, with what its console complained of and whom it asked."""

    page: Any
    address: str
    complaints: list[str] = field(default_factory=list)
    hosts: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.page.set_default_timeout(1000 * PATIENCE_S)
        self.page.on("console", self._on_console)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.hosts.add(request.url.split("/")[2]))

    def _on_console(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)

    def open(self, place: str = "") -> Tab:
        """Go to the wall, or to the streams of a hash."""
        self.page.goto(self.address + (f"#{place}" if place else ""))
        return self

    def wait(self, expression: str, deadline_s: float = PATIENCE_S) -> Any:
        """Return an expression's first true value."""
        return wait_until(
            lambda: self.page.evaluate(expression),
            deadline_s,
            lambda: f"{expression}: {self.text}",
            POLL_S,
        )

    @property
    def text(self) -> str:
        """What the page says, for a test that fails."""
        return f"{self.page.inner_text('body')[:1500]} {self.complaints}"

    def place(self, key: str, x: float, y: float) -> list[float]:
        """Return where on the screen a point of a frame of the large view is, as it is shown."""
        return list(wait_until(lambda: self.page.evaluate(SEEN, [key, x, y]), poll_s=POLL_S)["at"])

    def wait_for_red(self, key: str, x: float, y: float, red: int) -> None:
        """Wait until a point of a frame of the large view has this grey or red value."""
        seen: list[Any] = [None]

        def is_shown() -> bool:
            seen[0] = self.page.evaluate(SEEN, [key, x, y])
            return seen[0] is not None and abs(seen[0]["red"] - red) <= 1

        wait_until(is_shown, explain=lambda: f"{key} {x}, {y}: {seen} {self.text}")

    def wait_until_live(self, key: str) -> None:
        self.wait(f"document.querySelector('{canvas(key)}')?.dataset.live === 'true'")

    def pixels(self, key: str) -> list[int]:
        """Return what a stream's canvas shows: red, green, blue of a coarse grid."""
        found: list[int] = self.page.evaluate(
            """selector => {
                const seen = document.querySelector(selector);
                const small = new OffscreenCanvas(32, 24).getContext("2d");
                small.drawImage(seen, 0, 0, 32, 24);
                return [...small.getImageData(0, 0, 32, 24).data];
            }""",
            canvas(key),
        )
        return found


def canvas(key: str) -> str:
    """Return the selector of the canvas that shows a stream."""
    return f'[data-view="wall"] .tile canvas[data-key="{key}"], ' + (
        f'[data-view="large"] canvas.picture[data-key="{key}"]'
    )


@contextmanager
def tab(browser: Any, address: str, **context: Any) -> Iterator[Tab]:
    """Yield a tab with a profile of its own."""
    profile = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **context})
    try:
        yield Tab(profile.new_page(), address)
    finally:
        profile.close()


Open = Callable[..., Tab]
