"""docs/security.md is true: its commands run as written, its output is what is printed."""

from __future__ import annotations

import json
import re
import urllib.request
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import zenoh

from tests.support.fork_server import ZV
from tests.support.processes import START_S, Program
from tests.support.secured import Secured, secured
from tests.support.typist import type_zv
from tests.support.viewer.pages import Page, run_as_written
from tests.support.waiting import wait_until
from zenoh_vision.cli.flags import connection_from
from zenoh_vision.security.rights import ACTIONS
from zenoh_vision.transport.link import Link
from zv.tools.registry import TOOLS

PAGE = Page("docs/security.md")
OURS = "zv security"
NEEDS_SYSTEM = ("zv topic", "zv param")


def test_every_command_of_the_tool_is_shown_or_named():
    shown = {" ".join(line.split()[1:3]) for line in PAGE.commands(OURS)}
    shown |= {f"security {word}" for word in re.findall(r"`zv security (\w+)", PAGE.text)}
    assert shown == {words for words in TOOLS if words.startswith("security ")}


def test_the_actions_are_those_of_the_code():
    rows = re.findall(r"^\| `(\w+)` \| to ", PAGE.text, re.MULTILINE)
    assert set(rows) == set(ACTIONS)


def test_the_commands_run_as_written_one_after_the_other(tmp_path: Path):
    commands = PAGE.commands(OURS)
    assert len(commands) > 6
    for command in commands:
        done = run_as_written(command, tmp_path)
        assert done.returncode == 0, (command, done.stderr)
        assert done.stdout, command
    names = {file.stem for file in (tmp_path / "security").glob("*.json5")}
    assert {"brightness_front", "camera_left", "ada", "max"} <= names
    assert (tmp_path / "security" / "far" / "router.json5").is_file()
    holders = json.loads((tmp_path / "security" / "security.json").read_text())["holders"]
    assert holders["camera_front"]["number"] == 2


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Secured]:
    """The system of ``zv up --secure``, on a free port."""
    folder = tmp_path_factory.mktemp("up")
    system = secured(folder)
    words = ["up", "--secure", system.folder, "--plain"]
    with Program(words, folder, "up", forked=ZV, ZV_CAMERA_RATE="10"):
        guest = Link(system.connection("guest", timeout_s=START_S))
        wait_until(lambda: _answers(guest.session), START_S)
        guest.close()
        yield system


def _answers(session: zenoh.Session) -> bool:
    found = [reply for reply in session.get("@vision/param/*", timeout=2.0) if reply.ok]
    return {"@vision/param/camera_front", "@vision/param/tracker_front"} <= {
        str(reply.ok.key_expr) for reply in found if reply.ok
    }


@pytest.mark.parametrize("command", PAGE.commands(*NEEDS_SYSTEM))
def test_a_tool_runs_as_written_beside_the_system(running: Secured, command: str):
    done = run_as_written(command, running.folder.parent)
    assert done.returncode == 0, done.stderr
    assert "quality: " in done.stdout or "vision/front/centroid" in done.stdout


@pytest.mark.parametrize(
    "words",
    [
        "node info camera_front",
        "param get camera_front quality",
        "topic hz vision/front/centroid --for 1s",
        "snapshot vision/front/image/compressed -o front.jpg",
        "bag record vision/front/** -o front.mcap --for 1s",
        "top --once",
    ],
)
def test_a_guest_sees_everything_with_each_tool(running: Secured, words: str):
    place = running.folder.parent
    done = type_zv([*words.split(), "--credentials", "security/guest"], folder=place)
    assert done.returncode == 0, done.stderr
    assert "may not" not in done.stderr


def test_the_doctor_finds_no_session_without_rights(running: Secured):
    words = ["doctor", "--for", "1.2", "--credentials", str(running.file("operator"))]
    done = type_zv(words, folder=running.folder.parent)
    assert "the router denies no session what it declares" in done.stdout, done.stdout


def test_a_guest_serves_metrics(running: Secured):
    words = ["metrics", "--listen", "127.0.0.1:0", "--credentials", running.file("guest")]
    with Program(words, running.folder.parent, "metrics", forked=ZV) as program:
        (url,) = wait_until(lambda: re.findall(r"http://\S+/metrics", program.output), START_S)

        def served() -> bool:
            with urllib.request.urlopen(url, timeout=5) as answer:
                return b'zenoh_vision_node_up{node="camera_front"} 1' in answer.read()

        wait_until(served, START_S)


def test_the_table_in_a_file_connects_with_certificates(running: Secured):
    file = running.folder.parent / "camera.toml"
    file.write_text(PAGE.blocks("toml")[0])
    link = Link(replace(connection_from({}, config=file), timeout_s=START_S))
    assert list(link.session.info.routers_zid())
    link.close()


def test_a_guest_is_told_that_it_may_not_set(running: Secured):
    command = "zv param set camera_front quality=60 --credentials security/guest"
    done = run_as_written(command, running.folder.parent)
    assert done.returncode == 1
    assert "guest may not query @vision/set/camera_front" in done.stderr
