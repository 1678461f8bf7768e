"""docs/doctor.md is true: its checks, remedies and statuses are the code's, its commands run."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from services.tools.doctor.remedies import REMEDIES
from tests.processes import ROOT, START_S, environment, router

TEXT = (ROOT / "docs" / "doctor.md").read_text()
CODE = "\n".join(path.read_text() for path in (ROOT / "services/tools/doctor").glob("*.py"))
SHELL = "\n".join(re.findall(r"^```sh\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL))
COMMANDS = SHELL.splitlines()
LINE = re.compile(r"(OK  |WARN|FAIL) (\w+) +\S.*")


def checks_in_code() -> set[str]:
    said = r'Finding\(\s*(?:"(?:OK|WARN|FAIL)"(?: if [^,]+)?|level),\s*"(\w+)"'
    return set(re.findall(said, CODE))


def test_every_check_has_its_section_and_there_is_no_other():
    section = TEXT.partition("## What is checked")[2]
    assert set(re.findall(r"^### (\w+)$", section, re.MULTILINE)) == checks_in_code()
    assert len(checks_in_code()) == 13


def test_the_remedies_are_those_of_the_code():
    rows = re.findall(r"^\| (`\w+`(?: `\w+`)*) \| (.*) \| (.*) \|$", TEXT, re.MULTILINE)
    shown = {
        reason: (words, parameter)
        for reasons, words, parameter in rows
        for reason in re.findall(r"\w+", reasons)
    }
    whose = {"own": "", "camera": " of the camera"}
    assert shown == {
        reason: (
            remedy.words,
            f"`{remedy.parameter}`{whose[remedy.whose]}" if remedy.parameter else "-",
        )
        for reason, remedy in REMEDIES.items()
    }


def test_the_transcript_has_the_form_of_the_tool():
    shown = re.findall(r"^```text\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)[1].splitlines()
    found = [LINE.fullmatch(line) for line in shown]
    assert all(found), shown
    assert {match[2] for match in found if match} <= checks_in_code()
    assert sum(line.startswith(("FAIL", "WARN")) for line in shown) >= 3


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory):
    program, endpoint = router(tmp_path_factory.mktemp("router"))
    with program:
        yield endpoint


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_runs_as_written(endpoint: str, command: str):
    program, *words = shlex.split(command)
    assert program == "zv"
    short = [re.sub(r"^\d+s$", "1200ms", word) for word in words]
    done = subprocess.run(
        [sys.executable, "-m", "services", *short],
        capture_output=True,
        text=True,
        cwd=Path(ROOT),
        env={**environment(), "ZV_CONNECT": endpoint},
        timeout=START_S,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "namespace" in done.stdout
