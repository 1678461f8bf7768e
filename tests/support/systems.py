"""Whole systems for tests of what a user types: a router, and services of ours at it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from tests.support.fork_server import ZV
from tests.support.listening import newest, open_client
from tests.support.processes import START_S, Program
from tests.support.routing import Router

RESULTS = {
    "tracker": "vision/front/centroid",
    "edge": "vision/front/edges/compressed",
    "view": "@vision/node/viewer",
}
"""Key on which a service answers once it works."""


@contextmanager
def running_router(folder: Path) -> Iterator[str]:
    """Yield the endpoint of a router whose output goes to a folder."""
    with closing(Router(folder)) as router:
        router.start()
        yield router.endpoint


def service(name: str, folder: Path, *flags: str) -> Program:
    """Start a service of ours, or any other command."""
    return Program([name, *flags], folder, name, forked=ZV)


@contextmanager
def system(folder: Path, *services: str, rate_hz: int = 10) -> Iterator[str]:
    """Yield the endpoint of a router with services at it, once their results flow.

    Args:
        folder: Where the programs' output goes.
        services: Beside the synthetic camera: ``tracker``, ``edge``, ``view``.
        rate_hz: Of the camera; all that it sends has to be computed beside other tests.
    """
    with running_router(folder) as endpoint, ExitStack() as running:
        connect = ("--connect", endpoint)
        running.enter_context(service("camera", folder, *connect, "--rate", str(rate_hz)))
        for name in services:
            running.enter_context(service(name, folder, *connect))
        with open_client(endpoint) as session:
            for name in services:
                newest(session, RESULTS[name], START_S)
        yield endpoint
