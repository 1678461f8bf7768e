"""docs/tools.md and the README's tools are true: each command runs as written, as shown."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from services.tools.catalogue import TOOLS
from tests.processes import (
    ROOT,
    START_S,
    Program,
    client,
    environment,
    newest,
    router,
    service,
)

PAGE = (ROOT / "docs" / "tools.md").read_text()
README = (ROOT / "README.md").read_text()
OWN_PAGES = ("topic", "snapshot", "schema", "node", "top")
ENDLESS = {
    "zv topic list --watch",
    "zv topic hz",
    "zv topic hz vision/front/centroid",
    "zv topic echo vision/front/centroid --field x",
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


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)


def commands() -> list[str]:
    """Return every command that starts one of these tools, without its comment, each once."""
    lines = [
        line
        for page in (PAGE, README)
        for block in blocks(page, "sh")
        for line in block.splitlines()
    ]
    found = [re.sub(r"\s+# .*", "", line) for line in lines if line.strip()]
    ours = [line for line in found if line.split()[:2] in [["zv", name] for name in OWN_PAGES]]
    return list(dict.fromkeys(ours))


def shape(line: str) -> str:
    """Return a line without what differs from run to run."""
    return re.sub(r"\s+", " ", re.sub(r"[\d.]+", "0", line)).strip()


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A router, the synthetic camera and a tracker; the endpoint."""
    folder = tmp_path_factory.mktemp("system")
    with ExitStack() as running:
        program, endpoint = router(folder)
        running.enter_context(program)
        for name in ("camera", "tracker"):
            running.enter_context(service(name, folder, "--connect", endpoint))
        with client(endpoint) as session:
            newest(session, "vision/front/centroid")
        yield endpoint


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder that looks like the checkout, to write into."""
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    return tmp_path


@pytest.mark.parametrize("command", [each for each in commands() if each not in ENDLESS])
def test_a_command_runs_as_written_and_prints_what_is_shown(
    command: str, endpoint: str, place: Path
):
    words = command.removeprefix("zv ")
    done = subprocess.run(
        ["bash", "-c", f"exec {shlex.quote(sys.executable)} -m services {words}"],
        capture_output=True,
        cwd=place,
        env=environment() | {"ZV_CONNECT": endpoint},
        timeout=START_S,
        check=False,
    )
    if "--expect" in command and done.returncode == 1:  # a loaded machine is not at its rate
        assert re.search(r": [\d.]+ Hz, expected 27\.00 Hz to 33\.00 Hz", done.stderr.decode())
        return
    assert done.returncode == 0, done.stderr.decode()
    first = (done.stdout or done.stderr).decode().splitlines()
    shown = {shape(line) for block in blocks(PAGE, "text") for line in block.splitlines()}
    if command not in NOT_SHOWN and first:
        assert shape(first[0]) in shown
    for file in re.findall(r"\S+\.(?:jpg|png)$", command):
        assert (place / file).stat().st_size > 1000


@pytest.mark.parametrize("command", sorted(ENDLESS))
def test_a_command_without_an_end_runs_until_ctrl_c(command: str, endpoint: str, tmp_path: Path):
    assert command in commands()
    arguments = ["-m", "services", *shlex.split(command)[1:], "--connect", endpoint]
    with Program(arguments, tmp_path, "tool") as program:
        program.lines(r"vision/front/.*|\d+|null|(here  )?\w+_front .*", count=2)
        assert program.interrupt() == 0
        assert program.complaints == ""


def test_every_tool_has_its_section():
    headings = set(re.findall(r"^## zv (.*)$", PAGE, re.MULTILINE))
    assert {words for words in TOOLS if words.split()[0] in OWN_PAGES} <= headings


def test_every_flag_that_is_named_is_one():
    from services.cli.tools import load

    known = {"--debug", "--help"}
    for words in TOOLS:
        group, _, name = words.partition(" ")
        found = load(group)
        found = found.get_command(None, name) if name else found
        known |= {
            spelling
            for option in found.params
            for spelling in (*option.opts, *option.secondary_opts)
        }
    assert set(re.findall(r"--[a-z][a-z-]*", PAGE)) <= known
