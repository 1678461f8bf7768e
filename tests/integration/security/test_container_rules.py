"""The router's container takes changed rules, whenever they come and whatever zenohd does."""

from __future__ import annotations

import os
import random
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.integration.security.test_refused import service, watching
from tests.support.containers.entrypoint import Entrypoint
from tests.support.processes import missing
from tests.support.routing import port_answers
from tests.support.secured import secured
from tests.support.waiting import wait_until

TAKEN_S = 5.0
"""As docs/security.md promises, plus the time of a busy machine."""

STARTS = """#!/bin/sh
{start}
cat "$2" >>"$0.read"
{run}
"""
RUNS = "while :; do sleep 0.1; done"

New = Callable[..., Entrypoint]


@pytest.fixture
def rules(tmp_path: Path) -> Path:
    (tmp_path / "router").mkdir()
    file = tmp_path / "router" / "router.json5"
    file.write_text("rules 0\n")
    return file


@pytest.fixture
def read(tmp_path: Path) -> Callable[[], list[str]]:
    """What the stand-in for zenohd has read, at each of its starts."""
    file = tmp_path / "zenohd.read"
    return lambda: file.read_text().splitlines() if file.exists() else []


@pytest.fixture
def new(tmp_path: Path, rules: Path) -> New:
    """Start the script with a stand-in for zenohd, which starts and runs with these commands."""

    def start(start: str = "", run: str = RUNS, **times: float) -> Entrypoint:
        program = tmp_path / "zenohd"
        program.write_text(STARTS.format(start=start, run=run))
        program.chmod(0o700)
        return Entrypoint(rules, program, tmp_path, **times)

    return start


def replace(file: Path, text: str) -> None:
    """Replace a file as ``zv security`` does, by one of equal size and times."""
    about = file.stat()
    other = file.with_suffix(".new")
    other.write_text(text)
    os.utime(other, ns=(about.st_atime_ns, about.st_mtime_ns))
    other.replace(file)


def test_the_last_of_many_changes_is_taken_whenever_they_come(new: New, rules: Path, read):
    chance = random.Random(5)
    with new(start="sleep 0.1"):
        for number in range(1, 9):
            replace(rules, f"rules {number}\n")
            time.sleep(chance.uniform(0.0, 0.4))
        wait_until(lambda: read()[-1:] == ["rules 8"], 2 * TAKEN_S)
        starts = len(read())
        replace(rules, "rules 9\n")
        wait_until(lambda: read()[-1] == "rules 9", 2 * TAKEN_S)
        # Once more at most: if it read the last ones although the former were noted.
        assert len(read()) <= starts + 2


def test_rules_that_change_while_zenohd_starts_are_taken(new: New, rules: Path, read):
    """One that has read the former ones, before it can be told anything."""
    with new(run=f"sleep 0.5; {RUNS}"):
        wait_until(read)
        replace(rules, "rules 1\n")
        wait_until(lambda: read() == ["rules 0", "rules 1"], 2 * TAKEN_S)


def test_rules_that_are_half_written_are_not_taken(new: New, rules: Path, read):
    with new(look_s=1):
        wait_until(read)
        for number in (1, 2):
            time.sleep(0.5)  # half a second later it looks
            rules.write_text(f"half {number}")
            time.sleep(0.7)  # less than it takes to look twice
            rules.write_text(f"rules {number}\n")
        wait_until(lambda: read()[-1] == "rules 2", 2 * TAKEN_S)
        assert not [each for each in read() if each.startswith("half")]


def test_rules_that_cannot_be_read_leave_the_former_ones_and_it_is_said(
    new: New, rules: Path, read
):
    said = "cannot be read: the former rules hold"
    with new() as router:
        wait_until(read)
        rules.rename(rules.with_suffix(".away"))
        wait_until(lambda: said in router.said, TAKEN_S)
        time.sleep(1)  # five more looks
        rules.with_suffix(".away").rename(rules)
        replace(rules, "rules 1\n")
        wait_until(lambda: read() == ["rules 0", "rules 1"], 2 * TAKEN_S)
        assert router.said.count(said) == 1
        assert router.process.poll() is None


def test_a_zenohd_that_does_not_end_when_told_is_killed(new: New, rules: Path, read):
    with new(start="""[ -e "$0.read" ] || trap '' TERM""", grace_s=1):
        wait_until(read)
        replace(rules, "rules 1\n")
        wait_until(lambda: read() == ["rules 0", "rules 1"], 30)


def test_a_zenohd_that_dies_ends_the_container_with_its_status(new: New, rules: Path, read):
    with new(run='grep -q "rules 0" "$2" || exit 7; ' + RUNS) as router:
        wait_until(read)
        replace(rules, "wrong 1\n")
        assert router.process.wait(2 * TAKEN_S) == 7
    # Docker starts it again, with what is there then.
    replace(rules, "rules 0\n")
    before = len(read())
    with new() as router:
        wait_until(lambda: len(read()) > before)
        assert read()[-1] == "rules 0"
        router.process.terminate()
        assert router.process.wait(5) == 0


def test_a_revoked_camera_is_out_and_the_others_go_on(tmp_path: Path):
    program = shutil.which("zenohd") or missing("no zenohd; the image eclipse/zenoh has it")
    system = secured(tmp_path)
    with Entrypoint(system.file("router"), program, tmp_path) as router:
        wait_until(lambda: port_answers(system.port), 20, lambda: router.said)
        with (
            watching(system) as seen,
            service(system, "camera", tmp_path) as camera,
            service(system, "tracker", tmp_path) as tracker,
        ):
            wait_until(lambda: seen() >= {"camera_front", "tracker_front"}, 30)
            begun_s = time.monotonic()
            system.revoke("camera_front")
            wait_until(lambda: seen() == {"tracker_front"}, 60)
            said = "the router gives camera_front no rights: its certificate was revoked"
            wait_until(lambda: said in camera.complaints, 60)
            assert time.monotonic() - begun_s < 60
            assert tracker.process.poll() is None
