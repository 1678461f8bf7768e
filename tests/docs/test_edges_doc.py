"""docs/edges.md is true: its commands run, its pictures are there, its figures are the code's."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import cv2
import numpy as np
import pytest

from docs.images.make_edges import localisation_row
from tests.support.pictures.encoded import smooth
from tests.support.processes import ROOT
from tests.support.viewer.pages import Page, run_as_written
from zenoh_vision.image import codecs
from zv.edge.detectors.available import DETECTORS
from zv.edge.detectors.canny import Canny
from zv.edge.detectors.detection import STAGES

PAGE = Page("docs/edges.md")
TEXT = PAGE.text


def test_the_commands_write_what_the_page_says(tmp_path: Path):
    picture = codecs.encode_png(smooth(96, 72, detail=8))
    (tmp_path / "in.png").write_bytes(picture)
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "one.png").write_bytes(picture)
    for command in PAGE.commands():
        done = run_as_written(command, tmp_path)
        assert done.returncode == 0, done.stderr
    written = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.png")}
    steps = {f"steps/{name}.png" for name in (*STAGES, "final")}
    assert written - {"in.png", "photos/one.png"} == steps | {
        "out.png",
        "strength.png",
        "maps/one.png",
    }


def test_every_detector_and_step_is_named_with_its_parameters():
    rows = re.findall(r"^\| `(\w+)` \| .* \| ([^|]*) \|$", TEXT, re.MULTILINE)
    documented = {name: set(re.findall(r"`(\w+)`", cell)) for name, cell in rows if "`" in cell}
    parameters = {name: {field.name for field in fields(kind)} for name, kind in DETECTORS.items()}
    assert documented == parameters
    for stage in STAGES:
        assert f"`{stage}`" in TEXT


@pytest.mark.parametrize("page", ["README.md", "docs/edges.md"])
def test_the_terms_of_the_learned_weights_are_named(page: str):
    text = Page(page).text
    assert "services/zv/edge/detectors/learned.md" in text
    assert re.search(r"BSDS500.*non-commercial research and education", text)


@pytest.mark.parametrize("name", ["canny", "roberts"])
def test_the_table_of_localisation_is_what_is_measured(name: str):
    assert localisation_row(name, 10.0) in TEXT


def test_the_pictures_show_what_the_code_finds_now():
    """The edge map of the last step: the left part of the picture is the map itself."""
    final = cv2.imread(str(ROOT / "docs/images/edges/canny_6_final.png"), cv2.IMREAD_GRAYSCALE)
    grey = cv2.imread(str(ROOT / "docs/images/edges/canny_0_input.png"), cv2.IMREAD_COLOR)
    assert final is not None
    assert grey is not None
    # The frame around the detail is drawn in blue on both; elsewhere the input is grey.
    expected = Canny().detect(np.ascontiguousarray(grey[:, :320, 0])).edges
    inner = (slice(None), slice(100, 320))
    assert np.array_equal(final[inner], expected[inner])
