"""How people write topics, and what they mean by that."""

import pytest

from zenoh_vision.keys import RAW_IMAGE
from zv.viewer.topics import Kind, is_stream, kind_of, resolve

IMAGE = "vision/front/image/compressed"
RAW = "vision/front/image"
KNOWN = [IMAGE, RAW, "vision/front/edges/compressed", "vision/front/centroid"]


@pytest.mark.parametrize(
    "text",
    [
        "/front/image/compressed",
        "front/image/compressed",
        "/vision/front/image/compressed",
        IMAGE,
        "/front/image",
        "vision/front/image",
    ],
)
def test_each_spelling_means_the_one_stream(text):
    assert resolve(text, "vision", KNOWN) == IMAGE
    assert resolve(text, "vision", []) == IMAGE


def test_raw_pixels_are_meant_where_the_url_says_raw():
    assert resolve("/front/image", "vision", KNOWN, raw=True) == RAW
    assert resolve("/front/image", "vision", [RAW]) == RAW  # there is no other


def test_a_camera_may_be_called_as_the_namespace():
    known = ["vision/vision/image/compressed"]
    assert resolve("/vision/image/compressed", "vision", []) == known[0]
    assert resolve("/vision/image", "vision", known) == known[0]
    assert resolve("/vision/image/compressed", "vision", known) == known[0]


@pytest.mark.parametrize(
    "text",
    ["", "/", "front", "**", "/front/*", "/front/image/**", "@vision/node/x", "/Front/image",
     "/front//image", "../../etc/passwd", "/front/image?x", "/front/" + "a" * 300, "/front/a b",
     "/front/\x00"],
)  # fmt: skip
def test_what_can_be_no_stream_means_none(text):
    assert resolve(text, "vision", KNOWN) is None


def test_a_message_is_no_stream_of_pictures():
    compressed = "vision/front/centroid/compressed"
    for text in ("/front/centroid", "vision/front/centroid"):
        assert resolve(text, "vision", KNOWN) is None
        assert resolve(text, "vision", [*KNOWN, compressed]) == compressed
        assert resolve(text, "vision", []) == compressed
    assert not kind_of("vision/front/centroid").picture
    assert kind_of("vision/front/centroid").type == "vision.Centroid.v1"


def test_kinds_follow_from_the_topic_table_and_else_from_the_end():
    assert kind_of(IMAGE).type == "image/jpeg"
    assert kind_of("vision/front/edges/smoothed/compressed").type == "image/png"
    assert kind_of(RAW) == Kind(picture=True, type=RAW_IMAGE)
    assert kind_of("vision/front/mine/compressed").picture
    assert kind_of("vision/front/mine").type == ""


def test_keys_of_other_namespaces_are_not_streams():
    assert is_stream(IMAGE, "vision")
    assert not is_stream(IMAGE, "mine")
    twin = "mine/vision/front/image/compressed"
    assert resolve("/vision/front/image", "mine", KNOWN) == twin
    assert resolve("/vision/front/image", "mine", [RAW, twin], raw=True) == twin
