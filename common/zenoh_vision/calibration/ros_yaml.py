"""Reads calibrations, and writes them as the YAML of ROS' camera_info_manager.

The keys and their order are those that ROS' camera_calibration_parsers writes. The plane is in an
additional key, ``plane_homography``, which ROS ignores like every unknown key.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

import yaml

from zenoh_vision.calibration.calibration import IDENTITY, Calibration
from zenoh_vision.calibration.camera_model import CalibrationFault, CameraModel, model_named
from zenoh_vision.calibration.file_formats import fields_of
from zenoh_vision.calibration.plane import Plane
from zenoh_vision.error_text import did_you_mean, similar_names
from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.host.files import write_file

MAX_BYTES: Final = 1 << 16

KEYS: Final = (
    "image_width",
    "image_height",
    "camera_name",
    "camera_matrix",
    "distortion_model",
    "distortion_coefficients",
    "rectification_matrix",
    "projection_matrix",
    "plane_homography",
)

OPTIONAL: Final = (
    "camera_name",
    "distortion_model",
    "rectification_matrix",
    "projection_matrix",
    "plane_homography",
)

NUMBERS: Final = re.compile(r"[-+.0-9eE\s]+")

KEY_OF: Final = {
    "width": "image_width",
    "height": "image_height",
    "k": "camera_matrix.data",
    "d": "distortion_coefficients.data",
    "r": "rectification_matrix.data",
    "p": "projection_matrix.data",
    "plane": "plane_homography.data",
}
"""The file's key for each field of ``CameraInfo``."""


def read_calibration(path: str | Path) -> Calibration:
    """Read a calibration file of ROS (YAML or ``.ini``) or OpenCV (YAML).

    Args:
        path: The file; as in ROS, also ``file:///PATH``.

    Raises:
        SourceError: It cannot be opened.
        ConfigurationError: It is not a calibration file, or a value is invalid; the text names
            the file, the key and what is allowed.
    """
    try:
        with Path(str(path).removeprefix("file://")).open("rb") as file:
            text = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise SourceError(f"{path}: {error.strerror or error}") from None
    if len(text) > MAX_BYTES:
        raise ConfigurationError(f"{path}: over {MAX_BYTES} bytes: no calibration file")
    try:
        fields = fields_of(text)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        words = " ".join(str(error).split())[:200]
        raise ConfigurationError(f"{path}: not YAML: {words}") from None
    if not isinstance(fields, dict):
        raise ConfigurationError(f"{path}: no keys; allowed: {', '.join(KEYS)}")
    try:
        return _calibration(fields)
    except CalibrationFault as fault:
        key = KEY_OF.get(fault.key, fault.key)
        raise ConfigurationError(
            f"{path}: {key}: {fault.found}; allowed: {fault.allowed}"
        ) from None


def write_calibration(calibration: Calibration, path: str | Path) -> None:
    """Write a calibration file.

    Raises:
        SourceError: It cannot be written.
    """
    write_file(path, yaml_text(calibration).encode())


def yaml_text(calibration: Calibration) -> str:
    """Return the contents of a calibration file."""
    camera = calibration.camera
    fields = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": calibration.name,
        "camera_matrix": _matrix(3, 3, camera.k),
        "distortion_model": camera.distortion_model,
        "distortion_coefficients": _matrix(1, len(camera.d), camera.d),
        "rectification_matrix": _matrix(3, 3, calibration.r),
        "projection_matrix": _matrix(3, 4, calibration.p),
    }
    if calibration.plane is not None:
        fields["plane_homography"] = _matrix(3, 3, calibration.plane.h)
    return yaml.safe_dump(fields, sort_keys=False, default_flow_style=None, width=2000)


def _matrix(rows: int, columns: int, numbers: Sequence[float]) -> dict[str, object]:
    return {"rows": rows, "cols": columns, "data": [float(number) for number in numbers]}


def _calibration(fields: Mapping[object, object]) -> Calibration:
    for key in fields:
        # Unknown keys are ignored, as in ROS, except misspelled ones.
        if key not in KEYS and (meant := similar_names(str(key), KEYS, similarity=0.8)):
            found = f"unknown key, {did_you_mean(meant)}"
            raise CalibrationFault(str(key)[:80], found, ", ".join(KEYS))
    for key in KEYS:
        if key not in fields and key not in OPTIONAL:
            raise CalibrationFault(key, "missing", "it must be given")
    name = fields.get("camera_name", "camera")
    model = fields.get("distortion_model", "plumb_bob")
    for key, value in (("camera_name", name), ("distortion_model", model)):
        if not isinstance(value, str):
            raise CalibrationFault(key, repr(value)[:80], "a text")
    camera = CameraModel(
        _side(fields, "image_width"),
        _side(fields, "image_height"),
        _numbers(fields, "camera_matrix", 3, 3),
        model_named(str(model)),
        _numbers(fields, "distortion_coefficients"),
    )
    r: tuple[float, ...] = IDENTITY
    p: tuple[float, ...] = ()
    plane = None
    if "rectification_matrix" in fields:
        r = _numbers(fields, "rectification_matrix", 3, 3)
    if "projection_matrix" in fields:
        p = _numbers(fields, "projection_matrix", 3, 4)
    if "plane_homography" in fields:
        plane = Plane(_numbers(fields, "plane_homography", 3, 3))
    return Calibration(camera, str(name), r, p, plane)


def _side(fields: Mapping[object, object], key: str) -> int:
    value = fields[key]
    if isinstance(value, bool) or not isinstance(value, int):
        raise CalibrationFault(key, repr(value)[:80], "a whole number, 1 to 65535")
    return value


def _numbers(
    fields: Mapping[object, object], key: str, rows: int | None = None, columns: int | None = None
) -> tuple[float, ...]:
    """Return the numbers of a matrix; ``rows`` and ``columns`` are checked if given."""
    matrix = fields[key]
    if not isinstance(matrix, dict):
        raise CalibrationFault(key, repr(matrix)[:80], "a map with rows, cols and data")
    data = matrix.get("data")
    if not isinstance(data, list):
        raise CalibrationFault(f"{key}.data", repr(data)[:80], "a list of numbers")
    numbers = tuple(_number(key, value) for value in _split(data))
    for name, wanted in (("rows", rows), ("cols", columns)):
        if wanted is not None and matrix.get(name, wanted) != wanted:
            raise CalibrationFault(f"{key}.{name}", repr(matrix[name])[:80], str(wanted))
    if rows and columns and len(numbers) != rows * columns:
        found = f"{len(numbers)} numbers"
        raise CalibrationFault(f"{key}.data", found, f"{rows * columns}: {rows} rows of {columns}")
    return numbers


def _split(data: list[object]) -> Iterator[object]:
    """Yield the items of a list whose numbers may be separated by spaces alone, as NumPy prints."""
    for value in data:
        spaced = isinstance(value, str) and NUMBERS.fullmatch(value)
        yield from str(value).split() if spaced else [value]


def _number(key: str, value: object) -> float:
    """Return a number, also from text: YAML 1.1, as PyYAML reads it, takes ``1e-05`` for text."""
    try:
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError
        number = float(value)
    except (ValueError, OverflowError):
        raise CalibrationFault(f"{key}.data", repr(value)[:80], "numbers") from None
    if not math.isfinite(number):
        raise CalibrationFault(f"{key}.data", repr(value)[:80], "finite numbers")
    return number
