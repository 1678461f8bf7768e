"""docs/events.md and docs/index.md are true: commands and programs run, shapes are read."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import get_args

import pytest

from tests.support.fork_server import SCRIPT
from tests.support.processes import Program
from tests.support.typist import type_zv, zv
from tests.support.viewer.pages import Page, begins, run_as_written
from zv.tracker.events.event import Kind
from zv.tracker.settings import TrackerSettings
from zv.tracker.shapes import lines, polygons

PAGE, INDEX = Page("docs/events.md"), Page("docs/index.md")


@pytest.mark.parametrize("page", [PAGE, INDEX], ids=lambda page: page.name)
def test_the_commands_run_as_written_one_after_the_other(page: Page, endpoint: str, tmp_path: Path):
    for command in page.commands():
        once = " --once" if begins(command, "zv", "topic") and "--once" not in command else ""
        done = run_as_written(command + once, tmp_path, ZV_CONNECT=endpoint)
        assert done.returncode == 0, (command, done.stdout, done.stderr)
        assert done.stdout or "at revision" in done.stderr
    name, _, shape = page.commands("zv param set")[0].split('"')[1].partition("=")
    assert shape in zv(endpoint, "param", "get", "tracker_front", name).stdout


def test_the_first_program_prints_events(endpoint: str, tmp_path: Path):
    program = tmp_path / "watch.py"
    program.write_text(INDEX.blocks("python")[0].replace("tcp/127.0.0.1:7447", endpoint))
    with Program([program], tmp_path, "watch", SCRIPT) as running:
        running.lines(r"(started|confirmed|zone_entered) \d+ (None|middle)", count=2)
        assert running.interrupt() == 0


def test_the_refusal_is_as_shown(endpoint: str):
    shown = PAGE.blocks("text")[0].strip()
    value = shown.split("'")[1]
    done = zv(endpoint, "param", "set", "tracker_front", f"zones={value}")
    assert done.returncode == 2
    assert shown in done.stderr


def test_the_program_runs_as_written(endpoint: str, tmp_path: Path):
    program = tmp_path / "last_events.py"
    program.write_text(PAGE.blocks("python")[0])
    done = type_zv([program, endpoint], program=SCRIPT)
    assert done.returncode == 0, done.stderr


def test_the_shapes_in_toml_are_read():
    settings = TrackerSettings(**tomllib.loads(PAGE.blocks("toml")[0]))
    assert [zone.name for zone in polygons(settings.zones)] == ["belt", "door"]
    assert [line.unit for line in lines(settings.lines)] == ["pixels", "world"]


def test_the_table_names_every_event():
    rows = [line.split("`")[1] for line in PAGE.text.splitlines() if line.startswith("| `")]
    assert set(get_args(Kind)) <= set(rows)
