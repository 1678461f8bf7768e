"""Runs a model by OpenCV's module ``dnn``, on the CPU."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from zv.tracker.detector.errors import ModelFailed, UnusableModel
from zv.tracker.detector.onnx_file import OnnxFile
from zv.tracker.detector.runtimes import Arrays, threads_of

ENGINES: Final = (cv2.dnn.ENGINE_CLASSIC, cv2.dnn.ENGINE_NEW)
"""The older engine is faster with some models, the newer one knows more operators."""

SHAPING: Final = frozenset({"If", "Loop", "Scan", "Shape", "Range", "NonZero", "NonMaxSuppression"})
"""With these, sides depend on values: the older engine ends the process, or returns other sides."""

OPERATOR = re.compile(r"Node \[(\w+)@|of type \"(\w+)\"")


class OpenCvRuntime:
    """A model that OpenCV runs, by the faster of its two engines.

    Raises:
        UnusableModel: Names the operator that OpenCV does not know, if it says so.
    """

    name = "OpenCV"
    device = "cpu"

    def __init__(self, file: OnnxFile, example: Arrays, threads: int) -> None:
        self._outputs = [each.name for each in file.outputs]
        cv2.setNumThreads(threads_of(threads))
        found: dict[float, tuple[cv2.dnn.Net, dict[str, NDArray[Any]]]] = {}
        reasons = []
        with _silent():
            for engine in ENGINES[1:] if SHAPING & file.operators else ENGINES:
                try:
                    net = cv2.dnn.readNetFromONNX(str(file.path), engine)
                    self._forward(net, example)  # it takes longer than all others
                    begun_s = time.perf_counter()
                    outputs = self._forward(net, example)
                except (cv2.error, ModelFailed) as error:
                    reasons.append(str(error))
                    continue
                found[time.perf_counter() - begun_s] = net, outputs
        if not found:
            raise UnusableModel(f"OpenCV cannot run {_fault(reasons)}")
        self._net, self.first = found[min(found)]

    def run(self, inputs: Arrays) -> dict[str, NDArray[Any]]:
        """Return the outputs; see ``Runtime``."""
        try:
            return self._forward(self._net, inputs)
        except cv2.error as error:
            raise ModelFailed(f"OpenCV: {_sentence(str(error))}") from None

    def _forward(self, net: cv2.dnn.Net, inputs: Arrays) -> dict[str, NDArray[Any]]:
        if net.empty():
            raise ModelFailed("the file was not loaded")
        for name, values in inputs.items():
            net.setInput(values, name)
        found: Any = net.forward(self._outputs)
        return dict(zip(self._outputs, map(np.asarray, found), strict=True))


@contextmanager
def _silent() -> Iterator[None]:
    """Keep OpenCV from printing errors that become one of ours."""
    before = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(before)


def _fault(reasons: list[str]) -> str:
    for reason in reasons:
        if found := OPERATOR.search(reason):
            return f"the operator {found[1] or found[2]} ({_sentence(reason)})"
    return f"it: {_sentence(reasons[0])}"


def _sentence(text: str) -> str:
    """Return the last words of an error of OpenCV, without the place in its source."""
    lines = [line.strip("> ") for line in text.splitlines()]
    line = next((each for each in reversed(lines) if each), text)
    return re.sub(r"^.*error: \([^)]*\) ?", "", line)[:300].strip()
