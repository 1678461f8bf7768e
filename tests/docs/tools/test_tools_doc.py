"""docs/tools.md and the README's tools are true: each command runs as written, as shown."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from docs.generate import entries
from tests.support.fork_server import ZV
from tests.support.processes import ROOT, Program
from tests.support.systems import system
from tests.support.viewer.pages import Page, begins, once_each, run_as_written
from zv.tools.registry import TOOLS

PAGE = Page("docs/tools.md")
README = Page("README.md")
OWN_PAGES = ("topic", "snapshot", "schema", "node", "top")
ENDLESS = {
    "zv topic list --watch",
    "zv topic hz",
    "zv topic hz vision/front/centroid",
    "zv node list --watch",
    "zv top",
}
NOT_SHOWN = {
    "zv schema Centroid",
    "zv topic list 'vision/*/centroid' --flowing --json",
    "zv node info 'camera_*' --json",
    "zv top --once",  # an empty line is first
    "zv top --once --json",
}


COMMANDS = [
    command
    for command in once_each(*PAGE.commands(), *README.commands())
    if any(begins(command, "zv", name) for name in OWN_PAGES)
]


def shape(line: str) -> str:
    """Return a line without what differs from run to run.

    A coordinate is negative if most of the object has left the picture.
    """
    return re.sub(r"\s+", " ", re.sub(r"(?<!\S)-?[\d.]+|[\d.]+", "0", line)).strip()


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a router, the synthetic camera and a tracker, at the rate that the page expects."""
    with system(tmp_path_factory.mktemp("system"), "tracker", rate_hz=30) as endpoint:
        yield endpoint


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder that looks like the checkout, to write into."""
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    return tmp_path


@pytest.mark.parametrize("command", [each for each in COMMANDS if each not in ENDLESS])
def test_a_command_runs_as_written_and_prints_what_is_shown(
    command: str, endpoint: str, place: Path
):
    short = command.replace("--for 5s", "--for 1s")
    done = run_as_written(short, place, ZV_CONNECT=endpoint)
    if "--expect" in command and done.returncode == 1:  # a loaded machine is not at its rate
        assert re.search(r": [\d.]+ Hz, expected 27\.00 Hz to 33\.00 Hz", done.stderr)
        return
    assert done.returncode == 0, done.stderr
    first = (done.stdout or done.stderr).splitlines()
    shown = {shape(line) for block in PAGE.blocks("text") for line in block.splitlines()}
    if "--field x" in command and first[0] == "null":
        return  # nothing moves in this frame
    if command not in NOT_SHOWN and first:
        assert shape(first[0]) in shown
    for file in re.findall(r"\S+\.(?:jpg|png)$", command):
        assert (place / file).stat().st_size > 1000


@pytest.mark.parametrize("command", sorted(ENDLESS))
def test_a_command_without_an_end_runs_until_ctrl_c(command: str, endpoint: str, tmp_path: Path):
    assert command in COMMANDS
    arguments = [*shlex.split(command)[1:], "--connect", endpoint]
    with Program(arguments, tmp_path, "tool", forked=ZV) as program:
        program.lines(r"vision/front/.*|\d+|null|(here  )?\w+_front .*", count=2)
        assert program.interrupt() == 0
        assert program.complaints == ""


def test_every_tool_has_its_section():
    headings = set(re.findall(r"^## zv (.*)$", PAGE.text, re.MULTILINE))
    assert {words for words in TOOLS if words.split()[0] in OWN_PAGES} <= headings


def test_every_flag_that_is_named_is_one():
    options = [option for command in entries().values() for option in command.params]
    spellings = [spelling for each in options for spelling in (*each.opts, *each.secondary_opts)]
    known = {"--debug", "--help", *spellings}
    assert set(re.findall(r"--[a-z][a-z-]*", PAGE.text)) <= known
