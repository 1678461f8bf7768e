"""The systems in which the commands of a page run, one for each page."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.systems import running_router, system


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a router, the synthetic camera and a tracker."""
    with system(tmp_path_factory.mktemp("system"), "tracker") as endpoint:
        yield endpoint


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a router without nodes but those that a test starts."""
    with running_router(tmp_path_factory.mktemp("router")) as endpoint:
        yield endpoint
