"""What an ONNX file says about itself, and files that are none."""

from __future__ import annotations

import os
from pathlib import Path

import onnx
import pytest

from tests.support import detector_models
from zv.tracker.detector.errors import UnusableModel
from zv.tracker.detector.onnx_file import read_onnx


def test_inputs_outputs_metadata_and_operators_are_read(tmp_path: Path):
    path = detector_models.save(tmp_path / "tiny.onnx", "dfine", metadata={"imgsz": "[64, 64]"})
    file = read_onnx(path)
    assert [str(each) for each in file.inputs] == [
        "images float32 [1, 3, 64, 64]",
        "orig_target_sizes int64 [1, 2]",
    ]
    assert [each.name for each in file.outputs] == ["labels", "boxes", "scores"]
    assert file.metadata == {"imgsz": "[64, 64]"}
    assert {"Conv", "ReduceMax", "Cast"} < file.operators


def test_sides_that_are_not_fixed_are_shown_as_such(tmp_path: Path):
    path = detector_models.save(tmp_path / "tiny.onnx", "yolov8", dynamic=True)
    assert str(read_onnx(path).inputs[0]) == "images float32 [?, 3, ?, ?]"


def test_every_truncation_is_refused(tmp_path: Path):
    whole = detector_models.save(tmp_path / "tiny.onnx", "yolov8").read_bytes()
    path = tmp_path / "cut.onnx"
    graph_ends = len(whole) - 60  # the operator set and the metadata follow
    for length in range(1, graph_ends, 7):
        path.write_bytes(whole[:length])
        with pytest.raises(UnusableModel, match=r"cut\.onnx: no complete ONNX model: "):
            read_onnx(path)


def test_weights_in_a_file_that_is_missing_or_truncated_are_refused_by_its_name(tmp_path: Path):
    path = detector_models.save(tmp_path / "tiny.onnx", "yolov8")
    onnx.save(
        onnx.load(path), path, save_as_external_data=True, location="tiny.data", size_threshold=0
    )
    assert [each.name for each in read_onnx(path).outputs] == ["output0"]
    weights = tmp_path / "tiny.data"
    os.truncate(weights, weights.stat().st_size - 3)
    with pytest.raises(UnusableModel, match=r"/tiny\.data: it ends 3 bytes too early"):
        read_onnx(path)
    weights.unlink()
    with pytest.raises(UnusableModel, match=r"/tiny\.data: No such .*; copy it beside the model"):
        read_onnx(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"\x89PNG\r\n\x1a\n" + bytes(100), "no complete ONNX model"),
        (b"PK\x03\x04" + bytes(100), "no complete ONNX model"),
        (b"hello world, this is no model", "no complete ONNX model"),
        (bytes(1000), "no complete ONNX model"),
    ],
    ids=["empty", "a picture", "a zip, as PyTorch writes", "a text", "zeros"],
)
def test_a_file_that_is_no_model_is_refused(content: bytes, words: str, tmp_path: Path):
    path = tmp_path / "no.onnx"
    path.write_bytes(content)
    with pytest.raises(UnusableModel, match=rf"no\.onnx: {words}"):
        read_onnx(path)


def test_a_folder_and_a_missing_file_are_refused(tmp_path: Path):
    with pytest.raises(UnusableModel, match="is a folder"):
        read_onnx(tmp_path)
    with pytest.raises(UnusableModel, match="No such file"):
        read_onnx(tmp_path / "none.onnx")


@pytest.mark.parametrize("size", [2**31 - 1, 2**31], ids=["just allowed", "2 GB"])
def test_a_file_of_2_gb_is_refused_without_reading_it(size: int, tmp_path: Path):
    path = tmp_path / "large.onnx"
    path.touch()
    os.truncate(path, size)  # of zeros, which take no place on the disk
    with pytest.raises(UnusableModel, match=r"2\.0 GB|no complete"):
        read_onnx(path)
