"""Real video, which is not part of the project."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="session")
def real_data() -> Callable[[str], Path]:
    """Return what finds a file of test data, or skips the test saying where it looked."""
    folders = [ROOT.parent / "shared" / "data", Path("/usr/share/doc/opencv-doc")]
    if os.environ.get("ZV_TEST_DATA"):
        folders.insert(0, Path(os.environ["ZV_TEST_DATA"]))

    def find(name: str) -> Path:
        for folder in folders:
            found = next(iter(sorted(folder.rglob(name))), None) if folder.is_dir() else None
            if found is not None:
                return found
        pytest.skip(f"no {name} in {', '.join(map(str, folders))}; set ZV_TEST_DATA")

    return find
