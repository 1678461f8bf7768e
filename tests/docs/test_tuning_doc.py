"""docs/tuning.md is true: its commands are accepted, and the parameters that it names exist."""

from __future__ import annotations

import re
import shlex

from tests.support.processes import ROOT
from tests.support.viewer.pages import Page
from zenoh_vision.config.parameters import parameter
from zenoh_vision.config.revisions import ParameterStore
from zv.camera.settings import CameraSettings
from zv.edge.settings import EdgeSettings
from zv.tools.param.values import assignments, value_of
from zv.tracker.settings import TrackerSettings

PAGE = Page("docs/tuning.md")
MODELS = {
    "camera_front": CameraSettings,
    "edge_front": EdgeSettings,
    "tracker_front": TrackerSettings,
}


def test_each_parameter_is_accepted_as_it_is_set_one_after_the_other():
    stores = {node: ParameterStore(model()) for node, model in MODELS.items()}
    *changes, last = map(shlex.split, PAGE.commands())
    assert last == ["zv", "doctor"]
    for command, subcommand, verb, node, *texts in changes:
        assert (command, subcommand, verb) == ("zv", "param", "set")
        settings = stores[node].newest.settings
        typed = assignments(texts).items()
        values = {name: value_of(parameter(node, settings, name, 0), text) for name, text in typed}
        stores[node].change(values)
    assert {node for _, _, _, node, *_ in changes} == stores.keys()


def test_every_parameter_in_the_tables_exists():
    known = set().union(*(model.model_fields for model in MODELS.values()))
    columns = re.findall(r"^\| [^|]+ \| ([^|]+) \|", PAGE.text, re.MULTILINE)
    named = set(re.findall(r"`(\w+)(?:=\S+)?`", " ".join(columns)))
    assert len(named) > 12
    assert named <= known, named - known


def test_the_picture_is_there_and_its_settings_are_those_of_today():
    assert (ROOT / "docs" / "images" / "tuning.png").is_file()
    code = (ROOT / "docs" / "images" / "make_tuning.py").read_text()
    known = set().union(*(model.model_fields for model in MODELS.values()))
    assert set(re.findall(r'"(\w+)": [0-9.]+', code)) <= known
