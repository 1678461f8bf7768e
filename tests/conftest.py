"""Real video, which is not part of the project."""

from __future__ import annotations

import gzip
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
OPENCV_DOC = Path("/usr/share/doc/opencv-doc/examples/data")


@pytest.fixture(scope="session")
def data_folders() -> list[Path]:
    """Where test data is looked for, in this order."""
    named = os.environ.get("ZV_TEST_DATA")
    return [*([Path(named)] if named else []), ROOT.parent / "shared" / "data", OPENCV_DOC]


@pytest.fixture(scope="session")
def real_data(
    data_folders: list[Path], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str], Path]:
    """Return what finds a file of test data, or skips the test saying where it looked."""

    def find(name: str) -> Path:
        for folder in data_folders:
            if (folder / name).exists():
                return folder / name
            packed = folder / f"{name}.gz"  # Debian packs documentation
            if packed.exists():
                unpacked = tmp_path_factory.mktemp("data") / name
                with gzip.open(packed) as source, unpacked.open("wb") as target:
                    shutil.copyfileobj(source, target)
                return unpacked
        pytest.skip(f"no {name} in {', '.join(map(str, data_folders))}; set ZV_TEST_DATA")

    return find
