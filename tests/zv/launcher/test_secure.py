"""A launched node without a certificate: the command that gives it one."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.support.secured import Secured
from zenoh_vision.errors import SourceError
from zv.launcher.launch_file import read_launch_file
from zv.launcher.secure import SecureFiles

KEYS = "--publishes KEY --subscribes KEY"


@pytest.mark.parametrize(
    ("node", "said"),
    [
        ('service = "camera"\ncamera = "left"', "--camera left"),
        (
            'service = "tracker"\ncamera = "front,left"',
            "--node tracker --camera front --camera left",
        ),
        ('service = "relay"\nsettings = { to = "flat" }', f"--node relay_flat {KEYS}"),
        (
            f'service = "wheel_count"\ncamera = "front"\ncommand = "{sys.executable}"',
            f"--node wheel_count_front {KEYS}",
        ),
        ('service = "viewer"', "--node viewer"),
    ],
)
def test_the_command_that_adds_a_node_is_the_right_one(tmp_path: Path, node: str, said: str):
    system = Secured(tmp_path / "security", 7447).init()
    system.revoke("viewer")
    (tmp_path / "up.toml").write_text(f"[[node]]\n{node}\n")
    nodes = read_launch_file(tmp_path / "up.toml").nodes
    with pytest.raises(SourceError) as raised:
        SecureFiles.of(str(system.folder), nodes, "vision")
    assert str(raised.value).endswith(f": zv security add {said} --dir {system.folder}")
