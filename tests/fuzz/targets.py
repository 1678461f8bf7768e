"""What strangers can send, and the decoder of ours that reads it: one function per kind of bytes.

Each may refuse its input with the error that its callers expect. Anything else that it raises is a
finding: keep its input in ``seeds/TARGET/``, where ``test_seeds.py`` tries it again.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import NamedTemporaryFile
from types import SimpleNamespace
from typing import Any

from zenoh_vision import messages
from zenoh_vision.calibration.ros_yaml import read_calibration
from zenoh_vision.errors import ConfigurationError, PayloadError
from zenoh_vision.health.message_limits import check
from zenoh_vision.image import bands, codecs
from zenoh_vision.image.exif import as_stored, orientation_of
from zenoh_vision.keys import BITS, JPEG, PNG, RAW_IMAGE
from zenoh_vision.message_codec import Message, unpack
from zenoh_vision.messages import Diagnostics, Header, NodeDescription, Parameter
from zenoh_vision.security.rights import Rights
from zenoh_vision.stream.frame_intake import snapshot_of
from zenoh_vision.stream.sample import Sample
from zenoh_vision.transport.declarations import declaration_in, session_ids
from zenoh_vision.transport.unreachable import is_acknowledgement, is_refusal
from zv.bag.record import RecordingError
from zv.bag.recording import Recording
from zv.camera.sources.jpeg_splitter import JpegSplitter
from zv.camera.sources.mjpeg import DamagedJpeg, whole_jpeg
from zv.tools.doctor.observation import router_of
from zv.tools.shared.json_schema import UnusableSchema, parsed
from zv.tools.shared.schema_check import SchemaCheck
from zv.viewer.websocket.commands import MalformedCommand, parse_command

KINDS: tuple[type[Message], ...] = tuple(dict.fromkeys(messages.MESSAGES.values()))
MOST_PIXELS = 1 << 22


def message(data: bytes) -> None:
    """Read a message of the class that the first byte selects."""
    kind = KINDS[(data or b"\0")[0] % len(KINDS)]
    with suppress(PayloadError):
        found = kind.from_bytes(data[1:])
        assert kind.from_bytes(found.to_bytes()) == found or "nan" in repr(found)
        if isinstance(found, Diagnostics | NodeDescription | Parameter):
            check("camera_front", found)


def msgpack(data: bytes) -> None:
    """Unpack any msgpack, as of a change of parameters."""
    with suppress(PayloadError):
        unpack(data)


def picture(data: bytes) -> None:
    """Look at the size of a JPEG or PNG, and decode it as a receiver does."""
    with suppress(PayloadError):
        width, height = codecs.picture_size(data)
        if width * height > MOST_PIXELS:
            return
        if data.startswith(codecs.PNG_START):
            codecs.decode_png(data)
        else:
            codecs.decode_jpeg(data, "bgr8")


def banded(data: bytes) -> None:
    """Find the bands of a JPEG that is decoded in several threads."""
    found = bands.layout(data)
    if found is not None:
        bands.decode(data, found, lambda *_: None)


def jpeg_stream(data: bytes) -> None:
    """Find the JPEGs in what a camera sends by HTTP, in pieces whose size the first byte says."""
    splitter = JpegSplitter()
    size = 1 + (data or b"\0")[0]
    for begin in range(1, len(data), size):
        for packet in splitter.feed(data[begin : begin + size]):
            assert orientation_of(as_stored(packet.data)) == 1
            with suppress(DamagedJpeg):
                whole_jpeg(packet.data)


def frame(data: bytes) -> None:
    """Open a frame of the form, and with the header, that the first bytes say."""
    encoding = (JPEG, PNG, RAW_IMAGE, BITS)[(data or b"\0")[0] % 4]
    size = int.from_bytes(data[1:3], "little")
    attachment, payload = data[3 : 3 + size], data[3 + size :]
    with suppress(PayloadError):
        key = f"vision/{Header.from_bytes(attachment).camera}/image"
        # Late enough that no stamp is of the future.
        sample = Sample(key, payload, encoding, attachment, received_ns=2**63 - 1)
        snapshot_of(sample, max_pixels=MOST_PIXELS)


def router_list(data: bytes) -> None:
    """Read what a router's admin space says of a key, of its sessions, and of itself."""
    payload = _Payload(data)
    key = "@/abc/router/publisher/vision/front/image"
    reply: Any = SimpleNamespace(key=key, ok=SimpleNamespace(payload=payload))
    _, sessions = declaration_in(reply)
    assert all(isinstance(each, str) for each in sessions | session_ids([reply]))
    router_of("ab", data)


class _Payload:
    def __init__(self, data: bytes) -> None:
        self._data = data

    def __len__(self) -> int:
        return len(self._data)

    def to_bytes(self) -> bytes:
        return self._data


def page_command(data: bytes) -> None:
    """Parse what a page sends over its WebSocket."""
    with suppress(MalformedCommand):
        parse_command(data.decode(errors="replace"))


def schema(data: bytes) -> None:
    """Read a foreign JSON Schema, and check a value against it."""
    text, _, value = data.partition(b"\0")
    with suppress(UnusableSchema):
        found = parsed(text)
        with suppress(ValueError, RecursionError):
            SchemaCheck(found).error_in(json.loads(value or b"null"), "value")


def calibration(data: bytes) -> None:
    """Read a calibration file that somebody sent."""
    with NamedTemporaryFile(suffix=".yaml") as file:
        file.write(data)
        file.flush()
        with suppress(ConfigurationError):
            read_calibration(file.name)


def recording(data: bytes) -> None:
    """Read a recording that somebody sent, whole or damaged."""
    with NamedTemporaryFile(suffix=".mcap") as file:
        file.write(data)
        file.flush()
        with suppress(RecordingError), Recording(file.name) as found:
            for number, _ in enumerate(found.records()):
                if number > 1000:
                    break


def router_answer(data: bytes) -> None:
    """Judge the answer of whatever listens at the router's port."""
    is_acknowledgement(data)
    is_refusal(data)


def rights(data: bytes) -> None:
    """Read the rights in a file of credentials."""
    with suppress(ValueError, RecursionError):
        found = Rights.from_map(json.loads(data))
        assert Rights.from_map(found.to_map()) == found


TARGETS: Mapping[str, Callable[[bytes], None]] = {
    each.__name__: each
    for each in (
        message,
        msgpack,
        picture,
        banded,
        jpeg_stream,
        frame,
        router_list,
        page_command,
        schema,
        calibration,
        recording,
        router_answer,
        rights,
    )
}

SEEDS = Path(__file__).parent / "seeds"


def seeds(target: str) -> list[Path]:
    """Return the inputs that were once findings."""
    return sorted((SEEDS / target).glob("*"))
