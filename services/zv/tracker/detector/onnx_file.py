"""Reads what an ONNX file says about itself: inputs, outputs, metadata, operators.

The weights are skipped, so this takes milliseconds for any size. Source: onnx.proto of ONNX, and
the wire format of Protocol Buffers.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from zv.tracker.detector.errors import UnusableModel

MAX_BYTES: Final = 2**31 - 1
"""A message of Protocol Buffers cannot be larger; larger models keep their weights beside it."""

TYPES: Final = {1: "float32", 2: "uint8", 6: "int32", 7: "int64", 9: "bool", 10: "float16"}

Side = int | None
"""A dimension; None if it is not fixed."""


@dataclass(frozen=True, slots=True)
class Tensor:
    """An input or output: its name, the name of its NumPy type, and its shape."""

    name: str
    dtype: str
    shape: tuple[Side, ...]

    def __str__(self) -> str:
        """Return ``images float32 [1, 3, 640, 640]``; a dimension that is not fixed is ``?``."""
        sides = ", ".join("?" if side is None else str(side) for side in self.shape)
        return f"{self.name} {self.dtype} [{sides}]"


@dataclass(frozen=True, slots=True)
class OnnxFile:
    """What a file says about itself."""

    path: Path  # the file
    inputs: tuple[Tensor, ...]  # without the weights
    outputs: tuple[Tensor, ...]  # their shapes may be incomplete
    metadata: dict[str, str]  # texts that the program that wrote it added, by name
    operators: frozenset[str]  # the types of its operators, each once

    def __str__(self) -> str:
        """Return its inputs and outputs, for errors."""
        inputs, outputs = ("; ".join(map(str, each)) for each in (self.inputs, self.outputs))
        return f"inputs: {inputs}; outputs: {outputs}"


def read_onnx(path: Path) -> OnnxFile:
    """Read a file.

    Raises:
        UnusableModel: It cannot be opened, is too large, truncated, no ONNX model, or its weights
            are in a file that is missing or truncated.
    """
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise UnusableModel(f"{path}: is a folder, not an ONNX file")
        if size > MAX_BYTES:
            raise UnusableModel(
                f"{path}: {size / 2**30:.1f} GB; an ONNX file has at most 2 GB, with larger "
                "weights in files beside it"
            )
        if size == 0:
            raise UnusableModel(f"{path}: is empty")
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            whole = memoryview(data)
            try:
                return _model(path, whole)
            finally:
                whole.release()
    except OSError as error:
        raise UnusableModel(f"{path}: {error.strerror or error}") from None
    except _Malformed as error:
        raise UnusableModel(f"{path}: no complete ONNX model: {error}") from None


class _Malformed(Exception):
    """The bytes are not the expected message."""


Field = tuple[int, int | memoryview]


def _fields(data: memoryview) -> Iterator[Field]:
    """Yield number and value of each field: an int, or the bytes of a text or message."""
    place, end = 0, len(data)
    while place < end:
        tag, place = _varint(data, place)
        number, kind = tag >> 3, tag & 7
        if number == 0:
            raise _Malformed("a field without a number")
        if kind == 0:
            value, place = _varint(data, place)
            yield number, value
            continue
        if kind == 2:
            length, place = _varint(data, place)
        elif kind in (1, 5):
            length = 8 if kind == 1 else 4
        else:
            raise _Malformed(f"a field of kind {kind}")
        if place + length > end:
            raise _Malformed(f"it ends {place + length - end} bytes too early")
        with data[place : place + length] as part:
            yield number, part
        place += length


def _varint(data: memoryview, place: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        if place >= len(data):
            raise _Malformed("it ends inside a number")
        byte = data[place]
        place += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, place
        shift += 7
        if shift > 63:
            raise _Malformed("a number of more than 64 bits")


def _message(value: int | memoryview) -> memoryview:
    if isinstance(value, int):
        raise _Malformed("a number in place of a message")
    return value


def _text(value: int | memoryview) -> str:
    return bytes(_message(value)).decode("utf-8", "replace")


def _model(path: Path, data: memoryview) -> OnnxFile:
    found: OnnxFile | None = None
    metadata: dict[str, str] = {}
    for number, value in _fields(data):
        if number == 7:
            found = _graph(path, _message(value))
        elif number == 14:
            entry = {key: _text(text) for key, text in _fields(_message(value)) if key in (1, 2)}
            metadata[entry.get(1, "")] = entry.get(2, "")
    if found is None or not found.inputs or not found.outputs:
        raise _Malformed("it has no graph with inputs and outputs")
    return replace(found, metadata=metadata)


def _graph(path: Path, data: memoryview) -> OnnxFile:
    inputs, outputs, weights, operators = [], [], set(), set()
    for number, value in _fields(data):
        if number == 1:
            operators |= {_text(text) for key, text in _fields(_message(value)) if key == 4}
        elif number == 5:
            stored: dict[str, str] = {}
            for key, part in _fields(_message(value)):
                if key == 8:
                    weights.add(_text(part))
                elif key == 13:
                    entry = {each: _text(text) for each, text in _fields(_message(part))}
                    stored[entry.get(1, "")] = entry.get(2, "")
            if stored:
                _check_stored(path, stored)
        elif number == 11:
            inputs.append(_tensor(_message(value)))
        elif number == 12:
            outputs.append(_tensor(_message(value)))
    kept = tuple(each for each in inputs if each.name not in weights)
    return OnnxFile(path, kept, tuple(outputs), {}, frozenset(operators))


def _check_stored(path: Path, stored: Mapping[str, str]) -> None:
    """Check that the file beside a model that holds one of its weights is there and complete.

    Raises:
        UnusableModel: It is not; names it.
    """
    file = path.parent / stored.get("location", "")
    try:
        needed = int(stored.get("offset", "0")) + int(stored.get("length", "0"))
        size = file.stat().st_size
    except OSError as error:
        words = f"{error.strerror or error}; copy it beside the model"
    except ValueError:
        raise _Malformed("weights in a file beside it, at a place that is no number") from None
    else:
        if size >= needed:
            return
        words = f"it ends {needed - size} bytes too early"
    raise UnusableModel(f"{path}: its weights are in {file}: {words}")


def _tensor(data: memoryview) -> Tensor:
    name, kind = "", 0
    shape: list[Side] = []
    for number, value in _fields(data):
        if number == 1:
            name = _text(value)
        elif number == 2:
            for key, tensor in _fields(_message(value)):
                if key != 1:  # a sequence or a map
                    continue
                for part, content in _fields(_message(tensor)):
                    if part == 1 and isinstance(content, int):
                        kind = content
                    elif part == 2:
                        shape = [_side(_message(each)) for _, each in _fields(_message(content))]
    return Tensor(name, TYPES.get(kind, f"type {kind}"), tuple(shape))


def _side(data: memoryview) -> Side:
    sides = [value for number, value in _fields(data) if number == 1]
    return sides[0] if sides and isinstance(sides[0], int) and 0 < sides[0] < 2**31 else None
