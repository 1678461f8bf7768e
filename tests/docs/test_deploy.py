"""docs/deploy.md is true: its commands run as written, on one machine with other addresses."""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from benchmarks.memory import SIZES
from tests.support.fork_server import ZV
from tests.support.listening import newest, open_client
from tests.support.processes import ROOT, START_S, Program
from tests.support.routing import free_endpoint
from tests.support.systems import service
from tests.support.viewer.pages import Page, begins, run_as_written
from zenoh_vision.transport.zenoh_config import (
    WAIT_BEFORE_CLOSE,
    WAIT_BEFORE_CLOSE_US,
    router_config,
)

PAGE = Page("docs/deploy.md")
SITE = "tcp/192.0.2.10:7447"
UNITS = ROOT / "examples" / "systemd"
NOT_RUN_HERE = {
    "ssh": "needs another machine",
    "sudo ufw": "changes this machine's firewall",
    "sudo systemctl": "needs systemd as the first process; the units are in test_systemd.py",
    "sudo python3": "installs; tests/smoke_wheel.sh does it elsewhere",
    "sudo /opt/zenoh-vision/.venv/bin/pip": "installs; tests/smoke_wheel.sh does it elsewhere",
    "journalctl": "needs systemd as the first process",
    "pip install --dry-run": "asks the package registry for 60 packages",
    "zenohd": "tests/integration/transport/test_linked_routers.py",
    "zv router --listen tcp/0.0.0.0:7447 --zenoh-config": (
        "tests/integration/transport/test_linked_routers.py"
    ),
}


TOOLS = PAGE.commands("zv doctor", "zv topic", "zv snapshot", "zv param")
COPIES = PAGE.commands("sudo cp", "sudo mkdir")
ROUTER = "zv router --listen 'tcp/0.0.0.0:7447#so_sndbuf=32768'"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The page's site, but for the device and the addresses; the endpoint."""
    folder = tmp_path_factory.mktemp("site")
    endpoint = free_endpoint()
    with ExitStack() as running:
        words = shlex.split(ROUTER)[1:]
        words[-1] = words[-1].replace("tcp/0.0.0.0:7447", endpoint)
        running.enter_context(service(words[0], folder, *words[1:]))
        for line in PAGE.commands("zv camera", "zv tracker", "zv edge"):
            words = shlex.split(line.replace(SITE, endpoint))[1:]
            words = [word.replace("/dev/video0", "synthetic") for word in words]
            running.enter_context(service(words[0], folder, *words[1:]))

        with open_client(endpoint) as session:
            newest(session, "vision/door/centroid", START_S)
            newest(session, "vision/door/edges/compressed", START_S)
        yield endpoint


def test_every_command_is_run_here_or_it_is_said_why_not():
    starts = (*NOT_RUN_HERE, "zv camera", "zv tracker", "zv edge", "python -m benchmarks.bandwidth")
    run = {ROUTER, *TOOLS, *COPIES, *PAGE.commands(*starts)}
    assert set(PAGE.commands()) == run
    assert all(PAGE.commands(start) for start in NOT_RUN_HERE)


@pytest.mark.parametrize("line", TOOLS)
def test_a_tool_does_as_written(site, line, tmp_path):
    short = line.replace(SITE, site).replace("--for 5s", "--for 1s")
    done = run_as_written(short, tmp_path, timeout_s=60)
    # What the doctor finds wrong with a loaded machine is 1; what it cannot do is more.
    assert done.returncode in ((0, 1) if begins(line, "zv", "doctor") else (0,)), done.stderr
    if begins(line, "zv", "snapshot"):
        assert (tmp_path / "door.jpg").read_bytes().startswith(b"\xff\xd8")
    else:
        assert done.stdout.strip()


def test_the_boards_camera_says_so_when_it_has_no_device(tmp_path):
    (line,) = PAGE.commands("zv camera")
    if Path("/dev/video0").exists():
        pytest.skip("there is a device")
    words = shlex.split(line.replace(SITE, free_endpoint()))[1:]
    with Program(words, tmp_path, "camera", forked=ZV) as program:
        assert program.process.wait(START_S) == 3
        assert "/dev/video0" in program.complaints


def test_the_units_are_copied_to_where_they_look_for_their_files(tmp_path):
    for folder in ("opt", "etc/systemd/system"):
        (tmp_path / folder).mkdir(parents=True)
    for line in COPIES:
        if line == "sudo cp -r . /opt/zenoh-vision":
            continue  # with .git and .venv it is large
        placed = re.sub(r"(?<= )/(opt|etc)", rf"{tmp_path}/\1", line.removeprefix("sudo "))
        subprocess.run(placed, shell=True, cwd=ROOT, check=True)
    names = {path.name for path in (tmp_path / "etc/systemd/system").iterdir()}
    assert names == {path.name for path in UNITS.glob("*.service")}
    assert {path.name for path in (tmp_path / "etc/zenoh-vision").iterdir()} == {
        path.name for path in UNITS.glob("*.env")
    }
    lines = "".join(PAGE.commands("sudo systemctl"))
    assert {f"{unit}.service" for unit in re.findall(r"zv-\w+@?", lines)} <= names
    (clone,) = PAGE.commands("sudo cp -r")
    installed = clone.split()[-1]
    programs = tuple(f"ExecStart={installed}/.venv/bin/{name} " for name in ("zv", "python"))
    assert all(any(map(p.read_text().__contains__, programs)) for p in UNITS.glob("*.s*"))


def test_the_override_of_the_second_site_adds_to_the_routers_command():
    (block,) = PAGE.blocks("yaml")
    words = re.findall(r"^ +- (.*)$", block, re.MULTILINE)
    compose = (ROOT / "docker-compose.yml").read_text()
    given = re.search(r'^    command: (\["-c".*\])$', compose, re.MULTILINE)[1]
    ours = re.findall(r'"([^"]*)"', given)
    assert words[: len(ours)] == ours
    assert words[len(ours) :][:2] == ["-e", SITE]
    # zenohd's image passes its words on unquoted.
    assert not [word for word in words if re.search(r"\s", word)]


# Limits


def test_the_limits_of_memory_are_enough_for_the_sizes_said():
    limits = {
        re.search(r"MemoryMax=(\d+)M", unit.read_text())[1]
        for unit in UNITS.glob("*.service")
        if "zv-up" not in unit.name  # of a whole system
    }
    compose = (ROOT / "docker-compose.yml").read_text()
    limits.add(re.search(r"\$\{ZV_MEMORY:-(\d+)m\}", compose)[1])
    assert limits == {"512"}
    raised = re.findall(r"(?:ZV_MEMORY=|MemoryMax=)(\d+)[mM]", PAGE.text)
    measured = PAGE.text.partition("| frame | router |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| (\d+x\d+) \|(.*)\|$", measured, re.MULTILINE)
    most = {size: max(map(int, row.split("|"))) * 1e6 / 1024**2 for size, row in rows}
    assert list(most) == list(SIZES)
    *up_to_full_hd, largest = SIZES
    assert all(most[size] < 0.8 * 512 for size in up_to_full_hd)
    assert 512 < most[largest] < 0.9 * min(map(int, raised))


def test_the_file_for_slow_links_sets_what_the_page_says(tmp_path):
    (shown,) = [text for text in PAGE.blocks("json5") if "wait_before" in text]
    (tmp_path / "router.json5").write_text(shown)
    config = router_config("tcp/127.0.0.1:0", str(tmp_path / "router.json5"))
    assert config.get_json(WAIT_BEFORE_CLOSE) == "4000000"
    assert "must pass within a second" in PAGE.text
    assert WAIT_BEFORE_CLOSE_US == 1_000_000
