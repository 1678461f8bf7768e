"""``zv new service`` writes a service that runs, and that its own test finds sound."""

from __future__ import annotations

import errno
import json
import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.fork_server import ZV
from tests.support.listening import newest, open_client
from tests.support.processes import ROOT, START_S, Program, run_program
from tests.support.secured import embedded, secured
from tests.support.systems import running_router
from tests.support.typist import type_zv
from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.testing import publishing
from zenoh_vision.transport.connection import Connection
from zv.launcher.launch_file import read_launch_file
from zv.tools.new.options import ServiceOptions
from zv.tools.new.service import check_name, run, write
from zv.tools.shared.output import Output

NAME = "wheel_count"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that it writes, outside the repository."""
    place = tmp_path_factory.mktemp("mine")
    done = type_zv(["new", "service", NAME], folder=place)
    assert done.returncode == 0, done.stderr
    wrote, next_, cd, *_ = done.stdout.splitlines()
    files = {f"{NAME}/{NAME}.py", f"{NAME}/launch.toml", f"{NAME}/test_{NAME}.py"}
    assert set(wrote.removeprefix("wrote ").split(", ")) == files
    assert (next_, cd) == ("next:", f"  cd {NAME}")
    assert {str(path.relative_to(place)) for path in place.rglob("*.*")} == files
    return place / NAME


def test_it_names_its_own_python_where_that_of_the_path_is_another(tmp_path: Path):
    (tmp_path / "bin").mkdir()
    other = tmp_path / "bin" / "python"
    other.write_text("#!/bin/sh\n")
    other.chmod(0o755)
    ours = Path(sys.executable)
    for demo, path, called in (("a", other.parent, str(ours)), ("b", ours.parent, "python")):
        command = [ours, "-m", "zv", "new", "service", NAME, "--folder", demo]
        done = run_program(command, folder=tmp_path, PATH=str(path))
        assert f"\n  {called} -m pytest " in done.stdout, done.stdout + done.stderr
        assert f"\n  {called} {NAME}.py --help " in done.stdout


def test_its_own_test_passes_where_it_stands(folder: Path):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = run_program(command, folder=folder)
    assert done.returncode == 0, done.stdout
    assert "2 passed" in done.stdout


def test_the_test_fails_if_the_service_is_wrong(folder: Path, tmp_path: Path):
    for path in folder.glob("*.py"):
        text = path.read_text().replace("value=value", "value=value + 1")
        (tmp_path / path.name).write_text(text)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = run_program(command, folder=tmp_path)
    assert done.returncode == 1, done.stdout
    assert "assert 201.0 == 200.0" in done.stdout


def test_the_service_runs_with_its_name_its_settings_and_its_schema(folder: Path, tmp_path: Path):
    with running_router(tmp_path) as endpoint:
        command = [folder / f"{NAME}.py", "--connect", endpoint, "--gain", "0"]
        with (
            Program(command, tmp_path, NAME) as program,
            publishing(endpoint, np.full((48, 64), 100, np.uint8)),
            open_client(endpoint) as session,
        ):
            result = newest(session, f"vision/front/{NAME}", START_S)
            assert result.body["value"] == 0.0
            assert result.encoding == "application/msgpack;my.WheelCount.v1"
            assert newest(session, f"@vision/param/{NAME}_front/gain").body["value"] == 0.0
            schema = json.loads(newest(session, "@vision/schema/WheelCount").payload)
            assert "mean grey level" in schema["properties"]["value"]["description"]
            assert program.interrupt() == 0
            assert "Traceback" not in program.complaints


def test_the_rights_that_it_names_are_all_that_it_needs(folder: Path, tmp_path: Path):
    printed = type_zv(["new", "service", NAME], folder=tmp_path).stdout
    (command,) = re.findall(r"^  zv (security add .+?)  ", printed, re.MULTILINE)
    system = secured(tmp_path)
    done = type_zv(command.split(), folder=tmp_path)
    assert done.returncode == 0, done.stderr

    def words(name: str) -> list[str | Path]:
        return ["--connect", system.endpoint, "--credentials", system.file(name)]

    with (
        embedded(system, tmp_path),
        Program(["camera", *words("camera_front")], tmp_path, "camera", forked=ZV),
        Program([folder / f"{NAME}.py", *words(f"{NAME}_front")], tmp_path, NAME) as program,
        system.client("guest") as session,
    ):
        assert newest(session, f"vision/front/{NAME}", START_S)
        assert newest(session, f"@vision/diagnostics/{NAME}_front", START_S)
        assert "denies" not in program.complaints


def test_its_launch_file_starts_it_beside_a_camera_and_the_viewer(folder: Path):
    nodes = read_launch_file(folder / "launch.toml").nodes
    assert [node.name for node in nodes] == ["camera_front", f"{NAME}_front", "viewer"]


def test_what_it_writes_is_formatted_and_has_no_flaw_that_the_linter_knows(folder: Path):
    ruff = Path(sys.executable).with_name("ruff")
    rules = ["--config", str(ROOT / "pyproject.toml")]
    check = [ruff, "check", *rules, "--ignore", "D103,S101", folder]
    for command in (check, [ruff, "format", "--check", *rules, folder]):
        done = run_program(command, folder=folder)
        assert done.returncode == 0, done.stdout + done.stderr


def test_nothing_is_overwritten(tmp_path: Path):
    (tmp_path / NAME).mkdir()
    done = type_zv(["new", "service", NAME], folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr == (
        f"zv: {NAME} exists already, and nothing is overwritten; give another NAME or --folder\n"
    )
    assert list((tmp_path / NAME).iterdir()) == []
    assert type_zv(["new", "service", NAME, "--folder", "a/b"], folder=tmp_path).returncode == 0
    assert (tmp_path / "a/b" / f"{NAME}.py").is_file()


def test_a_folder_that_cannot_be_written_is_3_and_one_line(tmp_path: Path):
    (tmp_path / "file").touch()
    done = type_zv(["new", "service", NAME, "--folder", "file/x"], folder=tmp_path)
    assert (done.returncode, done.stderr) == (3, "zv: file/x: Not a directory\n")


def test_a_full_disk_leaves_nothing_half_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write_text = Path.write_text

    def full(path: Path, text: str, **form: Any) -> int:
        if path.name == "launch.toml":
            write_text(path, text[:100], **form)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write_text(path, text, **form)

    monkeypatch.setattr(Path, "write_text", full)
    options = ServiceOptions(name=NAME, folder=str(tmp_path / "mine"))
    with pytest.raises(SourceError, match="mine: No space left on device"):
        run(options, Connection(), Output(as_json=False))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["Wheel", "2d", "a-b", "a.b", "../x", "", "x" * 41, "ä"])
def test_an_invalid_name_is_refused_before_anything_is_written(name: str, tmp_path: Path):
    done = type_zv(["new", "service", name], folder=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith(f"zv: command line: NAME = {name!r} is not allowed")
    assert "; allowed: letters a-z, digits and _, a letter first, at most 40" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("tracker", "is a service of zv"),
        ("centroid", "begins the key of a topic"),
        ("edges", "begins the key of a topic"),
        ("lambda", "is a word of Python's grammar"),
        ("queue", "is a module of Python"),
        ("numpy", "an installed one"),
        ("zenoh_vision", "an installed one"),
    ],
)
def test_a_name_that_is_taken_is_refused(name: str, why: str):
    with pytest.raises(ConfigurationError, match=why):
        check_name(name)


def test_every_name_that_is_allowed_gives_a_message_of_its_own(tmp_path: Path):
    for name, message in {"node": "Node", "a__b": "AB", "wheel_2d": "Wheel2d"}.items():
        service, _, _ = write(name, tmp_path / name)
        assert f'"my.{message}.v1"' in service.read_text()
        compile(service.read_text(), service, "exec")
