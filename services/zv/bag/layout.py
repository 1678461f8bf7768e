"""How a sample becomes a message of an MCAP file, and how a message becomes a sample again."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from zenoh_vision.keys import RAW_IMAGE as RAW_ENCODING
from zv.bag import protobuf
from zv.bag.protobuf import WireError
from zv.bag.record import Record, ZenohTime
from zv.bag.schemas import (
    ATTACHMENT,
    CLOCK,
    COMPRESSED_IMAGE,
    ENCODING,
    KIND,
    ORIGIN,
    QOS,
    RAW_IMAGE,
    SAMPLE,
    TIME,
    Schema,
)

MAX_TIME_NS: Final = 2**63 - 1
PIXEL_BYTES: Final = {
    "mono8": 1,
    "bgr8": 3,
    "rgb8": 3,
    "bgra8": 4,
    "rgba8": 4,
    "mono16": 2,
    "16UC1": 2,
    "32FC1": 4,
}
"""Bytes of a pixel, by the encodings of Foxglove's raw pictures."""

DROPS, EXPRESS = 8, 16
"""Bits beside the priority."""


@dataclass(frozen=True, slots=True)
class Encoded:
    """A message of an MCAP file.

    Attributes:
        head: What stands before the payload in the message; the payload is its end.
        publish_time_ns: Capture time, else Zenoh's time stamp, else the time of arrival.
        sequence: The frame's number, modulo 2^32; 0 without one.
    """

    schema: Schema
    head: bytes
    payload: bytes
    publish_time_ns: int
    sequence: int


def encoded(record: Record) -> Encoded:
    """Return a sample as a message; its payload is not copied."""
    stamp_ns = record.number("stamp_ns")
    if stamp_ns is None:
        stamp_ns = record.log_time_ns if record.timestamp is None else record.timestamp.ns
    schema, head = _described(record, min(stamp_ns, MAX_TIME_NS))
    head += protobuf.part(ENCODING, record.encoding)
    if record.attachment is not None:
        head += protobuf.part(ATTACHMENT, record.attachment)
    if record.timestamp is not None:
        head += protobuf.fixed64(TIME, record.timestamp.ntp64)
        head += protobuf.part(CLOCK, record.timestamp.clock)
    head += protobuf.count(KIND, record.deleted) + protobuf.count(ORIGIN, record.origin == "query")
    qos = record.priority | DROPS * record.drops | EXPRESS * record.express
    head += protobuf.count(QOS, qos) + protobuf.prefix(schema.payload, len(record.payload))
    sequence = (record.number("seq") or 0) & 0xFFFFFFFF
    return Encoded(schema, head, record.payload, min(stamp_ns, MAX_TIME_NS), sequence)


def _described(record: Record, stamp_ns: int) -> tuple[Schema, bytes]:
    """Return the schema of a sample, and the fields by which other programs understand it."""
    media, _, form = record.encoding.partition("/")
    stamp = protobuf.timestamp(1, stamp_ns)
    camera = record.header.get("camera")
    frame_id = camera if isinstance(camera, str) else ""
    if media == "image" and not record.deleted:
        form = form.partition(";")[0]
        return COMPRESSED_IMAGE, stamp + protobuf.part(4, frame_id) + protobuf.part(3, form)
    if record.encoding == RAW_ENCODING and not record.deleted:
        width, height = record.number("width") or 0, record.number("height") or 0
        pixels = record.header.get("encoding")
        step = width * PIXEL_BYTES.get(pixels, 0) if isinstance(pixels, str) else 0
        if 0 < step < 2**32 and step * height == len(record.payload):
            shape = protobuf.fixed32(2, width) + protobuf.fixed32(3, height)
            shape += protobuf.part(4, str(pixels)) + protobuf.fixed32(5, step)
            return RAW_IMAGE, stamp + protobuf.part(7, frame_id) + shape
    return SAMPLE, stamp


def decoded(key: str, schema: Schema, message: memoryview, log_time_ns: int) -> Record:
    """Return the sample in a message, whose schema is one of ``SAMPLES``.

    Raises:
        WireError: The bytes are no such message.
    """
    payload, found = b"", dict[int, int | memoryview]()
    for number, value in protobuf.fields_of(message):
        if number == schema.payload:
            payload = bytes(_bytes(value))
        elif number >= ENCODING:
            found[number] = value
    try:
        encoding = str(_bytes(found.get(ENCODING, b"")), "utf-8")
        clock = str(_bytes(found.get(CLOCK, b"")), "utf-8")
    except UnicodeDecodeError as error:
        raise WireError(f"a text is not UTF-8: {error}") from None
    ntp64, qos = found.get(TIME), _number(found.get(QOS, 5))
    return Record(
        key=key,
        payload=payload,
        encoding=encoding,
        attachment=bytes(_bytes(found[ATTACHMENT])) if ATTACHMENT in found else None,
        timestamp=None if ntp64 is None else ZenohTime(_number(ntp64), clock),
        log_time_ns=log_time_ns,
        deleted=bool(_number(found.get(KIND, 0))),
        origin="query" if _number(found.get(ORIGIN, 0)) else "stream",
        priority=qos & 7,
        drops=bool(qos & DROPS),
        express=bool(qos & EXPRESS),
    )


def _bytes(value: int | memoryview | bytes) -> memoryview | bytes:
    if isinstance(value, int):
        raise WireError("a field has the wrong type")
    return value


def _number(value: int | memoryview) -> int:
    if not isinstance(value, int):
        raise WireError("a field has the wrong type")
    return value
