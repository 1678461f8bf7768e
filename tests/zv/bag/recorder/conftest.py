"""A disk that logs what a recorder does to it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.power_cut import LoggedDisk


@pytest.fixture
def disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[LoggedDisk]:
    """The disk of ``tmp_path``; what a test still holds at its end is released."""
    logged = LoggedDisk(tmp_path, monkeypatch)
    yield logged
    logged.release()
