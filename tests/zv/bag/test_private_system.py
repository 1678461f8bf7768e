"""The processes that run beside this program."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.waiting import wait_until
from zv.bag.private_system import Child, zv_command


def test_a_folder_named_zv_where_it_is_started_does_not_hide_zv(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "zv").mkdir()
    (tmp_path / "zv" / "__init__.py").touch()
    monkeypatch.chdir(tmp_path)
    with Child(zv_command("--version"), "tcp/127.0.0.1:1", "vision") as child:
        wait_until(lambda: child.status is not None)
        child.check(expected=0)
