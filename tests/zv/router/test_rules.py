"""The file of a router is looked at again when it, or who may read it, changes."""

from __future__ import annotations

import pytest

from tests.support.secured import secured
from zv.router import rules
from zv.router.rules import RouterRules


def test_a_file_that_others_can_read_is_taken_once_its_mode_is_mended(tmp_path, monkeypatch):
    monkeypatch.setattr(rules, "LOOK_S", 0.0)
    system = secured(tmp_path)
    file = system.file("router")
    followed = RouterRules(str(file))
    assert not followed.changed()
    text = file.read_text()
    file.write_text(f"{text}\n")
    file.chmod(0o644)
    assert not followed.changed()
    assert "its mode is 0644" in followed.fault
    file.chmod(0o600)
    assert followed.changed()
    assert followed.fault == ""


def test_a_file_that_is_as_it_was_taken_has_no_fault(tmp_path, monkeypatch):
    monkeypatch.setattr(rules, "LOOK_S", 0.0)
    file = secured(tmp_path).file("router")
    followed = RouterRules(str(file))
    for wrong in (lambda: file.chmod(0o640), lambda: file.rename(f"{file}.away")):
        wrong()
        assert not followed.changed()
        assert "the former rules hold" in followed.fault
        away = file.with_name(f"{file.name}.away")
        if away.exists():
            away.rename(file)
        file.chmod(0o600)
        assert not followed.changed()
        assert followed.fault == ""


@pytest.mark.parametrize("name", ["router", "far"])
def test_a_damaged_file_is_told_with_the_command_that_writes_it_again(tmp_path, monkeypatch, name):
    monkeypatch.setattr(rules, "LOOK_S", 0.0)
    system = secured(tmp_path)
    system.add(router="far", host=("far.example",))
    followed = RouterRules(str(system.file(name)))
    system.file(name).write_text("{")
    assert not followed.changed()
    assert f"zv security renew {name} --dir {system.folder} writes it again" in followed.fault
