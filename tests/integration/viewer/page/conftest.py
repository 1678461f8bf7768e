"""One browser and one system for each module of tests of the page."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from tests.support.viewer.browser import Open, Running, Tab, running, start_chromium, tab


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, or the test is skipped.

    Not for the whole session: while it is open, playwright's loop runs in this thread, and no
    other test could run one.
    """
    yield from start_chromium()


@pytest.fixture(scope="module")
def system(
    browser: Any, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Iterator[Running]:
    """A synthetic camera with tracker and edge detector; one for all tests of a module.

    A module that needs the usual rate says so as ``RATE_HZ``: at 30 Hz, Chromium and all that it
    shows take half of a core for as long as a page is open.
    """
    with running(tmp_path_factory.mktemp("system")) as found:
        found.service("camera", "--rate", getattr(request.module, "RATE_HZ", 10))
        for service in ("tracker", "edge"):
            found.service(service)
        yield found


@pytest.fixture
def open_tab(browser: Any, system: Running) -> Iterator[Open]:
    """``open_tab("vision/front/image/compressed")`` opens the page there."""
    with ExitStack() as stack:

        def opened(place: str = "", **context: Any) -> Tab:
            return stack.enter_context(tab(browser, system.address, **context)).open(place)

        yield opened
