"""Chooses what runs a model: ONNX Runtime where it is installed, else OpenCV."""

from __future__ import annotations

import importlib.util
import logging
import os
from collections.abc import Callable, Mapping
from typing import Any, Final, Protocol

from numpy.typing import NDArray

from zenoh_vision.errors import ConfigurationError
from zv.tracker.detector.errors import UnusableModel
from zv.tracker.detector.onnx_file import OnnxFile
from zv.tracker.detector.options import MAX_THREADS, Device, RuntimeName

log = logging.getLogger(__name__)

EXTRA: Final = "pip install 'zenoh-vision[onnxruntime]'"

Arrays = Mapping[str, NDArray[Any]]


class Runtime(Protocol):
    """A loaded model; used by one thread at a time."""

    name: str  # what runs it, for people: ``ONNX Runtime``
    device: str  # on what: ``cpu``, ``cuda``, ...
    first: dict[str, NDArray[Any]]  # the outputs of its first run, by their names

    def run(self, inputs: Arrays) -> dict[str, NDArray[Any]]:
        """Return the outputs by their names, for inputs by their names.

        Raises:
            ModelFailed: Says why.
        """
        ...


def has_onnxruntime() -> bool:
    """Return whether ONNX Runtime is installed."""
    return importlib.util.find_spec("onnxruntime") is not None


def threads_of(wanted: int) -> int:
    """Return how many threads a model uses; 0 is one per processor, at most ``MAX_THREADS``."""
    if hasattr(os, "sched_getaffinity"):
        return wanted or min(MAX_THREADS, len(os.sched_getaffinity(0)))
    return wanted or min(MAX_THREADS, os.cpu_count() or 1)


def opened(
    file: OnnxFile, example: Arrays, runtime: RuntimeName, device: Device, threads: int
) -> Runtime:
    """Return a model that has run once.

    Raises:
        UnusableModel: It cannot be run; names the operator and by what.
        ConfigurationError: There is no such runtime or device here; says which there are.
    """
    makers: dict[str, Callable[[], Runtime]] = {}
    if runtime == "onnxruntime" and not has_onnxruntime():
        raise ConfigurationError(f"runtime = onnxruntime is not installed: {EXTRA}")
    if has_onnxruntime() and runtime != "opencv":
        makers["ONNX Runtime"] = lambda: _by_onnxruntime(file, example, device, threads)
    if runtime != "onnxruntime" and device in ("auto", "cpu"):
        makers["OpenCV"] = lambda: _by_opencv(file, example, threads)
    if not makers:
        raise ConfigurationError(
            f"device = {device} needs ONNX Runtime ({EXTRA}); OpenCV runs on: auto, cpu"
        )
    reasons = []
    for make in makers.values():
        try:
            found = make()
        except UnusableModel as error:
            reasons.append(str(error))
            continue
        if reasons:
            log.warning("%s; %s runs it", "; ".join(reasons), found.name)
        return found
    hint = "" if "ONNX Runtime" in makers or runtime != "auto" else f"; ONNX Runtime may: {EXTRA}"
    raise UnusableModel(f"{file.path}: {'; '.join(reasons)}{hint}")


def _by_onnxruntime(file: OnnxFile, example: Arrays, device: Device, threads: int) -> Runtime:
    from zv.tracker.detector.onnxruntime_runtime import OnnxRuntime

    return OnnxRuntime(file, example, device, threads)


def _by_opencv(file: OnnxFile, example: Arrays, threads: int) -> Runtime:
    from zv.tracker.detector.opencv_runtime import OpenCvRuntime

    return OpenCvRuntime(file, example, threads)
