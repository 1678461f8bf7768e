"""A viewer at a router, for each test; and one for a module's tests that leave no trace in it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.integration.conftest import Service, a_router, some_services
from tests.support.viewer.client import Viewer
from tests.support.viewer.coroutines import pytest_pyfunc_call
from tests.support.waiting import wait_until

__all__ = ["pytest_pyfunc_call"]


@pytest.fixture
def viewer(service: Service) -> Viewer:
    """The real ``zv view`` on a free port."""
    return Viewer(service("view", "--port", 0))


@pytest.fixture(scope="module")
def standing_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """As ``service``, for all tests of a module."""
    folder = tmp_path_factory.mktemp("standing")
    with a_router(folder) as router, some_services(router.endpoint, folder) as start:
        yield start


@pytest.fixture(scope="module")
def standing_viewer(standing_service: Service) -> Viewer:
    """A viewer for all tests of a module, which waits less for pictures of cameras not there."""
    return with_router(Viewer(standing_service("view", "--port", 0, "--wait", 0.2)))


def with_router(viewer: Viewer, **headers: str) -> Viewer:
    """Return a viewer once it has found its router; before, it answers 503 for 404."""
    path = "/snapshot?topic=/nobody/image/compressed"
    wait_until(lambda: viewer.get(path, **headers).status == 404)
    return viewer
