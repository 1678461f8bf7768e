"""A fleet that forgets nodes some time after they have gone."""

from __future__ import annotations

import pytest

from tests.support.node_states import FORGET_S
from zenoh_vision.health.fleet import Fleet


@pytest.fixture
def fleet() -> Fleet:
    return Fleet(forget_s=FORGET_S)
