"""docs/library.md names all that the library offers, and its example runs as written."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

import zenoh_vision
from tests.support.fork_server import SCRIPT
from tests.support.headers import header
from tests.support.processes import Program, run_program
from tests.support.systems import system
from tests.support.viewer.pages import Page

PAGE, SERVICES = Page("docs/library.md"), Page("docs/services.md")


def test_every_public_name_is_on_the_page():
    named = set(re.findall(r"`(\w+)", PAGE.text))
    assert set(zenoh_vision.__all__) <= named


@pytest.mark.parametrize("name", zenoh_vision.__all__)
def test_a_public_name_can_be_imported_and_is_documented(name: str):
    found = getattr(zenoh_vision, name)
    assert name in ("TOPICS", "latest") or found.__doc__


@pytest.mark.parametrize("page", [PAGE, SERVICES], ids=lambda page: page.name)
def test_what_a_page_says_of_a_node_is_there(page: Page):
    said = set(re.findall(r"`(?:for number in )?node\.(\w+)", page.text))
    node = zenoh_vision.Node("any", camera=())
    assert len(said) > 8
    assert {name for name in said if not hasattr(type(node), name)} <= set(vars(node))


def test_the_errors_of_drawing_on_a_frame_are_quoted_with_the_remedy():
    frame = zenoh_vision.Frame(header(width=8, height=6), np.zeros((6, 8, 3), np.uint8))
    with pytest.raises(cv2.error) as drawn:
        cv2.rectangle(frame.bgr, (1, 1), (3, 3), (0, 0, 255))
    with pytest.raises(ValueError, match="read-only") as assigned:
        frame.bgr[0] = 255
    for page in (PAGE, SERVICES):
        (told,) = (line for line in page.text.splitlines() if "`frame.bgr.copy()`" in line)
        quoted = re.findall(r"`([^`]* (?:readonly|read-only))`", told)
        assert [words in str(drawn.value) for words in quoted] == [True, False]
        assert quoted[1] == str(assigned.value)
    cv2.rectangle(frame.bgr.copy(), (1, 1), (3, 3), (0, 0, 255))


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="has no attribute 'Nod'"):
        _ = zenoh_vision.Nod  # type: ignore[attr-defined]


def test_importing_the_library_loads_no_zenoh_until_a_node_is_asked_for():
    program = (
        "import sys, zenoh_vision\n"
        "assert not {'zenoh', 'cv2', 'pydantic'} & set(sys.modules)\n"
        "zenoh_vision.Node\n"
        "assert 'zenoh' in sys.modules\n"
    )
    assert run_program([sys.executable, "-c", program]).stderr == ""


def test_the_example_prints_frames_and_centroids_of_every_camera(tmp_path: Path):
    with system(tmp_path, "tracker") as endpoint:
        program = tmp_path / "onlooker.py"
        program.write_text(PAGE.blocks("python")[0].replace("tcp/127.0.0.1:7447", endpoint))
        with Program([program], tmp_path, "onlooker", SCRIPT) as running:
            running.lines(r"front \d+ \d+\.\d+", count=3)
            running.lines(r"front \d+ (\d+|None) (\d+|None)", count=3)
            assert running.interrupt() == 0
            assert not running.complaints
