"""A stream whose frames come when a test says so, and the context that counts them."""

from collections.abc import Iterator

import pytest

from tests.support.viewer.picture_streams import Registry, Source


@pytest.fixture
def registry() -> Iterator[Registry]:
    found = Registry()
    yield found
    found.pool.shutdown()


@pytest.fixture
def source(registry: Registry) -> Source:
    return Source(registry)
