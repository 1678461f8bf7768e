"""What runs a model, on what, with how many threads, and what is said when it cannot."""

from __future__ import annotations

import logging
import os
from pathlib import Path

import cv2
import numpy as np
import onnx
import onnxruntime
import pytest

from tests.support import detector_models
from tests.support.detector_models import SIZE
from zenoh_vision.errors import ConfigurationError
from zv.tracker.detector import runtimes
from zv.tracker.detector.errors import UnusableModel
from zv.tracker.detector.model import Model, ModelOptions
from zv.tracker.detector.onnx_file import read_onnx
from zv.tracker.detector.opencv_runtime import OpenCvRuntime
from zv.tracker.detector.runtimes import threads_of


@pytest.fixture
def tiny(tmp_path: Path) -> str:
    return str(detector_models.save(tmp_path / "tiny.onnx", "yolov8"))


@pytest.fixture
def unknown(tmp_path: Path) -> str:
    path = detector_models.save(tmp_path / "odd.onnx", "yolov8", operator="Frobnicate")
    return str(path)


@pytest.mark.parametrize("affinity", [True, False])
def test_threads_are_bounded_by_processors_and_by_four(
    affinity: bool, monkeypatch: pytest.MonkeyPatch
):
    def processors(count: int | None) -> None:
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(count or 1), raising=False)
        if not affinity:
            monkeypatch.delattr(os, "sched_getaffinity")
        monkeypatch.setattr(os, "cpu_count", lambda: 7 if affinity else count)

    for count, threads in ((2, 2), (16, 4), (None, 1)):
        processors(count)
        assert (threads_of(0), threads_of(3)) == (threads, 3)


def test_opencv_gets_its_threads_and_prints_as_before(
    tiny: str, unknown: str, capfd: pytest.CaptureFixture[str]
):
    threads, level = cv2.getNumThreads(), cv2.utils.logging.getLogLevel()
    example = {"images": np.zeros((1, 3, SIZE, SIZE), np.float32)}
    try:
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)
        OpenCvRuntime(read_onnx(Path(tiny)), example, 2)
        assert cv2.getNumThreads() == 2
        with pytest.raises(UnusableModel):
            OpenCvRuntime(read_onnx(Path(unknown)), example, 1)
        assert cv2.utils.logging.getLogLevel() == cv2.utils.logging.LOG_LEVEL_ERROR
        assert capfd.readouterr().err == ""
    finally:
        cv2.setNumThreads(threads)
        cv2.utils.logging.setLogLevel(level)


def test_a_runtime_that_is_named_is_the_only_one(unknown: str):
    for runtime, name, other in (
        ("onnxruntime", "ONNX Runtime", "OpenCV"),
        ("opencv", "OpenCV", "ONNX Runtime"),
    ):
        with pytest.raises(UnusableModel) as refused:
            Model(ModelOptions(unknown, runtime=runtime))
        assert f"{name} cannot run the operator Frobnicate" in str(refused.value)
        assert other not in str(refused.value)


def test_the_extra_is_named_only_where_it_is_missing(
    tiny: str, unknown: str, monkeypatch: pytest.MonkeyPatch
):
    with pytest.raises(UnusableModel) as refused:
        Model(ModelOptions(unknown))
    assert "pip install" not in str(refused.value)
    monkeypatch.setattr(runtimes, "has_onnxruntime", lambda: False)
    with pytest.raises(ConfigurationError, match="runtime = onnxruntime is not installed"):
        Model(ModelOptions(tiny, runtime="onnxruntime"))
    with pytest.raises(ConfigurationError, match="device = cuda needs ONNX Runtime"):
        Model(ModelOptions(tiny, device="cuda"))


def test_when_one_runtime_cannot_the_other_does_and_the_log_says_why(
    tiny: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    caplog.set_level(logging.WARNING)
    assert Model(ModelOptions(tiny)).runtime.name == "ONNX Runtime"
    assert caplog.messages == []

    def fails(*_: object) -> None:
        raise UnusableModel("ONNX Runtime cannot run the operator Odd")

    monkeypatch.setattr(runtimes, "_by_onnxruntime", fails)
    assert Model(ModelOptions(tiny)).runtime.name == "OpenCV"
    assert caplog.messages == ["ONNX Runtime cannot run the operator Odd; OpenCV runs it"]


def test_a_device_whose_driver_is_missing_is_left_out_or_refused(
    tiny: str, monkeypatch: pytest.MonkeyPatch
):
    """ONNX Runtime for CUDA runs on the CPU, without an error, where there is no such device."""
    providers = ["CUDAExecutionProvider", "CPUExecutionProvider"]
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: providers)
    opened = onnxruntime.InferenceSession
    asked: list[str] = []

    def without_cuda(path: str, options: object, providers: list[str]) -> object:
        asked.extend(providers)
        return opened(path, options, providers=["CPUExecutionProvider"])

    monkeypatch.setattr(onnxruntime, "InferenceSession", without_cuda)
    assert Model(ModelOptions(tiny)).runtime.device == "cpu"
    assert asked == providers
    with pytest.raises(UnusableModel, match="device cuda cannot be used"):
        Model(ModelOptions(tiny, device="cuda", runtime="onnxruntime"))
    asked.clear()
    assert Model(ModelOptions(tiny, device="cpu")).runtime.device == "cpu"
    assert asked == ["CPUExecutionProvider"]


def test_a_version_that_is_too_new_is_named_without_a_place_in_the_source(tiny: str):
    model = onnx.load(tiny)
    model.ir_version = 99
    onnx.save(model, tiny)
    with pytest.raises(UnusableModel, match="cannot run it: Unsupported model IR version: 99"):
        Model(ModelOptions(tiny, runtime="onnxruntime"))


def test_the_first_reason_is_the_one_that_is_said(unknown: str, monkeypatch: pytest.MonkeyPatch):
    providers = ["CUDAExecutionProvider", "CPUExecutionProvider"]
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: providers)
    opened = onnxruntime.InferenceSession

    def no_driver(path: str, options: object, providers: list[str]) -> object:
        if providers == ["CUDAExecutionProvider"]:
            raise RuntimeError("libcudart is missing")
        return opened(path, options, providers=providers)

    monkeypatch.setattr(onnxruntime, "InferenceSession", no_driver)
    with pytest.raises(UnusableModel, match="ONNX Runtime cannot run it: libcudart is missing"):
        Model(ModelOptions(unknown, runtime="onnxruntime"))
