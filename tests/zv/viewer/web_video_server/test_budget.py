"""How many pixels are rendered for one address at once."""

from contextlib import ExitStack

import numpy as np
import pytest
from aiohttp import web

from tests.support.headers import header
from zenoh_vision.image import codecs
from zenoh_vision.image.frame import Frame
from zv.viewer.streams.rendering import MAX_PIXELS, RenderOptions, cost
from zv.viewer.web_video_server.handlers import RenderBudget
from zv.viewer.web_video_server.query import parse_query

JPEG = codecs.encode_jpeg(np.zeros((48, 64, 3), np.uint8), "bgr8", 80)
PNG = codecs.encode_png(np.zeros((48, 64), np.uint8))
KEY = "vision/front/image/compressed"
PLAIN = RenderOptions(format="jpeg")
HERE, ELSEWHERE = "192.0.2.1", "192.0.2.2"


@pytest.mark.parametrize(
    ("given", "payload", "pixels"),
    [
        ({}, JPEG, 0),
        ({"width": "64"}, JPEG, 0),
        ({"type": "ros_compressed", "width": "9"}, JPEG, 0),
        ({"type": "png"}, PNG, 0),
        ({"width": "32"}, JPEG, 32 * 24),
        ({"height": "96"}, JPEG, 128 * 96),
        ({"width": "9", "height": "8"}, JPEG, 9 * 8),
        ({"quality": "50"}, JPEG, 64 * 48),
        ({"invert": ""}, JPEG, 64 * 48),
        ({"type": "png"}, JPEG, 64 * 48),
        ({}, PNG, 64 * 48),
    ],
)
def test_a_stream_costs_the_pixels_that_are_rendered_and_nothing_if_passed_on(
    given, payload, pixels
):
    options = parse_query({"topic": "/front/image/compressed"} | given).options
    assert cost(Frame(header(1), payload, key=KEY), options) == pixels


def test_an_address_that_renders_as_much_as_it_may_gets_no_more_until_it_ends():
    budget = RenderBudget()
    with ExitStack() as clients:
        for _ in range(6):  # the same stream is rendered once for all
            clients.enter_context(budget.share(HERE, "a", PLAIN))(MAX_PIXELS)
        with budget.share(HERE, "b", PLAIN) as charge:
            with pytest.raises(web.HTTPTooManyRequests) as refused:
                charge(1)
            charge(0)  # passed on unchanged
        assert f"allowed: {MAX_PIXELS}" in str(refused.value.text)
        with budget.share(ELSEWHERE, "b", PLAIN) as charge:
            charge(2 * MAX_PIXELS)  # a single picture may be larger
    with budget.share(HERE, "b", PLAIN) as charge:
        charge(MAX_PIXELS)


def test_a_stream_that_becomes_larger_is_charged_anew():
    budget = RenderBudget()
    with budget.share(HERE, "a", PLAIN) as first, budget.share(HERE, "b", PLAIN) as second:
        first(MAX_PIXELS - 10)
        second(10)
        with pytest.raises(web.HTTPTooManyRequests):
            second(11)
        first(0)
        second(11)
