"""The file of a router is looked at again when it, or who may read it, changes."""

from __future__ import annotations

import os
import shutil
import time

import pytest

from tests.support.secured import secured
from zenoh_vision.errors import ConfigurationError
from zv.router import rules
from zv.router.rules import RouterRules

ANY = "tcp/127.0.0.1:0"


def test_a_file_that_others_can_read_is_taken_once_its_mode_is_mended(tmp_path, monkeypatch):
    monkeypatch.setattr(rules, "LOOK_S", 0.0)
    system = secured(tmp_path)
    file = system.file("router")
    followed = RouterRules(str(file), ANY)
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
    followed = RouterRules(str(file), ANY)
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
    followed = RouterRules(str(system.file(name)), ANY)
    system.file(name).write_text("{")
    assert not followed.changed()
    assert f"zv security renew {name} --dir {system.folder} writes it again" in followed.fault


def test_a_file_is_compared_by_what_is_in_it(tmp_path, monkeypatch):
    """Its size, times and inode may be those of the former one."""
    monkeypatch.setattr(rules, "LOOK_S", 0.0)
    file = secured(tmp_path).file("router")
    followed = RouterRules(str(file), ANY)
    about, text = file.stat(), file.read_text()
    file.write_text(text.replace("It holds", "It HOLDS"))
    os.utime(file, ns=(about.st_atime_ns, about.st_mtime_ns))
    now = file.stat()
    assert (now.st_mtime_ns, now.st_size, now.st_ino) == (
        about.st_mtime_ns,
        about.st_size,
        about.st_ino,
    )
    assert followed.changed()
    file.touch()
    assert not followed.changed()


def test_the_router_runs_with_the_text_that_was_checked(tmp_path, monkeypatch):
    monkeypatch.setattr(rules, "LOOK_S", 0.0)
    system = secured(tmp_path)
    file = system.file("router")
    followed = RouterRules(str(file), ANY)
    system.revoke("camera_front")
    assert followed.changed()
    file.write_text("{")  # before it is opened
    assert "camera_front: announce" not in followed.config.get_json("access_control")
    assert not followed.changed()
    assert "cut short or damaged" in followed.fault


def test_rules_with_which_no_router_can_run_give_way_to_the_former_ones(tmp_path, monkeypatch):
    monkeypatch.setattr(rules, "LOOK_S", 0.0)
    system = secured(tmp_path)
    followed = RouterRules(str(system.file("router")), ANY)
    former = followed.config
    assert not followed.reject(ConfigurationError("at the start"))
    good = system.file("router").read_text()
    system.file("router").write_text(f"{good}\n")
    assert followed.changed()
    assert followed.reject(ConfigurationError("the key is another's"))
    assert followed.config is former
    assert not followed.changed()
    assert followed.fault == "the former rules hold: the key is another's"
    assert not followed.reject(ConfigurationError("nor with these"))
    system.file("router").write_text(good)
    assert not followed.changed()
    assert followed.fault == ""


def test_rules_that_only_the_system_refused_are_tried_again(tmp_path, monkeypatch):
    monkeypatch.setattr(rules, "LOOK_S", 0.0)
    system = secured(tmp_path)
    followed = RouterRules(str(system.file("router")), ANY)
    system.revoke("guest")
    assert followed.changed()
    assert followed.reject(ConfigurationError("Address in use (os error 98)"))
    assert not followed.changed()
    monkeypatch.setattr(followed, "_retry_s", 0.0)  # the time is over
    assert followed.changed()
    assert "guest: " not in followed.config.get_json("access_control")
    assert followed.fault == ""


def test_a_router_says_once_that_its_certificate_ends_and_that_it_has_ended(
    tmp_path, monkeypatch, caplog
):
    monkeypatch.setattr(rules, "LOOK_S", 0.0)
    system = secured(tmp_path, days=40)
    followed = RouterRules(str(system.file("router")), ANY)
    now_s = time.time()

    def after(days: float) -> str:
        monkeypatch.setattr(time, "time", lambda: now_s + days * 24 * 3600)
        return followed.trouble()

    renewal = f"zv security renew router --dir {system.folder}"
    assert after(9) == ""
    assert caplog.messages == []
    assert after(11) == after(11.001) == ""
    (warned,) = caplog.messages
    assert warned.startswith("the certificate of router ends 2")
    assert warned.endswith(f", in 29 days: {renewal}")
    assert after(41).startswith("the certificate of router ended 2")
    assert after(41.01).endswith(f": {renewal}, unless the clock is wrong")
    assert [record.levelname for record in caplog.records] == ["WARNING", "ERROR"]
    assert "the certificate of router is valid from 2" in after(-1)
    monkeypatch.undo()
    caplog.clear()
    monkeypatch.setattr(rules, "LOOK_S", 0.0)
    system.renew("router", days=300)
    assert followed.changed()
    assert followed.trouble() == ""
    assert caplog.messages == []


def test_a_router_is_named_as_its_certificate_names_it_wherever_its_file_is(
    tmp_path, monkeypatch, caplog
):
    system = secured(tmp_path, days=20)
    system.add(router="far", host=("far.example",))
    system.revoke("far")
    system.add(router="far", host=("far.example",))
    copied = shutil.copy(system.file("far"), tmp_path)
    assert RouterRules(str(copied), ANY).trouble() == ""
    monkeypatch.chdir(system.file("far").parent)
    assert RouterRules("router.json5", ANY).trouble() == ""
    assert [said.split()[3] for said in caplog.messages] == ["far", "far"]
    assert caplog.messages[1].endswith(f": zv security renew far --dir {system.folder}")
    system.file("far").write_text("{")
    with pytest.raises(ConfigurationError, match=f"renew far --dir {system.folder} writes"):
        RouterRules("router.json5", ANY)


def test_a_router_with_a_certificate_of_its_own_making_is_not_judged(tmp_path):
    system = secured(tmp_path)
    content = system.content("router")
    del content["transport"]["link"]["tls"]["listen_certificate_base64"]
    system.rewrite("router", content)
    assert RouterRules(str(system.file("router")), ANY).trouble() == ""
