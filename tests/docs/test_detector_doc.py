"""docs/detector.md is true: its commands run, its tables name what there is."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from tests.support import detector_models
from tests.support.detector_models import scene
from tests.support.listening import Listener, open_client
from tests.support.publishing import PlainCamera
from tests.support.systems import running_router, service
from tests.support.viewer.pages import Page, run_as_written
from tests.support.waiting import wait_until
from zenoh_vision.image.codecs import encode_jpeg
from zv.tracker.detector.layouts import LAYOUTS
from zv.tracker.settings import TrackerSettings

PAGE = Page("docs/detector.md")
NAMES = {"names": "{0: 'person', 1: 'car', 2: 'dog'}"}


def test_the_commands_run_as_written(tmp_path: Path):
    detector_models.save(tmp_path / "yolo11n.onnx", "yolov8", metadata=NAMES)
    boxes = [{1: (20 + 4 * step, 60, 60 + 4 * step, 140)} for step in range(30)]
    pictures = tuple(encode_jpeg(scene(each, (320, 240)), "bgr8", 95) for each in boxes)
    (tmp_path / "street.jpg").write_bytes(pictures[0])
    track, serve, echo = PAGE.commands()
    done = run_as_written(track, tmp_path)
    assert re.fullmatch(r"car 0\.80 \d+,\d+ \d+x\d+\n", done.stdout), (done.stdout, done.stderr)
    assert (tmp_path / "street_boxes.jpg").is_file()
    words = serve.split()
    words[words.index("yolo11n.onnx")] = str(tmp_path / "yolo11n.onnx")
    with (
        running_router(tmp_path) as endpoint,
        service(words[1], tmp_path, "--connect", endpoint, *words[2:]),
        open_client(endpoint) as session,
    ):
        events = Listener(session, "vision/front/events")
        with PlainCamera(session, pictures=pictures).at(15):
            wait_until(lambda: events.messages)
            done = run_as_written(echo, tmp_path, ZV_CONNECT=endpoint)
    assert done.returncode == 0, done.stderr
    assert "car" in done.stdout


def test_what_the_command_prints_has_the_form_that_is_shown():
    shown = PAGE.blocks("text")[0]
    assert all(re.fullmatch(r"\w+ 0\.\d\d \d+,\d+ \d+x\d+", row) for row in shown.splitlines())


def test_the_part_of_a_launch_file_holds_settings_of_the_tracker():
    [node] = tomllib.loads(PAGE.blocks("toml")[0])["node"]
    del node["service"]
    settings = TrackerSettings.model_validate(node)
    assert settings.classes == "person:0.6, car"


def test_the_table_of_layouts_says_what_each_expects():
    rows = re.findall(r"^\| `(\w+)` \| .* \| ([^|]*) \|$", PAGE.text, re.MULTILINE)
    documented = {name: cell.split(", ") for name, cell in rows}
    assert documented == {
        name: [each for each in (layout.fit, layout.colours, layout.values) if each]
        for name, layout in LAYOUTS.items()
    }
