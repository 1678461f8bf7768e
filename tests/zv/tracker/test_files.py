"""``zv track`` on an image: what it prints, draws and refuses."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support import detector_models
from tests.support.detector_models import scene
from tests.support.typist import type_zv
from zenoh_vision.errors import SourceError
from zv.tracker.detector.model import Found, Model
from zv.tracker.file_options import FileOptions
from zv.tracker.files import draw_objects, write
from zv.tracker.settings import TrackerSettings

BOXES = {0: (100, 70, 300, 210), 2: (120, 400, 230, 460)}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with an image and a model, in which the test works."""
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("street.png", scene(BOXES, (640, 480)))
    detector_models.save(Path("tiny.onnx"), "yolov8")
    return tmp_path


def track(*flags: str):
    return type_zv(["track", "--image", "street.png", *flags], folder=Path.cwd())


def test_the_objects_are_printed_and_drawn(folder: Path):
    done = track("--model", "tiny.onnx", "-o", "boxes.png")
    assert (done.returncode, done.stdout) == (
        0,
        "red 0.90 100,70 200x140\nblue 0.70 120,400 110x60\n",
    ), done.stderr
    assert "tiny.onnx by ONNX Runtime on cpu, layout yolov8, input 64x64" in done.stderr
    before, after = cv2.imread("street.png"), cv2.imread("boxes.png")
    drawn = (before != after).any(axis=2)
    assert drawn[140, 100]
    assert drawn[140, 299]  # the last column of the red box
    assert not drawn[140, 150:250].any()  # inside
    assert not drawn[:, 400:].any()


def test_without_a_name_the_picture_is_beside_where_one_works(folder: Path):
    done = track("--model", "tiny.onnx", "--classes", "blue:0.6")
    assert done.stdout == "blue 0.70 120,400 110x60\n"
    assert (folder / "street_boxes.jpg").is_file()


def test_a_full_disk_leaves_the_picture_as_it_was(folder: Path, request: pytest.FixtureRequest):
    out = folder / "boxes.png"
    out.write_bytes(b"old")
    noise = np.random.default_rng(1).integers(0, 255, (40, 40, 3), np.uint8)  # over 1000 bytes
    request.getfixturevalue("full_disk")
    with pytest.raises(SourceError, match=r"boxes\.png: File too large$"):
        write(out, noise, 90)
    assert out.read_bytes() == b"old"


def test_boxes_of_a_model_that_are_left_out_are_said(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    monkeypatch.setattr(Model, "detect", lambda *_: [Found([], not_finite=3, left_out=70)])
    draw_objects(TrackerSettings(model="tiny.onnx"), FileOptions(image="street.png"))
    said = [record.message for record in caplog.records if record.levelname == "WARNING"]
    assert said == [
        "3 boxes of the model were left out: NaN or infinite",
        "70 boxes of the model were left out: too many",
    ]


def test_an_image_without_objects_says_so(folder: Path):
    done = track("--model", "tiny.onnx", "--least-score", "0.95")
    assert (done.returncode, done.stdout) == (0, "")
    assert "no object with a score of at least 0.95" in done.stderr


@pytest.mark.parametrize(
    ("flags", "status", "words"),
    [
        ([], 2, "--image needs --model"),
        (["--model", "none.onnx"], 3, "none.onnx: No such file"),
        (["--model", "street.png"], 3, "street.png: no complete ONNX model"),
        (["--model", "tiny.onnx", "--classes", "rde"], 2, "did you mean 'red'?"),
        (["--model", "tiny.onnx", "--layout", "yolox"], 2, "do not fit --layout yolox"),
        (["--model", "tiny.onnx", "-o", "x.gif"], 2, "a name that ends in .png"),
        (["--model", "tiny.onnx", "-o", "street.png"], 2, "would overwrite --image"),
        (["--model", "tiny.onnx", "-o", "none/x.png"], 3, "No such file"),
        (["--model", "tiny.onnx", "--max-pixels", "1000"], 3, "640x480 pixels, at most 1000"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(
    flags: list[str], status: int, words: str, folder: Path
):
    done = track(*flags)
    assert done.returncode == status
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_an_image_that_is_none_is_refused(folder: Path):
    (folder / "street.png").write_bytes(np.arange(200, dtype=np.uint8).tobytes())
    done = track("--model", "tiny.onnx")
    assert done.returncode == 3
    assert "--image street.png" in done.stderr
