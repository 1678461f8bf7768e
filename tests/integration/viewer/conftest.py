"""A viewer at a router, for each test."""

from __future__ import annotations

import pytest

from tests.integration.conftest import Service
from tests.integration.viewer.browsing import Viewer


@pytest.fixture
def viewer(service: Service) -> Viewer:
    """The real ``zv view`` on a free port."""
    return Viewer(service("view", "--port", 0))
