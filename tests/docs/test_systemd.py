"""The units under examples/systemd are what systemd accepts, closed as they say, and run."""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.support.fork_server import ZV
from tests.support.listening import newest, open_client
from tests.support.processes import ROOT, STOP_S, Program, need, run_program
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
    program = need("systemd-analyze", "systemd")
    return run_program([program, "--no-pager", "--man=no", *arguments])


def settings_of(path: Path) -> dict[str, str]:
    """Return the variables that an environment file sets."""
    lines = path.read_text().splitlines()
    return dict(line.split("=", 1) for line in lines if line and not line.startswith("#"))


def value(unit: Path, key: str) -> list[str]:
    return re.findall(rf"^{key}=(.*)$", unit.read_text(), re.MULTILINE)


OWN = {"up": "a launch file", "own": "a service of one's own"}
"""Units beside those of the services, and what they run."""


def name_of(unit: Path) -> str:
    return re.sub(r"^zv-|@?\.service$", "", unit.name)


def test_there_is_a_unit_for_each_service_for_a_launch_file_and_for_a_service_of_ones_own():
    assert {name_of(unit) for unit in UNITS} == set(SERVICES) | set(OWN)


def test_systemd_has_nothing_to_say_against_the_units(tmp_path):
    program = tmp_path / "zv"  # it looks whether there is one
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    copies = []
    for unit in UNITS:
        copies.append(tmp_path / unit.name.replace("@", "@front"))
        text = unit.read_text()
        (command,) = value(unit, "ExecStart")
        assert command.startswith((f"{INSTALLED} ", f"{Path(INSTALLED).parent}/python "))
        copies[-1].write_text(text.replace(command.split()[0], str(program)))
    done = analyze("verify", *copies)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.stem)
def test_a_service_is_closed_against_the_rest_of_the_machine(unit, tmp_path):
    copy = tmp_path / unit.name.replace("@", "@front")
    copy.write_text(unit.read_text())
    done = analyze("security", "--offline=true", f"--threshold={EXPOSURE}", copy)
    assert done.returncode == 0, done.stdout[-200:]


def test_only_the_camera_reaches_devices():
    for unit in UNITS:
        found = value(unit, "PrivateDevices"), value(unit, "DeviceAllow")
        has_cameras = name_of(unit) in ("camera", "up")
        assert found == (([], ["char-video4linux rw"]) if has_cameras else (["yes"], []))


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
    service = name_of(unit)
    alone = service not in OWN and not SERVICES[service].of_camera
    assert files[1].name == (f"{service}.env" if alone else f"{service}-%i.env")


def test_the_units_commands_make_a_system_and_end_with_sigterm(tmp_path):
    endpoint = free_endpoint()
    with ExitStack() as running:
        programs = []
        for unit in (unit for unit in UNITS if name_of(unit) not in OWN):
            given: dict[str, str] = {}
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
            program = Program(command[1:], tmp_path, unit.stem, forked=ZV, cwd=tmp_path, **given)
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


def test_the_unit_of_a_launch_file_runs_its_nodes_and_ends_with_sigterm(tmp_path):
    unit = FOLDER / "zv-up@.service"
    file = tmp_path / "site.toml"
    endpoint = free_endpoint()
    file.write_text(f'[router]\nlisten = "{endpoint}"\n[[node]]\nservice = "camera"\n')
    (command,) = value(unit, "ExecStart")
    words = shlex.split(command.replace("/etc/zenoh-vision/%i.toml", str(file)))
    assert words[0] == INSTALLED
    with Program(words[1:], tmp_path, "up", forked=ZV) as program:
        program.lines(r"camera_front +running +rate.*")
        program.process.send_signal(signal.SIGTERM)
        assert program.process.wait(STOP_S) == 0
