"""Inputs that each target begins with: right ones, from which wrong ones are made."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

import msgpack
import numpy as np

from tests.fuzz.targets import KINDS, seeds
from tests.support.recordings import write
from tests.zv.bag.records import frame
from zenoh_vision.image import codecs

CALIBRATION = b"""image_width: 32
image_height: 24
camera_name: front
camera_matrix: {rows: 3, cols: 3, data: [30, 0, 16, 0, 30, 12, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [30, 0, 16, 0, 0, 30, 12, 0, 0, 0, 1, 0]}
"""
KEY = "vision/front/image/compressed"
TEXTS = {
    "calibration": [CALIBRATION],
    "router_list": [
        b'{"clients":["ab"],"peers":[],"sessions":[{"peer":"ab"}]}',
        b'{"version":"v1.10.2-1","sessions":[{"peer":"ab","shm":true,"links":[{"dst":"tcp/a:1"}]}]}',
    ],
    "page_command": [
        json.dumps(each).encode()
        for each in (
            {"op": "watch", "key": KEY, "width": 320, "height": 240, "quality": 60},
            {"op": "unwatch", "key": KEY},
            {"op": "shown", "key": KEY},
            {"op": "show", "kinds": ["health", "log"]},
            {"op": "set", "id": 1, "node": "camera_front", "values": {"quality": 60}},
            {"op": "dump", "id": 2, "node": "camera_front"},
        )
    ],
    "schema": [
        b'{"type":"object","properties":{"a":{"$ref":"#/$defs/b"}},"$defs":{"b":{"type":"array",'
        b'"items":{"anyOf":[{"type":"integer","minimum":1},{"type":"string","pattern":"^a"}]}}},'
        b'"required":["a"],"additionalProperties":false}\0{"a":[1,"ab"]}'
    ],
    "rights": [b'{"publish":["vision/front/image"],"query":["vision/**"]}'],
}
NOISE = np.random.default_rng(7).integers(0, 256, (24, 32, 3), np.uint8)
VECTORS = Path(__file__).parents[1] / "vectors"


def corpus_of(target: str) -> Path:
    """Make a folder with inputs for a target."""
    folder = Path(tempfile.mkdtemp(prefix=f"fuzz-{target}-"))
    for number, data in enumerate(_inputs(target)):
        (folder / f"{number}").write_bytes(data)

    for seed in seeds(target):
        (folder / seed.name).write_bytes(seed.read_bytes())
    return folder


def _inputs(target: str) -> list[bytes]:
    encoded = [
        bytes.fromhex(vector["bytes"])
        for file in sorted(VECTORS.glob("*.json"))
        for vector in json.loads(file.read_text())["vectors"]
        if "bytes" in vector
    ]
    if target in TEXTS:
        return TEXTS[target]
    match target:
        case "message":
            return [bytes([kind]) + data for kind in range(len(KINDS)) for data in encoded]
        case "msgpack":
            return encoded
        case "picture":
            return _pictures()
        case "banded":
            return [_banded()]
        case "jpeg_stream":
            return [bytes([size]) + _stream() for size in (0, 40, 255)]
        case "frame":
            return _frames()
        case "recording":
            return [_recording()]
    return [b""]


def _pictures() -> list[bytes]:
    return [codecs.encode_jpeg(NOISE, "bgr8", 60), codecs.encode_png(NOISE)]


def _banded() -> bytes:
    """Return a JPEG that says that it is of 2000x2000 pixels, in four bands of 32 MCUs."""
    jpeg = codecs.encode_jpeg(NOISE, "bgr8", 60)
    size, scan = jpeg.index(b"\xff\xc0") + 5, jpeg.index(b"\xff\xda")
    side, interval = (2000).to_bytes(2), (125 * 32).to_bytes(2)
    head = jpeg[:size] + side + side + jpeg[size + 4 : scan] + b"\xff\xdd\0\4" + interval
    restarts = b"".join(bytes((0xFF, 0xD0 + number)) for number in range(3))
    return head + jpeg[scan:-2] + restarts + jpeg[-2:]


def _stream() -> bytes:
    """Return two parts of a multipart stream; the picture in one has been turned."""
    jpeg = codecs.encode_jpeg(NOISE, "bgr8", 60)
    tag = bytes.fromhex("01120003000000010006000000000000")
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\1" + tag
    turned = jpeg[:2] + b"\xff\xe1" + (2 + len(exif)).to_bytes(2) + exif + jpeg[2:]
    head = b"--b\r\nContent-Type: image/jpeg\r\nX-Timestamp: 12.5\r\n\r\n"
    return head + turned + b"\r\n" + head + jpeg + b"\r\n--b--"


def _frames() -> list[bytes]:
    height, width = NOISE.shape[:2]
    header = msgpack.packb(
        {
            "camera": "front", "epoch": 1, "seq": 1, "stamp_ns": 1, "width": width,
            "height": height, "encoding": "bgr8", "node": "camera_front", "revision": 0,
        }
    )  # fmt: skip
    begin = len(header).to_bytes(2, "little") + header
    payloads = [*_pictures(), NOISE.tobytes(), bytes(width * height // 8)]
    return [bytes([form]) + begin + each for form, each in enumerate(payloads)]


def _recording() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return write(
            Path(folder) / "run.mcap", [frame(seq, size=50) for seq in range(3)]
        ).read_bytes()
