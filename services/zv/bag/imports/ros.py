"""Recordings of ROS 1 and ROS 2, as records, by the package ``rosbags``."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import msgpack
import numpy as np

from zenoh_vision.errors import SourceError
from zenoh_vision.image.picture import Picture, PixelPicture, picture_of
from zenoh_vision.image.pixel_formats import ENCODINGS
from zenoh_vision.keys import msgpack_of
from zenoh_vision.messages import CameraInfo
from zv.bag.imports.stream import CameraStream
from zv.bag.record import Record

Progress = Callable[[int, int], None]

COMPRESSED: Final = "sensor_msgs/msg/CompressedImage"
IMAGES: Final = ("sensor_msgs/msg/Image", COMPRESSED)
INFO: Final = "sensor_msgs/msg/CameraInfo"
ROS_NAMES: Final = {"8UC1": "mono8", "8UC3": "bgr8", "8UC4": "bgra8", "16UC1": "16UC1"}
ENDINGS: Final = ("/compressed", "/image_raw", "/image_rect", "/image", "/image_color", "/raw")


class Cameras:
    """Names cameras by the topics of their images.

    Args:
        images: Whether its images are compressed, by topic.
        name: Of the camera, if there is only one.

    Attributes:
        left_out: The topics of images that a camera has on another topic too, and that topic: a
            compressed one rather than a raw one.
    """

    def __init__(self, images: Mapping[str, bool], name: str) -> None:
        taken: dict[str, str] = {}
        for topic in sorted(images, key=lambda each: (not images[each], each)):
            taken.setdefault(base_of(topic), topic)
        self.left_out = {
            topic: taken[base_of(topic)] for topic in images if topic not in taken.values()
        }
        self._names = {}
        for base in sorted(taken):
            word = re.sub(r"[^a-z0-9]+", "_", base.lower()).strip("_")
            self._names[base] = name if len(taken) == 1 else (word or name)[:64]

    def of(self, topic: str) -> str | None:
        """Return the camera of an image's or a calibration's topic; None without images."""
        return self._names.get(base_of(topic))


def base_of(topic: str) -> str:
    """Return the part of a topic that an image and its calibration share."""
    base = topic.removesuffix("/camera_info")
    if base != topic:
        return base
    for ending in ENDINGS:
        base = base.removesuffix(ending)
    return base


def ros_records(
    path: Path,
    make_stream: Callable[[str], CameraStream],
    namespace: str,
    camera: str,
    progress: Progress,
    note: Callable[[str], None],
) -> Iterator[Record]:
    """Yield the images and calibrations of a ``.bag``, a ``.mcap``, or a folder of ROS 2.

    ``camera`` is the name of the camera if there is only one. ``note`` is called with a line about
    what is left out.

    Raises:
        SourceError: It cannot be read, ``rosbags`` is not installed, or it has no images.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise SourceError(
            "recordings of ROS need the extra bags: pip install 'zenoh-vision[bags]'"
        ) from None
    count = 0
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            for record in _records(reader, path, make_stream, namespace, camera, progress, note):
                yield record
                count += 1
    except SourceError:
        raise
    except Exception as error:  # of rosbags, SQLite or a decompressor
        if not count:
            raise SourceError(f"{path} cannot be read: {error}") from None
        note(f"{path}: damaged after {count} messages ({error}); the rest is left out")


def _records(
    reader: Any,
    path: Path,
    make_stream: Callable[[str], CameraStream],
    namespace: str,
    camera: str,
    progress: Progress,
    note: Callable[[str], None],
) -> Iterator[Record]:
    """Yield the images and calibrations that an open reader has; see ``ros_records``."""
    used = [each for each in reader.connections if each.msgtype in (*IMAGES, INFO)]
    images = {each.topic: each.msgtype == COMPRESSED for each in used if each.msgtype != INFO}
    if not images:
        topics = ", ".join(sorted({each.topic for each in reader.connections})) or "none"
        raise SourceError(f"{path} has no images; its topics: {topics}")
    cameras = Cameras(images, camera)
    for topic, taken in cameras.left_out.items():
        note(f"{topic} is left out: {taken} has the pictures of camera {cameras.of(topic)}")
    used = [each for each in used if each.topic not in cameras.left_out]
    streams: dict[str, CameraStream] = {}
    for connection, at_ns, data in reader.messages(used):
        progress(at_ns - reader.start_time, reader.end_time - reader.start_time)
        name = cameras.of(connection.topic)
        if name is None:
            note(f"{connection.topic}: a calibration without images is left out")
            continue
        stream = streams.setdefault(name, make_stream(name))
        try:
            message = reader.deserialize(data, connection.msgtype)
            if connection.msgtype == INFO:
                record = _calibration(message, namespace, name, at_ns)
            else:
                record = stream.frame(_picture(message), _stamp_ns(message, at_ns), at_ns)
        except Exception as error:  # rosbags follows what is damaged until anything fails
            note(f"{connection.topic}: a message is left out: {error or type(error).__name__}")
            continue
        yield record


def _stamp_ns(message: Any, at_ns: int) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 10**9 + int(stamp.nanosec) or at_ns


def _picture(message: Any) -> Picture:
    """Return the picture in an image.

    Raises:
        PayloadError, ValueError: It is damaged, or of a kind that is not known.
    """
    if not hasattr(message, "encoding"):
        return picture_of(bytes(message.data))
    encoding = ROS_NAMES.get(message.encoding, message.encoding)
    known = ENCODINGS.get(encoding)
    if known is None:
        raise ValueError(
            f"encoding {message.encoding!r} is left out; known: {', '.join(ENCODINGS)}"
        )
    dtype = known.dtype.newbyteorder(">" if message.is_bigendian else "<")
    rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, message.step)
    used = rows[:, : message.width * known.channels * dtype.itemsize].copy()
    pixels = used.view(dtype).astype(known.dtype)
    shape = (message.height, message.width, known.channels)
    return PixelPicture(pixels.reshape(shape[:2] if known.channels == 1 else shape), encoding)


def _calibration(message: Any, namespace: str, camera: str, at_ns: int) -> Record:
    is_old = hasattr(message, "K")  # ROS 1 has capitals
    matrices = {name: getattr(message, name.upper() if is_old else name) for name in "dkrp"}
    stamp_ns = _stamp_ns(message, at_ns)
    header = {
        "camera": camera,
        "epoch": stamp_ns,
        "seq": 0,
        "stamp_ns": stamp_ns,
        "width": int(message.width),
        "height": int(message.height),
        "node": "import",
    }
    fields = {
        "header": header,
        "width": int(message.width),
        "height": int(message.height),
        "distortion_model": message.distortion_model,
        **{name: [float(each) for each in values] for name, values in matrices.items()},
    }
    packed = bytes(msgpack.packb(fields))
    CameraInfo.from_bytes(packed)
    return Record(
        key=f"{namespace}/{camera}/camera_info",
        payload=packed,
        encoding=msgpack_of(CameraInfo.schema_name),
        attachment=bytes(msgpack.packb(header)),
        log_time_ns=at_ns,
        priority=2,
    )
