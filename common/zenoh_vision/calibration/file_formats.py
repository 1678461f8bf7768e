"""Reads the fields of a calibration file in the formats that cameras' tools write.

All have the same fields under the keys of ROS' YAML: the YAML of ROS, that of OpenCV's
``FileStorage``, and the older ``.ini`` of ROS, which camera_calibration_parsers still writes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

import yaml

OPENCV_MATRIX: Final = "tag:yaml.org,2002:opencv-matrix"
OPENCV_DIRECTIVE: Final = re.compile(rb"\A%YAML:1\.0[^\n]*\n")
"""Not YAML: a directive is written ``%YAML 1.0``."""

OPENCV_KEYS: Final = {
    "image_Width": "image_width",
    "image_Height": "image_height",
    "Camera_Matrix": "camera_matrix",
    "cameraMatrix": "camera_matrix",
    "Distortion_Coefficients": "distortion_coefficients",
    "distCoeffs": "distortion_coefficients",
}
"""What OpenCV's tutorials call the fields, besides the names that they share with ROS."""

LONGEST_PLUMB_BOB: Final = 5
"""More coefficients are those of another model."""

INI_SHAPES: Final = {
    "camera matrix": ("camera_matrix", 3, 3),
    "distortion": ("distortion_coefficients", 1, None),
    "rectification": ("rectification_matrix", 3, 3),
    "projection": ("projection_matrix", 3, 4),
}
"""The matrices of ROS' ``.ini``: their keys in ROS' YAML, rows and columns."""


class CalibrationLoader(yaml.SafeLoader):
    """Reads YAML with OpenCV's matrices, and nothing else that plain YAML does not have."""


def _opencv_matrix(loader: CalibrationLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    return loader.construct_mapping(node, deep=True)


CalibrationLoader.add_constructor(OPENCV_MATRIX, _opencv_matrix)


def fields_of(content: bytes) -> object:
    """Return the fields of a calibration file under the keys of ROS' YAML.

    Raises:
        yaml.YAMLError: It is none of the formats; also ValueError and RecursionError.
    """
    text = content.removeprefix(b"\xef\xbb\xbf")
    if _is_ini(text):
        return _of_ini(text.decode())
    from_opencv = OPENCV_DIRECTIVE.match(text) or b"opencv-matrix" in text
    read = yaml.load(OPENCV_DIRECTIVE.sub(b"", text), Loader=CalibrationLoader)  # noqa: S506 - safe
    if not isinstance(read, dict):
        return read
    fields = {OPENCV_KEYS.get(key, key): value for key, value in read.items()}
    if from_opencv and fields.pop("fisheye_model", 0):
        fields["distortion_model"] = "equidistant"
    elif from_opencv:
        fields.setdefault("distortion_model", _model(fields))
    return fields


def _model(fields: dict[Any, Any]) -> str:
    """Return the distortion model that is meant by the number of coefficients."""
    matrix = fields.get("distortion_coefficients")
    data = matrix.get("data") if isinstance(matrix, dict) else None
    longer = isinstance(data, list) and len(data) > LONGEST_PLUMB_BOB
    return "rational_polynomial" if longer else "plumb_bob"


def _is_ini(text: bytes) -> bool:
    """Tell whether the first line that says something is a section of an ``.ini`` file."""
    lines = (line.strip() for line in text.splitlines())
    first = next((line for line in lines if line and line[:1] not in b"#;"), b"")
    return re.fullmatch(rb"\[[\w /.-]+\]", first) is not None


def _of_ini(text: str) -> dict[str, Any]:
    """Return the fields of ROS' ``.ini``, where a name is followed by lines of numbers."""
    fields: dict[str, Any] = {}
    for section, name, numbers in _ini_entries(text):
        if section == "image" and name in ("width", "height"):
            fields[f"image_{name}"] = int(float(numbers[0])) if len(numbers) == 1 else numbers
        elif name in INI_SHAPES:
            key, rows, columns = INI_SHAPES[name]
            fields[key] = {"rows": rows, "cols": columns or len(numbers), "data": numbers}
            fields.setdefault("camera_name", section)
    return fields | {"distortion_model": _model(fields)}


def _ini_entries(text: str) -> Iterator[tuple[str, str, list[str]]]:
    """Yield section, name and numbers of each entry of ROS' ``.ini``."""
    section, name, numbers = "", "", list[str]()
    for raw in text.splitlines():
        line = re.split("[#;]", raw, maxsplit=1)[0].strip()
        if not line:
            continue
        if line[0] in "+-.0123456789":
            numbers += line.split()
            continue
        if numbers:
            yield section, name, numbers
        numbers = []
        if line.startswith("["):
            section, name = line.strip("[]"), ""
        else:
            name = line.lower()
    if numbers:
        yield section, name, numbers
