"""The devices of the virtual machine: where they are, by stable paths, and as they were made."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.support.cameras.drivers import NAMES, make_links, reset
from zv.camera.sources.device import DeviceSource

FOLDER = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark these tests, which need the virtual machine: ``make test-devices`` runs them."""
    for item in items:
        if str(item.path).startswith(f"{FOLDER}/"):  # `parents` takes 0.2 s
            item.add_marker(pytest.mark.devices)
            item.add_marker(pytest.mark.timeout(300))


@pytest.fixture(scope="session", autouse=True)
def _links() -> None:
    """Stable paths as udev makes them; there is no udev in the machine."""
    make_links()


@pytest.fixture(autouse=True)
def _as_made() -> Iterator[None]:
    """Set all controls of the devices to their defaults after each test."""
    yield
    for path in NAMES.values():
        if path.exists():
            reset(path)


@pytest.fixture
def opened() -> Iterator[DeviceSource]:
    """The first device as it opens by itself."""
    with closing(DeviceSource(0)) as source:
        yield source
