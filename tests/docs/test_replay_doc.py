"""docs/replay.md is true: its commands run as written, and the example finds a difference."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.integration.tools.bag.test_verify import tampered
from tests.support.processes import ROOT, run_program
from tests.support.recordings import frames, write
from tests.support.systems import running_router, service
from tests.support.viewer.pages import Page, run_as_written

PAGE = Page("docs/replay.md")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a recording of 1.5 s; the commands write more into it."""
    folder = tmp_path_factory.mktemp("recordings")
    write(folder / "run.mcap", frames(45, still=25))
    return folder


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a router and a tracker."""
    place = tmp_path_factory.mktemp("system")
    with running_router(place) as endpoint, service("tracker", place, "--connect", endpoint):
        yield endpoint


def test_the_commands_run_as_written_one_after_the_other(folder: Path, endpoint: str):
    for command in PAGE.commands():
        done = run_as_written(command, folder, ZV_CONNECT=endpoint)
        assert done.returncode == 0, (command, done.stdout, done.stderr)


def test_the_example_passes_and_finds_a_difference_of_which_the_page_shows_the_words(
    folder: Path, tmp_path: Path
):
    golden = tmp_path / "golden.mcap"
    made = run_as_written(
        f"zv bag verify {folder / 'run.mcap'} --node tracker --update {golden}", tmp_path
    )
    assert made.returncode == 0, made.stderr
    shutil.copy(ROOT / "examples" / "test_golden.py", tmp_path)
    tampered(golden, tmp_path / "wrong.mcap", seq=40)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_golden.py"]
    done = run_program(command, folder=tmp_path)
    assert "1 failed, 1 passed" in done.stdout, done.stdout
    told, _, picture = PAGE.blocks("text")[0].partition("picture: ")
    words, found = told.split("now ")
    number, rest = found.split(" ", 1)
    said = re.search(rf"{re.escape(words)}now ([\d.]+) {re.escape(rest.strip())}", done.stdout)
    assert said, done.stdout
    # Where the tracker sees the object: its rules may move that by less than a pixel.
    assert float(said[1]) == pytest.approx(float(number), abs=1)
    assert f"/{picture.strip()}" in done.stdout
