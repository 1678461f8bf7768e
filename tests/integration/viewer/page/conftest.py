"""One browser for all tests of the page, and one system for each module."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.support.listening import open_client, wait_for_nodes
from tests.support.viewer.browser import Open, Running, Tab, running, start_chromium, tab

FOLDER = Path(__file__).parent
OPEN: dict[str, Any] = {}
"""Chromium while tests of the page follow one another, and what closes it."""

ALONE = ExitStack()
"""Closes the viewer that has no services, which serves all modules that want one; so does OPEN."""


@pytest.fixture(scope="module")
def browser() -> Any:
    """Chromium, or the test is skipped; one for all modules, as long as it lives."""
    if not OPEN or not OPEN["browser"].is_connected():
        close()
        starting = start_chromium()
        OPEN.update(browser=next(starting), end=starting)
    return OPEN["browser"]


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(nextitem: pytest.Item | None) -> None:
    """Close Chromium before a test of something else.

    While it is open, playwright's loop runs in this thread, and no other test could run one.
    """
    if nextitem is None or not nextitem.path.is_relative_to(FOLDER):
        close()


def close() -> None:
    if OPEN:
        ALONE.close()
        next(OPEN.pop("end"), None)
        OPEN.clear()


@pytest.fixture(scope="module")
def system(
    browser: Any, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Iterator[Running]:
    """A viewer and the services that a module names; one system for all its tests.

    ``SERVICES`` are a camera, tracker and edge detector unless a module says otherwise, ``FLAGS``
    those of the viewer; a viewer alone without flags serves all modules. A module that needs the
    usual rate says so as ``RATE_HZ``: at 30 Hz, Chromium and all that it shows take half of a core
    for as long as a page is open.
    """
    given = vars(request.module)
    services = given.get("SERVICES", ("camera", "tracker", "edge"))
    if not services and "FLAGS" not in given:
        if "alone" not in OPEN:
            folder = tmp_path_factory.mktemp("alone")
            OPEN["alone"] = ALONE.enter_context(running(folder))
        yield OPEN["alone"]
        return
    with running(tmp_path_factory.mktemp("system"), *given.get("FLAGS", ())) as found:
        for service in services:
            rate = ("--rate", given.get("RATE_HZ", 10)) if service == "camera" else ()
            found.service(service, *rate)
        with open_client(found.router.endpoint) as client:
            wait_for_nodes(client, *(f"{service}_front" for service in services))
        yield found


@pytest.fixture
def open_tab(browser: Any, system: Running) -> Iterator[Open]:
    """``open_tab("vision/front/image/compressed")`` opens the page there."""
    with ExitStack() as stack:

        def opened(place: str = "", **context: Any) -> Tab:
            return stack.enter_context(tab(browser, system.address, **context)).open(place)

        yield opened
        system.router.answers()  # fails with its output if it has ended, as when Zenoh locks up
