"""The messages of ROS 2 that a recording can have: their fields, as a table, and their texts.

They are those of common_interfaces since Humble, of vision_msgs 4 and of foxglove_msgs. Foxglove
has since added fields to ImageAnnotations; a file says which it has by its own definition.
"""

from __future__ import annotations

from typing import Final

Fields = tuple[tuple[str, str], ...]

_TEXTS: Final = {
    "builtin_interfaces/Time": "int32 sec, uint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp, string frame_id",
    "sensor_msgs/CompressedImage": "std_msgs/Header header, string format, uint8[] data",
    "sensor_msgs/Image": (
        "std_msgs/Header header, uint32 height, uint32 width, string encoding, "
        "uint8 is_bigendian, uint32 step, uint8[] data"
    ),
    "sensor_msgs/RegionOfInterest": (
        "uint32 x_offset, uint32 y_offset, uint32 height, uint32 width, bool do_rectify"
    ),
    "sensor_msgs/CameraInfo": (
        "std_msgs/Header header, uint32 height, uint32 width, "
        "string distortion_model, float64[] d, float64[9] k, float64[9] r, float64[12] p, "
        "uint32 binning_x, uint32 binning_y, sensor_msgs/RegionOfInterest roi"
    ),
    "geometry_msgs/Point": "float64 x, float64 y, float64 z",
    "geometry_msgs/Quaternion": "float64 x, float64 y, float64 z, float64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position, geometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose, float64[36] covariance",
    "geometry_msgs/PointStamped": "std_msgs/Header header, geometry_msgs/Point point",
    "vision_msgs/Point2D": "float64 x, float64 y",
    "vision_msgs/Pose2D": "vision_msgs/Point2D position, float64 theta",
    "vision_msgs/BoundingBox2D": "vision_msgs/Pose2D center, float64 size_x, float64 size_y",
    "vision_msgs/ObjectHypothesis": "string class_id, float64 score",
    "vision_msgs/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis, geometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/Detection2D": (
        "std_msgs/Header header, "
        "vision_msgs/ObjectHypothesisWithPose[] results, vision_msgs/BoundingBox2D bbox, string id"
    ),
    "vision_msgs/Detection2DArray": "std_msgs/Header header, vision_msgs/Detection2D[] detections",
    "foxglove_msgs/Point2": "float64 x, float64 y",
    "foxglove_msgs/Color": "float64 r, float64 g, float64 b, float64 a",
    "foxglove_msgs/CircleAnnotation": (
        "builtin_interfaces/Time timestamp, "
        "foxglove_msgs/Point2 position, float64 diameter, float64 thickness, "
        "foxglove_msgs/Color fill_color, foxglove_msgs/Color outline_color"
    ),
    "foxglove_msgs/PointsAnnotation": (
        "builtin_interfaces/Time timestamp, uint8 type, "
        "foxglove_msgs/Point2[] points, foxglove_msgs/Color outline_color, "
        "foxglove_msgs/Color[] outline_colors, foxglove_msgs/Color fill_color, float64 thickness"
    ),
    "foxglove_msgs/TextAnnotation": (
        "builtin_interfaces/Time timestamp, "
        "foxglove_msgs/Point2 position, string text, float64 font_size, "
        "foxglove_msgs/Color text_color, foxglove_msgs/Color background_color"
    ),
    "foxglove_msgs/ImageAnnotations": (
        "foxglove_msgs/CircleAnnotation[] circles, "
        "foxglove_msgs/PointsAnnotation[] points, foxglove_msgs/TextAnnotation[] texts"
    ),
}
"""The fields of each message, as its definition in ROS has them."""


def _fields(text: str) -> Fields:
    pairs = (each.partition(" ") for each in text.split(", "))
    return tuple((kind, name) for kind, _, name in pairs)


TYPES: Final[dict[str, Fields]] = {name: _fields(text) for name, text in _TEXTS.items()}

HASHES: Final = {
    "sensor_msgs/CompressedImage": (
        "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a"
    ),
    "sensor_msgs/Image": ("d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"),
    "sensor_msgs/CameraInfo": ("b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"),
    "geometry_msgs/PointStamped": (
        "4c0296af86e01e562e9e0405d138a01537247580076c58ea38d7923ac1045897"
    ),
    "vision_msgs/Detection2DArray": (
        "214274120007f4a683866481336b70310268cfa107aebe9d594a6acf75bda968"
    ),
}
"""RIHS01 hashes of the types, which ``ros2 bag`` writes into the metadata of a channel."""

RULE: Final = "=" * 80


def definition(name: str) -> str:
    """Return the text of a message with those of all messages in it, as MCAP's ``ros2msg``."""
    parts, waiting = [], [name]
    for each in waiting:  # grows
        lines = []
        for kind, field in TYPES[each]:
            lines.append(f"{kind} {field}")
            inner = kind.partition("[")[0]
            if inner in TYPES and inner not in waiting:
                waiting.append(inner)
        head = "" if each == name else f"{RULE}\nMSG: {each}\n"
        parts.append(head + "\n".join(lines) + "\n")
    return "".join(parts)


def ros_name(name: str) -> str:
    """Return ``sensor_msgs/msg/Image`` of ``sensor_msgs/Image``."""
    package, _, message = name.partition("/")
    return f"{package}/msg/{message}"
