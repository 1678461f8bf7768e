"""What ``zv topic pub`` takes and refuses."""

from __future__ import annotations

import json
import re
import time

import cv2
import msgpack
import numpy as np
import pytest

from tests.support.pictures.encoded import STILL, damaged, jpeg, scene
from zenoh_vision.errors import ConfigurationError, SourceError
from zenoh_vision.messages import Centroid, Header
from zenoh_vision.topics import TOPICS
from zv.tools.shared.message_types import Answers, type_named
from zv.tools.topic.payloads import payload_for

KEY = "vision/front/centroid"
CENTROID = {"x": 5, "y": 6, "box": [1, 2, 8, 8], "area": 60.5}


NOTHING = Answers({}, {}, {})


def prepared(key: str, data: object, type_name: str | None = None):
    text = data if isinstance(data, str) else json.dumps(data)
    return payload_for(key, text, type_name and type_named(type_name, lambda: NOTHING))


def test_a_message_gets_the_encoding_of_its_key_and_a_header_of_the_moment():
    payload = prepared(KEY, CENTROID)
    assert payload.needs_size
    payload.size = (640, 480)
    before_ns = time.time_ns()
    sample = payload.sample(3, 12345)
    assert sample.encoding == "application/msgpack;vision.Centroid.v1"
    message = Centroid.from_bytes(sample.payload)
    assert (message.x, message.y, message.box, message.area) == (5, 6, (1, 2, 8, 8), 60.5)
    header = Header.from_bytes(sample.attachment)
    assert header == message.header
    assert (header.camera, header.epoch, header.seq) == ("front", 12345, 3)
    assert (header.width, header.height, header.node) == (640, 480, "topic_pub")
    assert before_ns <= header.stamp_ns <= time.time_ns()


def test_the_frame_size_may_stand_in_the_message():
    payload = prepared(KEY, CENTROID | {"header": {"width": 320, "height": 240}})
    assert not payload.needs_size
    header = Header.from_bytes(payload.sample(0, 1).attachment)
    assert (header.width, header.height) == (320, 240)


@pytest.mark.parametrize(
    ("key", "data", "said"),
    [
        (KEY, CENTROID | {"x": "left"}, "Centroid.x"),
        (KEY, {"x": 1}, "Centroid.y: Field required"),
        (KEY, CENTROID | {"z": 1}, "no field 'z'; its fields: header, x, y, box, area"),
        (KEY, [1], "a Centroid is a JSON object"),
        (KEY, "{x: 1}", "not JSON"),
        (KEY, CENTROID | {"header": {"seq": 3}}, "header.seq is made when"),
        (KEY, CENTROID | {"header": {"stamp_ns": 3}}, "header.stamp_ns is made when"),
        (KEY, CENTROID | {"header": {"camera": "left"}}, "'left' on a key of front"),
        (KEY, CENTROID | {"header": 3}, "header must be a JSON object"),
        ("vision/Front/centroid", CENTROID, "not a camera name"),
        ("vision/front/centroyd", CENTROID, "did you mean .../centroid?"),
    ],
)
def test_a_message_that_is_not_as_its_key_says_is_refused_and_the_place_named(key, data, said):
    with pytest.raises(ConfigurationError) as caught:
        made_of(key, data)
    assert said in str(caught.value)


def made_of(key: str, data: object):
    payload = prepared(key, data)
    payload.size = (640, 480)
    return payload.sample(0, 1)


def test_a_key_outside_the_table_takes_a_named_type():
    value = {"node": "a", "name": "b", "type": "int", "value": 1, "default": 2}
    sample = prepared("@vision/param/a/b", value, "parameter").sample(0, 1)
    assert sample.encoding == "application/msgpack;vision.Parameter.v1"
    assert sample.attachment is None
    assert msgpack.unpackb(sample.payload)["default"] == 2


def test_a_message_may_stand_in_a_file(tmp_path):
    file = tmp_path / "centroid.json"
    file.write_text(json.dumps(CENTROID))
    payload = payload_for(KEY, str(file), None)
    payload.size = (8, 6)
    assert Centroid.from_bytes(payload.sample(0, 1).payload).x == 5


@pytest.mark.parametrize("data", ["/no/such.json", "x: 5"], ids=["a file", "YAML"])
def test_of_what_is_neither_json_nor_a_file_both_are_said(data: str):
    with pytest.raises(SourceError, match=f"^{re.escape(data)}: No such file .* JSON in braces"):
        payload_for(KEY, data, None)


# Pictures

COLOUR = scene(3)
DEEP = (np.arange(48, dtype=np.uint16) * 1000).reshape(6, 8)


def png(pixels) -> bytes:
    return bytes(cv2.imencode(".png", pixels)[1])


@pytest.mark.parametrize(
    ("key", "file", "mime", "encoding", "size"),
    [
        ("image/compressed", STILL, "image/jpeg", "bgr8", (320, 240)),
        ("image/compressed", jpeg(COLOUR[:, :, 0]), "image/jpeg", "mono8", (320, 240)),
        ("image/compressed", png(DEEP), "image/png", "mono16", (8, 6)),
        ("edges/compressed", png(COLOUR[:, :, 1]), "image/png", "mono8", (320, 240)),
    ],
    ids=["JPEG", "grey JPEG", "PNG of 16 bits", "PNG"],
)
def test_a_picture_goes_as_it_is_with_what_its_pixels_are(
    tmp_path, key, file, mime, encoding, size
):
    (tmp_path / "picture").write_bytes(file)
    sample = payload_for(f"vision/front/{key}", str(tmp_path / "picture"), None).sample(4, 9)
    header = Header.from_bytes(sample.attachment)
    assert (sample.payload, sample.encoding) == (file, mime)
    assert (header.encoding, header.width, header.height) == (encoding, *size)
    assert (header.camera, header.epoch, header.seq) == ("front", 9, 4)


def test_a_picture_of_another_form_is_encoded(tmp_path):
    cv2.imwrite(str(tmp_path / "picture.bmp"), COLOUR)
    sample = payload_for(
        "vision/front/image/compressed", str(tmp_path / "picture.bmp"), None
    ).sample(0, 1)
    assert sample.encoding == "image/jpeg"
    seen = cv2.imdecode(np.frombuffer(sample.payload, np.uint8), cv2.IMREAD_COLOR)
    assert np.abs(seen.astype(int) - COLOUR).mean() < 4


def test_on_the_raw_key_the_pixels_go(tmp_path):
    (tmp_path / "deep.png").write_bytes(png(DEEP))
    sample = payload_for("vision/front/image", str(tmp_path / "deep.png"), None).sample(0, 1)
    assert sample.encoding == TOPICS["image"].encoding
    assert sample.payload == DEEP.astype("<u2").tobytes()


@pytest.mark.parametrize("file", [b"", b"text", STILL[:200], damaged(STILL), png(DEEP)[:-9]])
def test_a_broken_picture_is_refused(tmp_path, file):
    (tmp_path / "picture.jpg").write_bytes(file)
    with pytest.raises(ConfigurationError, match="not a picture"):
        payload_for("vision/front/image/compressed", str(tmp_path / "picture.jpg"), None)
