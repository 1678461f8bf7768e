"""Real video, which is not part of the project, and what all programs of the tests inherit."""

from __future__ import annotations

import gc
import gzip
import os
import resource
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.support.processes import CAMERA_SIZE

ROOT = Path(__file__).parents[1]
OPENCV_DOC = Path("/usr/share/doc/opencv-doc/examples/data")


def pytest_configure(config: pytest.Config) -> None:
    """Let cameras have their default size where tests run alone or on devices, which offer others.

    Programs end on Ctrl-C, although a shell that starts tests in the background has SIGINT ignored,
    which every program inherits.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.getoption("markexpr") in ("quiet", "alone", "devices"):
        CAMERA_SIZE.clear()


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Keep garbage collections away from the modules and 8,000 tests, which stay to the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _own_state(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep what programs keep for their user, such as events, out of that user's folder."""
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))


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


@pytest.fixture
def full_disk() -> Iterator[None]:
    """Let this process write files of at most 1000 bytes, as if the disk were full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
