"""The units under examples/systemd are what systemd accepts, closed as they say, and run."""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support import processes
from tests.support.listening import newest, open_client
from tests.support.processes import ROOT, STOP_S, Program, environment, need
from tests.support.routing import free_endpoint
from tests.support.waiting import wait_until
from zenoh_vision.cli.flags import ConnectionSettings
from zv.registry import SERVICES, model_of

FOLDER = ROOT / "examples" / "systemd"
UNITS = sorted(FOLDER.glob("*.service"))
FILES = sorted(FOLDER.glob("*.env"))
INSTALLED = "/opt/zenoh-vision/.venv/bin/zv"
EXPOSURE = 20  # of 100; systemd's own estimate, and it says OK to it


def analyze(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [need("systemd-analyze", "systemd"), "--no-pager", "--man=no", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def settings_of(path: Path) -> dict[str, str]:
    """Return the variables that an environment file sets."""
    lines = path.read_text().splitlines()
    return dict(line.split("=", 1) for line in lines if line and not line.startswith("#"))


def value(unit: Path, key: str) -> list[str]:
    return re.findall(rf"^{key}=(.*)$", unit.read_text(), re.MULTILINE)


def test_there_is_a_unit_for_each_service():
    assert {re.sub(r"^zv-|@?\.service$", "", unit.name) for unit in UNITS} == set(SERVICES)


def test_systemd_has_nothing_to_say_against_the_units(tmp_path):
    program = tmp_path / "zv"  # it looks whether there is one
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    copies = []
    for unit in UNITS:
        copies.append(tmp_path / unit.name.replace("@", "@front"))
        text = unit.read_text()
        assert text.count(INSTALLED) == 1
        copies[-1].write_text(text.replace(INSTALLED, str(program)))
    done = analyze("verify", *copies)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_mistake_in_a_unit_would_be_found(tmp_path):
    wrong = UNITS[0].read_text().replace("ProtectClock", "ProtectClok")
    wrong = wrong.replace(INSTALLED, "/bin/true")
    (tmp_path / "zv-wrong.service").write_text(wrong)
    assert "ProtectClok" in analyze("verify", tmp_path / "zv-wrong.service").stderr


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_a_service_is_closed_against_the_rest_of_the_machine(unit, tmp_path):
    copy = tmp_path / unit.name.replace("@", "@front")
    copy.write_text(unit.read_text())
    done = analyze("security", "--offline=true", f"--threshold={EXPOSURE}", copy)
    assert done.returncode == 0, done.stdout[-200:]


def test_only_the_camera_reaches_devices():
    for unit in UNITS:
        closed = value(unit, "PrivateDevices") == ["yes"]
        devices = value(unit, "DeviceAllow")
        assert (closed, devices) == (
            (False, ["char-video4linux rw"]) if "camera" in unit.name else (True, [])
        )


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_an_environment_file_names_settings_that_there_are(path):
    named = re.findall(r"^#?(ZV_\w+)=(.*)$", path.read_text(), re.MULTILINE)
    known = {f"ZV_{name.upper()}" for name in ConnectionSettings.model_fields}
    for service in SERVICES:
        model = model_of(service)
        known |= {f"{model.env_prefix}{name.upper()}" for name in model.model_fields}
    assert named
    assert {name for name, _ in named} <= known
    # A machine that takes the files as they are gets what it gets without them.
    assert path.read_text().startswith(f"# /etc/zenoh-vision/{path.name}: ")


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_a_unit_reads_the_files_that_are_there(unit):
    files = [Path(named.removeprefix("-")) for named in value(unit, "EnvironmentFile")]
    assert all(path.parent == Path("/etc/zenoh-vision") for path in files)
    assert files[0].name == "all.env"
    assert FOLDER / "all.env" in FILES
    service = re.sub(r"^zv-|@?\.service$", "", unit.name)
    alone = not SERVICES[service].of_camera
    assert files[1].name == (f"{service}.env" if alone else f"{service}-%i.env")


def test_the_units_commands_make_a_system_and_end_with_sigterm(tmp_path, monkeypatch):
    endpoint = free_endpoint()
    plain = environment()
    with ExitStack() as running:
        programs = []
        for unit in UNITS:
            given = dict(plain)
            for named in value(unit, "EnvironmentFile"):
                file = FOLDER / Path(named.replace("%i", "front")).name
                given |= settings_of(file) if file.exists() else {}
            assert given["ZV_CONNECT"] == "tcp/127.0.0.1:7447"
            given["ZV_CONNECT"] = endpoint
            if "router" in unit.name:
                assert given["ZV_ROUTER_LISTEN"] == "tcp/127.0.0.1:7447"
                given["ZV_ROUTER_LISTEN"] = endpoint
            if "viewer" in unit.name:
                given["ZV_VIEWER_PORT"] = "0"
            command = shlex.split(value(unit, "ExecStart")[0].replace("%i", "front"))
            assert command[0] == INSTALLED
            monkeypatch.setattr(processes, "environment", lambda given=given: given)
            program = Program(["-m", "zv", *command[1:]], tmp_path, unit.stem)
            programs.append(running.enter_context(program))

        def opened() -> bool:
            return "router listens" in "".join(program.complaints for program in programs)

        wait_until(opened, explain=lambda: programs[0].complaints)
        with open_client(endpoint) as session:
            newest(session, "vision/front/centroid")
            newest(session, "vision/front/edges/compressed")
        for program in programs:
            program.process.send_signal(signal.SIGTERM)
        assert [program.process.wait(STOP_S) for program in programs] == [0] * len(programs)
