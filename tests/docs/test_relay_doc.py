"""docs/relay.md is true: its commands publish what it says, and its launch file is read."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.support.fork_server import ZV
from tests.support.listening import open_client, wait_for_nodes
from tests.support.processes import Program
from tests.support.viewer.pages import Page
from zenoh_vision.testing import first_picture
from zv.launcher.launch_file import read_launch_file

PAGE = Page("docs/relay.md")


@pytest.mark.parametrize("command", PAGE.commands(), ids=lambda command: command[9:40])
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


def test_the_launch_file_is_read(tmp_path: Path):
    (text,) = PAGE.blocks("toml")
    (tmp_path / "up.toml").write_text(text)
    (node,) = read_launch_file(tmp_path / "up.toml").nodes
    assert node.name == "relay_front"
