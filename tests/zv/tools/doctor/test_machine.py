"""What zv doctor finds out about this machine: files and devices."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from zv.registry import SERVICES, model_of
from zv.tools.doctor.machine import device_findings, file_findings, kind_of

ROOT = Path(__file__).parents[4]


def found(*files: Path, zenoh_config: str | None = None) -> list[tuple[str, str, str]]:
    findings = file_findings([str(file) for file in files], zenoh_config)
    return [(finding.level, finding.check, finding.text) for finding in findings]


def written(folder: Path, name: str, text: str) -> Path:
    file = folder / name
    file.write_text(text)
    return file


# Files


def test_the_files_of_the_project_are_right_and_checked_without_being_named(monkeypatch):
    monkeypatch.chdir(ROOT)
    ((level, check, text),) = found()
    assert (level, check) == ("OK", "files")
    for file in ROOT.glob("configs/*.*"):
        assert f"configs/{file.name}" in text


def test_no_file_to_check_is_reported(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ((level, _, text),) = found()
    assert level == "OK"
    assert "no folder configs/" in text


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("camera.toml", "rate = 2000.0\n", ["rate = 2000.0", "to 1000"]),
        ("my-tracker.toml", "historie = 5\n", ["'historie'", "did you mean 'history'"]),
        ("edge_left.toml", "sigma = \n", ["not TOML", "line 1"]),
        ("up.toml", "[router]\nlisen = 1\n", ["lisen", "did you mean 'listen'"]),
        ("lab.toml", '[[node]]\nservice = "trakker"\n', ["node[0].service", "'tracker'"]),
        ("lab.toml", "[[node]]\nservice = 'edge'\nsettings = { sigma = -1 }\n", ["sigma = -1"]),
        ("camera.toml", "[connection]\nname = 'a'\n", ["name", "'namespace'"]),
        (
            "camera.toml",
            "[connection]\ncredentials = 'no'\n",
            ["[connection]: credentials", "/no: no such file"],
        ),
        ("other.toml", "colour = 'red'\n", ["colour", "options of no service", "camera, tracker"]),
        ("a.json5", "{ \n mode: 'kraken' }", ["line 2", "mode", "kraken", "`router`"]),
        ("b.json5", "{ mod: 'router' }", ["line 1", "unknown field `mod`", "`listen`"]),
        ("c.json5", "{ mode: ", ["expected"]),
    ],
)
def test_a_file_that_parses_no_more_is_named_with_key_and_what_is_allowed(
    tmp_path, name, text, named
):
    file = written(tmp_path, name, text)
    ((level, check, said),) = found(file)
    assert (level, check) == ("FAIL", "files")
    assert [part for part in (str(file), *named) if part not in said] == []


def test_files_that_are_not_there_fail(tmp_path):
    levels = [level for level, _, _ in found(tmp_path / "no.toml", tmp_path / "no.json5")]
    assert levels == ["FAIL", "FAIL"]


def test_a_mistyped_variable_fails_once_however_many_files_there_are(tmp_path, monkeypatch):
    monkeypatch.setenv("ZV_EDGE_SIGMAA", "3")
    files = [written(tmp_path, f"edge_{n}.toml", "sigma = 2.0\n") for n in range(3)]
    texts = [text for level, _, text in found(*files) if level == "FAIL"]
    assert len(texts) == 1
    assert "ZV_EDGE_SIGMAA" in texts[0]


@pytest.mark.parametrize(
    ("text", "shared"),
    [
        ("{ mode: 'router' }", True),  # Zenoh's default
        ("{ transport: { shared_memory: { enabled: true } } }", True),
        ("{ transport: { shared_memory: { enabled: false } } }", False),
    ],
)
def test_a_zenoh_file_that_leaves_shared_memory_on_is_a_warning(tmp_path, text, shared):
    file = written(tmp_path, "z.json5", text)
    given = found(file)
    assert (("WARN", "memory") in [line[:2] for line in given]) == shared
    also = found(written(tmp_path, "edge.toml", ""), zenoh_config=str(file))
    assert (("WARN", "memory") in [line[:2] for line in also]) == shared


@pytest.mark.parametrize("service", SERVICES)
def test_a_file_without_a_telling_name_is_known_by_its_keys(service):
    keys = dict.fromkeys(set(model_of(service).model_fields) - {"camera", "quality", "max_age"}, 1)
    assert kind_of(Path("mine.toml"), keys) == service


# Devices


def test_a_machine_without_devices_is_ok_with_a_note(tmp_path):
    (finding,) = device_findings(tmp_path)
    assert finding.level == "OK"
    assert "no video device" in finding.text


@pytest.mark.parametrize("permitted", [True, False])
def test_a_device_is_judged_by_the_permission_to_use_it(tmp_path, monkeypatch, permitted):
    (tmp_path / "dev").mkdir()
    (tmp_path / "dev" / "video0").touch()
    # Root may read everything, so taking the permission away would not do.
    monkeypatch.setattr(os, "access", lambda *_: permitted)
    (finding,) = device_findings(tmp_path)
    assert finding.level == ("OK" if permitted else "WARN")
    assert "/dev/video0" in finding.text
    assert ("usermod -aG video" in finding.remedy) != permitted
