"""The parameters of a stream's URL."""

import pytest

from zv.viewer.streams.rendering import RenderOptions
from zv.viewer.web_video_server.query import InvalidQuery, parse_query

TOPIC = {"topic": "/front/image"}


@pytest.mark.parametrize(
    "more",
    [{}, {"width": "-1", "height": "-1"}, {"t": "1790000000", "_": "1"}],
    ids=["a topic", "minus one, as in ROS", "against caches"],
)
def test_what_asks_for_nothing_else_asks_for_jpeg_as_it_is(more):
    query = parse_query(TOPIC | more)
    assert query.options == RenderOptions(format="jpeg")
    assert not query.raw


def test_all_parameters_of_web_video_server_are_understood():
    query = parse_query(
        TOPIC | {"type": "png", "width": "320", "height": "240", "quality": "50", "invert": ""}
        | {"default_transport": "raw", "qos_profile": "sensor_data"}
    )  # fmt: skip
    assert query.options == RenderOptions(320, 240, False, 50, True, "png")
    assert query.raw


def test_ros_compressed_is_what_the_camera_sent_whatever_else_is_asked():
    assert parse_query(TOPIC | {"type": "ros_compressed", "width": "10"}).options == RenderOptions()


@pytest.mark.parametrize(("text", "on"), [("", True), ("1", True), ("true", True), ("no", False)])
def test_invert_is_on_without_a_value(text, on):
    assert parse_query(TOPIC | {"invert": text}).options.invert == on


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"topic": ""}, "topic is missing"),
        ({"width": "abc"}, "width = 'abc' is not allowed; allowed: a whole number from 1 to 7680"),
        ({"width": "0"}, "width = '0'"),
        ({"height": "7681"}, "height = '7681'"),
        ({"height": "1e3"}, "height = '1e3'"),
        ({"width": "٣"}, "width = "),
        ({"width": "9" * 5000}, "width = '999"),
        ({"width": "7680", "height": "7680"}, "width x height = 58982400 pixels are not allowed"),
        ({"quality": "101"}, "quality = '101' is not allowed; allowed: a whole number from 1 to"),
        ({"quality": "-5"}, "quality = '-5'"),
        ({"type": "h264"}, "type = 'h264' is not allowed; allowed: mjpeg, ros_compressed, png"),
        ({"invert": "maybe"}, "invert = 'maybe' is not allowed; allowed: true, false"),
        ({"default_transport": "x"}, "default_transport = 'x' is not allowed; allowed: raw, com"),
        ({"heights": "3"}, "unknown parameter 'heights'; did you mean height?"),
    ],
    ids=lambda value: str(value)[:30],
)
def test_what_is_wrong_is_named_with_what_is_allowed(given, said):
    with pytest.raises(InvalidQuery) as refused:
        parse_query(TOPIC | given)
    assert str(refused.value).startswith(said)
    assert len(str(refused.value)) < 200
    assert "\n" not in str(refused.value)


def test_a_snapshot_may_be_asked_for_as_jpeg():
    assert parse_query(TOPIC | {"type": "jpeg"}, single=True).options.format == "jpeg"
    with pytest.raises(InvalidQuery):
        parse_query(TOPIC | {"type": "jpeg"})
