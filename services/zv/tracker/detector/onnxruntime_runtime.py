"""Runs a model by ONNX Runtime, of the extra ``onnxruntime``, on the CPU or an accelerator."""

from __future__ import annotations

import re
from typing import Any, Final

import onnxruntime
from numpy.typing import NDArray

from zenoh_vision.errors import ConfigurationError
from zv.tracker.detector.errors import ModelFailed, UnusableModel
from zv.tracker.detector.onnx_file import OnnxFile
from zv.tracker.detector.options import Device
from zv.tracker.detector.runtimes import Arrays, threads_of

PROVIDERS: Final = {
    "cuda": "CUDAExecutionProvider",
    "openvino": "OpenVINOExecutionProvider",
    "coreml": "CoreMLExecutionProvider",
    "cpu": "CPUExecutionProvider",
}
"""Execution providers by device, those that ``auto`` tries first at the top."""

OPERATOR = re.compile(
    r"No Op registered for (\w+)|implementation for (\w+)|Error No Op.*?\((\w+)"
    r"|[\w.]*:?(\w+)\(-?\d+\) is not a registered"
)
SEVERE: Final = 4
"""Level of messages that ONNX Runtime prints itself: fatal ones; errors are raised."""


class OnnxRuntime:
    """A model that ONNX Runtime runs.

    Raises:
        UnusableModel: Names the operator that ONNX Runtime does not know, if it says so.
        ConfigurationError: The device is not there; says which are.
    """

    name = "ONNX Runtime"

    def __init__(self, file: OnnxFile, example: Arrays, device: Device, threads: int) -> None:
        self._outputs = [each.name for each in file.outputs]
        available = set(onnxruntime.get_available_providers())
        here = [name for name, provider in PROVIDERS.items() if provider in available]
        if device != "auto" and device not in here:
            raise ConfigurationError(
                f"device = {device} is not there; this ONNX Runtime has: {', '.join(here)}"
            )
        reason = ""
        for name in here if device == "auto" else [device]:
            try:
                self._session = self._opened(file, name, threads)
                self.device = name
                self.first = self.run(example)
            except FAILURES as error:
                reason = reason or _fault(str(error))
                continue
            return
        raise UnusableModel(f"ONNX Runtime cannot run {reason}")

    def run(self, inputs: Arrays) -> dict[str, NDArray[Any]]:
        """Return the outputs; see ``Runtime``."""
        try:
            found = self._session.run(self._outputs, dict(inputs))
        except ERRORS as error:
            raise ModelFailed(f"ONNX Runtime: {_sentence(str(error))}") from None
        return dict(zip(self._outputs, found, strict=True))

    @staticmethod
    def _opened(file: OnnxFile, device: str, threads: int) -> onnxruntime.InferenceSession:
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads_of(threads)
        options.inter_op_num_threads = 1
        options.log_severity_level = SEVERE
        # Its threads would keep the processors busy for a while after each run.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        session = onnxruntime.InferenceSession(
            str(file.path), options, providers=[PROVIDERS[device]]
        )
        if PROVIDERS[device] != session.get_providers()[0]:
            raise ModelFailed(f"the device {device} cannot be used")  # its driver is missing
        return session


def _errors() -> tuple[type[Exception], ...]:
    """Return the classes of ONNX Runtime's errors, which have no common one of their own."""
    from onnxruntime.capi import onnxruntime_pybind11_state as state

    own = (value for value in vars(state).values() if isinstance(value, type))
    return (*(each for each in own if issubclass(each, Exception)), RuntimeError, ValueError)


ERRORS: Final = _errors()
FAILURES: Final[tuple[type[Exception], ...]] = (ModelFailed, *ERRORS)


def _fault(text: str) -> str:
    found = OPERATOR.search(text)
    operator = next(filter(None, found.groups()), "") if found else ""
    return f"the operator {operator} ({_sentence(text)})" if operator else f"it: {_sentence(text)}"


def _sentence(text: str) -> str:
    """Return an error of ONNX Runtime without its number, path, stack and place in its source."""
    text = re.sub(r"^\[ONNXRuntimeError\] : \d+ : \w+ : ", "", text.strip())
    text = re.sub(r"^Load model from .*? failed: ?", "", text)
    text = re.sub(r"/onnxruntime_src/\S+:\d+ .*?\) (?=[A-Z])", "", text)
    return " ".join(text.split())[:300]
