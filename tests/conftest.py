"""Real video, which is not part of the project, and the order of the tests among workers."""

from __future__ import annotations

import gc
import gzip
import importlib
import os
import re
import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from xdist.remote import Producer
from xdist.scheduler import LoadFileScheduling

from tests.support.processes import CAMERA_SIZE

ROOT = Path(__file__).parents[1]
PAGE = "tests/integration/viewer/page/"
IDLE_PAGES = (f"{PAGE}test_page_link.py", f"{PAGE}test_page_streams.py")
"""Tests of the page that mostly wait, for a slow link or for something that is frozen."""
WAITING = (
    PAGE,
    "tests/integration/launcher/",
    "tests/docs/",
    "tests/integration/viewer/",
    "tests/integration/transport/",
    "tests/integration/tools/",
    "tests/integration/",
)
"""Folders of tests that mostly wait, from those whose files take longest."""
COMPUTING = ("tests/zv/tracker/", "tests/")
"""As above, of the tests that compute all the time."""
OPENCV_DOC = Path("/usr/share/doc/opencv-doc/examples/data")
LATER = ("quiet", "alone")
"""Marks of the tests that ``make tests`` runs after the others."""
MARKED: set[tuple[Path, str]] = set()
"""Files in which tests with such a mark were collected, and the mark."""


class OneBusyChromium(LoadFileScheduling):  # type: ignore[misc]
    """Gives a worker the tests of a file, and one worker all tests of the page but the idle ones.

    Two busy browsers at a time would fill two cores, and the tests beside them would take longer.
    """

    def _split_scope(self, nodeid: str) -> str:
        return scope_of(nodeid)


def scope_of(nodeid: str) -> str:
    """Return what a test's worker runs as a whole: a file, or most tests of the page."""
    file = nodeid.partition("::")[0]
    return PAGE if file.startswith(PAGE) and file not in IDLE_PAGES else file


def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> LoadFileScheduling | None:
    """Use it for ``--dist loadfile``."""
    return OneBusyChromium(config, log) if config.getvalue("dist") == "loadfile" else None


def pytest_configure(config: pytest.Config) -> None:
    """Let cameras have their default size where tests run alone, and programs end on Ctrl-C.

    A shell that starts tests in the background has SIGINT ignored, which every program inherits.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.getoption("markexpr") in LATER:
        CAMERA_SIZE.clear()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out the files without a test of the only mark that runs: loading all takes long."""
    mark = config.getoption("markexpr")
    if mark not in LATER or not collection_path.is_file():
        return None
    return not names_mark(collection_path, mark) or None


def names_mark(file: Path, mark: str) -> bool:
    """Tell whether a file gives tests a mark."""
    return re.search(rf"\bmark\.{mark}\b", file.read_text()) is not None


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Iterator[None]:
    """Have the garbage collector look neither for nor at what the collection makes.

    It is there until the end, and each look at all of it takes a quarter of a second.
    """
    gc.disable()
    import_own_share(session.config)
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def import_own_share(config: pytest.Config) -> None:
    """Import this worker's share of the test files before all of them are collected.

    A test file that was never imported is compiled, with pytest's own asserts. Each worker needs
    all files, and would compile them all at the same time as the others.
    """
    worker = getattr(config, "workerinput", None)
    runs_all = config.args == config.getini("testpaths")
    if worker is None or not runs_all or config.getoption("markexpr") in LATER:
        return
    files = sorted((ROOT / "tests").rglob("test_*.py"))
    for file in files[int(worker["workerid"].removeprefix("gw")) :: worker["workercount"]]:
        with suppress(Exception, pytest.skip.Exception):  # the collection reports it
            importlib.import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread the files that compute evenly among those that wait, which leave a core idle.

    Each kind begins with what takes longest, so that no worker is left alone with it at the end.
    """
    MARKED.update((item.path, m) for item in items for m in LATER if item.get_closest_marker(m))
    folders = (*WAITING, *COMPUTING)

    def rank(scope: str) -> int:
        return next(n for n, folder in enumerate(folders) if scope.startswith(folder))

    scopes = sorted({scope_of(item.nodeid): None for item in items}, key=rank)
    waiting = [scope for scope in scopes if rank(scope) < len(WAITING)]
    place: dict[str, float] = {}
    for kind in (waiting, scopes[len(waiting) :]):
        place |= {scope: number / len(kind) for number, scope in enumerate(kind)}
    items.sort(key=lambda item: place[scope_of(item.nodeid)])


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
