"""docs/doctor.md is true: its checks, remedies and statuses are the code's, its commands run."""

from __future__ import annotations

import re

import pytest

from tests.support.processes import ROOT
from tests.support.viewer.pages import Page, begins, run_as_written

PAGE = Page("docs/doctor.md")
TEXT = PAGE.text
CODE = "\n".join(path.read_text() for path in (ROOT / "services/zv/tools/doctor").glob("*.py"))
LINE = re.compile(r"(OK  |WARN|FAIL) (\w+) +\S.*")


def checks_in_code() -> set[str]:
    said = r'Finding\(\s*(?:"(?:OK|WARN|FAIL)"(?: if [^,]+)?|level),\s*"(\w+)"'
    return set(re.findall(said, CODE))


def test_every_check_has_its_section_and_there_is_no_other():
    section = TEXT.partition("## What is checked")[2]
    assert set(re.findall(r"^### (\w+)$", section, re.MULTILINE)) == checks_in_code()
    assert len(checks_in_code()) == 17


def test_the_transcript_has_the_form_of_the_tool():
    shown = PAGE.blocks("text")[1].splitlines()
    found = [LINE.fullmatch(line) for line in shown]
    assert all(found), shown
    assert {match[2] for match in found if match} <= checks_in_code()
    assert sum(line.startswith(("FAIL", "WARN")) for line in shown) >= 3


@pytest.mark.parametrize("command", PAGE.commands())
def test_a_command_runs_as_written(empty: str, command: str):
    assert begins(command, "zv", "doctor")
    short = re.sub(r"--for \d+s", "--for 1200ms", command)
    done = run_as_written(short, ROOT, ZV_CONNECT=empty)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "namespace" in done.stdout
