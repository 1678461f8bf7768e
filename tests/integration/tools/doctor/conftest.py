"""One router for all conditions; each test has a namespace of its own at it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.integration.conftest import Service, a_router, some_services
from tests.support.diagnosing import SECOND_S, Stand
from tests.support.listening import open_client
from tests.support.routing import Router
from tests.support.standing_in import StandIn


@pytest.fixture(scope="package")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Router]:
    with a_router(tmp_path_factory.mktemp("router")) as router:
        yield router


@pytest.fixture
def start(shared: Router, tmp_path: Path) -> Iterator[Service]:
    with some_services(shared.endpoint, tmp_path) as start:
        yield start


@pytest.fixture
def stand(shared: Router) -> Iterator[Stand]:
    """Starts stand-ins, each with a session of its own."""
    standing = []
    with ExitStack() as open_sessions:

        def stand(node: str, **about: Any) -> StandIn:
            session = open_sessions.enter_context(open_client(shared.endpoint))
            standing.append(StandIn(session, node, second_s=SECOND_S, **about))
            return standing[-1]

        yield stand
