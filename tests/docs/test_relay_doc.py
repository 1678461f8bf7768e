"""docs/relay.md is true: its commands publish what it says, and its launch file is read."""

from __future__ import annotations

import shlex
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support.fork_server import ZV
from tests.support.listening import Listener, open_client, wait_for_nodes
from tests.support.processes import Program
from tests.support.secured import embedded, secured
from tests.support.viewer.pages import Page, run_as_written
from zenoh_vision.testing import first_picture
from zv.launcher.launch_file import read_launch_file

PAGE = Page("docs/relay.md")


@pytest.mark.parametrize("command", PAGE.commands("zv relay"), ids=lambda command: command[9:40])
def test_each_command_runs_as_written_and_ends_with_ctrl_c(
    command: str, endpoint: str, tmp_path: Path
):
    words = shlex.split(command)[1:]
    is_camera = "--to" in words
    with (
        Program(words, tmp_path, "relay", forked=ZV, ZV_CONNECT=endpoint) as program,
        open_client(endpoint) as session,
    ):
        wait_for_nodes(session, "relay_front_flat" if is_camera else "relay_front")
        if not is_camera:  # the synthetic camera has no lens to rectify
            frame = first_picture(endpoint, "relayed/compressed")
            assert (frame.header.camera, frame.header.node[:6]) == ("front", "relay_")
        assert program.interrupt() == 0


def test_a_relay_with_the_certificate_of_the_page_is_a_camera_of_its_own(tmp_path: Path):
    system = secured(tmp_path)
    commands = PAGE.commands("zv security")
    for command in commands:
        done = run_as_written(command, tmp_path)
        assert done.returncode == 0, done.stderr
    with embedded(system, tmp_path), ExitStack() as running:
        for words in (["camera"], ["relay", "--camera", "front", "--to", "front_flat"]):
            name = "camera_front" if words == ["camera"] else "relay_front_flat"
            words += ["--connect", system.endpoint, "--credentials", system.file(name)]
            program = running.enter_context(Program(words, tmp_path, name, forked=ZV))
        with system.client("tracker_front_flat") as tracker:
            received = Listener(tracker, "vision/front_flat/image/compressed")
            # A node looks every 3 s what is denied to it.
            assert received.wait_for(60)
        assert "denies" not in program.complaints


def test_the_launch_file_is_read(tmp_path: Path):
    (text,) = PAGE.blocks("toml")
    (tmp_path / "up.toml").write_text(text)
    (node,) = read_launch_file(tmp_path / "up.toml").nodes
    assert node.name == "relay_front"
