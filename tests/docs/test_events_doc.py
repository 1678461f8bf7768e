"""docs/events.md is true: its commands and programs run as written, its shapes are read."""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import pytest

from tests.support.processes import run_program
from tests.support.systems import system
from tests.support.typist import zv
from tests.support.viewer.pages import Page, run_as_written
from zv.tracker.events.event import Kind
from zv.tracker.settings import TrackerSettings
from zv.tracker.shapes import lines, polygons

PAGE = Page("docs/events.md")


@pytest.fixture(scope="module")
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Of a router, the synthetic camera and a tracker."""
    with system(tmp_path_factory.mktemp("system"), "tracker") as endpoint:
        yield endpoint


def test_the_line_is_set_as_written(endpoint: str, tmp_path: Path):
    (command,) = PAGE.commands("zv param set")
    done = run_as_written(command, tmp_path, ZV_CONNECT=endpoint)
    assert done.returncode == 0, done.stderr
    assert "gate 320,60 320,480" in zv(endpoint, "param", "get", "tracker_front", "lines").stdout


def test_the_events_of_the_synthetic_scene_are_printed(endpoint: str, tmp_path: Path):
    (command,) = PAGE.commands("zv topic echo")
    done = run_as_written(f"{command} --once", tmp_path, ZV_CONNECT=endpoint)
    assert done.returncode == 0, done.stderr
    assert "event" in done.stdout


def test_the_refusal_is_as_shown(endpoint: str):
    shown = PAGE.blocks("text")[0].strip()
    value = shown.split("'")[1]
    done = zv(endpoint, "param", "set", "tracker_front", f"zones={value}")
    assert done.returncode == 2
    assert shown in done.stderr


def test_the_program_runs_as_written(endpoint: str, tmp_path: Path):
    program = tmp_path / "last_events.py"
    program.write_text(PAGE.blocks("python")[0])
    done = run_program([sys.executable, program, endpoint])
    assert done.returncode == 0, done.stderr


def test_the_shapes_in_toml_are_read():
    settings = TrackerSettings(**tomllib.loads(PAGE.blocks("toml")[0]))
    assert [zone.name for zone in polygons(settings.zones)] == ["belt", "door"]
    assert [line.unit for line in lines(settings.lines)] == ["pixels", "world"]


def test_the_table_names_every_event():
    rows = [line.split("`")[1] for line in PAGE.text.splitlines() if line.startswith("| `")]
    assert set(get_args(Kind)) <= set(rows)
