"""docs/tuning.md is true: its commands run, and the parameters that it names exist."""

from __future__ import annotations

import re
from pathlib import Path

from tests.support.processes import ROOT
from tests.support.systems import system
from tests.support.viewer.pages import Page, run_as_written
from zv.camera.settings import CameraSettings
from zv.edge.settings import EdgeSettings
from zv.tracker.settings import TrackerSettings

PAGE = Page("docs/tuning.md")
MODELS = (CameraSettings, EdgeSettings, TrackerSettings)


def test_the_commands_run_as_written_one_after_the_other(tmp_path: Path):
    with system(tmp_path, "tracker", "edge") as endpoint:
        for command in PAGE.commands():
            expected = (0, 1) if command == "zv doctor" else (0,)  # on a busy machine
            done = run_as_written(command, tmp_path, ZV_CONNECT=endpoint)
            assert done.returncode in expected, (command, done.stdout, done.stderr)


def test_every_parameter_in_the_tables_exists():
    known = set().union(*(model.model_fields for model in MODELS))
    columns = re.findall(r"^\| [^|]+ \| ([^|]+) \|", PAGE.text, re.MULTILINE)
    named = set(re.findall(r"`(\w+)(?:=\S+)?`", " ".join(columns)))
    assert len(named) > 12
    assert named <= known, named - known


def test_the_picture_is_there_and_its_settings_are_those_of_today():
    assert (ROOT / "docs" / "images" / "tuning.png").is_file()
    code = (ROOT / "docs" / "images" / "make_tuning.py").read_text()
    known = set().union(*(model.model_fields for model in MODELS))
    named = set(re.findall(r'"(\w+)": [0-9.]+', code))
    assert named
    assert named <= known, named - known
