"""What other programs need beside the samples: boxes and calibrations in Foxglove's messages."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any, Final

from zenoh_vision.errors import PayloadError
from zenoh_vision.message_codec import unpack
from zv.bag import protobuf
from zv.bag.record import Record, TooManyKeys
from zv.bag.schemas import ANNOTATIONS, CALIBRATION, Schema
from zv.bag.writer import Writer

LINE_LOOP: Final = 2
MAX_BOXES: Final = 1000
COLOURS: Final = {"confirmed": (0.1, 0.9, 0.2), "lost": (0.6, 0.6, 0.6)}
TENTATIVE: Final = (1.0, 0.8, 0.1)
THICKNESS, FONT_SIZE = 2.0, 14.0


def add_derived(writer: Writer, record: Record) -> None:
    """Add the message that other programs show for a sample, if there is one.

    Raises:
        ChunkLost: As for ``Writer.add``.
    """
    found = derived(record)
    if found is not None:
        topic, schema, data, stamp_ns = found
        with suppress(TooManyKeys):  # the sample itself is there
            writer.add_message(topic, schema, (data,), record.log_time_ns, stamp_ns)


def derived(record: Record) -> tuple[str, Schema, bytes, int] | None:
    """Return topic, schema, bytes and stamp of the message for a sample; None if there is none."""
    folder, _, name = record.key.rpartition("/")
    if record.deleted or (record.origin != "stream" and name != "camera_info"):
        return None
    if record.encoding.endswith((";vision.Tracks.v1", ";vision.Centroid.v1")):
        fields, stamp_ns = _fields(record)
        boxes = fields.get("tracks") if "tracks" in fields else (fields,)
        if stamp_ns is None or not isinstance(boxes, tuple):
            return None
        # The same stamp as the picture's: programs join the two by it.
        return f"{record.key}/boxes", ANNOTATIONS, _annotations(boxes, stamp_ns), stamp_ns
    if record.encoding.endswith(";vision.CameraInfo.v1"):
        fields, stamp_ns = _fields(record)
        data = None if stamp_ns is None else _calibration(fields, stamp_ns)
        if stamp_ns is not None and data is not None:
            return f"{folder}/calibration", CALIBRATION, data, stamp_ns
    return None


def _fields(record: Record) -> tuple[dict[Any, Any], int | None]:
    try:
        fields = unpack(record.payload)
    except PayloadError:
        return {}, None
    header = fields.get("header") if isinstance(fields, dict) else None
    stamp_ns = header.get("stamp_ns") if isinstance(header, dict) else None
    if type(stamp_ns) is not int or not 0 <= stamp_ns < 2**63 or not isinstance(fields, dict):
        return {}, None
    return fields, stamp_ns


def _annotations(boxes: tuple[Any, ...], stamp_ns: int) -> bytes:
    points, texts = b"", b""
    stamp = protobuf.timestamp(1, stamp_ns)
    for each in boxes[:MAX_BOXES]:
        box = each.get("box") if isinstance(each, dict) else None
        numbers = numbers_of(box, 4)
        if numbers is None:
            continue
        x, y, width, height = numbers
        corners = ((x, y), (x + width, y), (x + width, y + height), (x, y + height))
        colour = protobuf.part(4, _colour(COLOURS.get(str(each.get("state")), TENTATIVE)))
        points += protobuf.part(
            2,
            stamp
            + protobuf.count(2, LINE_LOOP)
            + b"".join(protobuf.part(3, _point(*corner)) for corner in corners)
            + colour
            + protobuf.double(7, THICKNESS),
        )
        if type(each.get("id")) is int:
            texts += protobuf.part(
                3,
                stamp
                + protobuf.part(2, _point(x, y))
                + protobuf.part(3, str(each["id"]))
                + protobuf.double(4, FONT_SIZE)
                + protobuf.part(5, _colour((1.0, 1.0, 1.0)))
                + protobuf.part(6, _colour((0.0, 0.0, 0.0))),
            )
    return points + texts + protobuf.timestamp(5, stamp_ns)


def _calibration(fields: dict[Any, Any], stamp_ns: int) -> bytes | None:
    matrices = [
        numbers_of(fields.get(name), size) for name, size in zip("dkrp", SIZES, strict=True)
    ]
    width, height = fields.get("width"), fields.get("height")
    model, header = fields.get("distortion_model"), fields["header"]
    if None in matrices or type(width) is not int or type(height) is not int:
        return None
    if not (0 <= width < 2**32 and 0 <= height < 2**32 and isinstance(model, str)):
        return None
    data = protobuf.timestamp(1, stamp_ns) + protobuf.part(9, str(header.get("camera") or ""))
    data += protobuf.fixed32(2, width) + protobuf.fixed32(3, height) + protobuf.part(4, model)
    for number, matrix in enumerate(matrices, 5):
        data += protobuf.doubles(number, matrix or ())
    return data


SIZES: Final = (None, 9, 9, 12)


def numbers_of(value: Any, size: int | None = None) -> tuple[float, ...] | None:
    """Return finite numbers of a message; None if they are not as many, or something else."""
    if not isinstance(value, tuple) or (size is not None and len(value) != size):
        return None
    if not all(type(each) in (int, float) and math.isfinite(each) for each in value):
        return None
    return tuple(map(float, value))


def _point(x: float, y: float) -> bytes:
    return protobuf.double(1, x) + protobuf.double(2, y)


def _colour(rgb: tuple[float, float, float]) -> bytes:
    return b"".join(protobuf.double(number, each) for number, each in enumerate((*rgb, 1.0), 1))
