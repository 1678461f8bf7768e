"""How many pixels are rendered for one address at once."""

from contextlib import ExitStack

import pytest
from aiohttp import web

from zv.viewer.streams.rendering import MAX_PIXELS, RenderOptions
from zv.viewer.web_video_server.handlers import RenderBudget

WIDE = RenderOptions(width=4096)


@pytest.mark.parametrize(
    ("options", "pixels"),
    [
        (RenderOptions(), 0),
        (RenderOptions(width=320, height=240), 76_800),
        (RenderOptions(width=1600), 1_440_000),
        (RenderOptions(height=900), 1_440_000),
        (RenderOptions(format="png"), 2_073_600),
        (WIDE, MAX_PIXELS),
    ],
)
def test_a_stream_costs_the_pixels_of_its_pictures(options, pixels):
    assert options.cost == pixels


def test_an_address_that_renders_as_much_as_it_may_gets_no_more_until_it_ends():
    budget = RenderBudget()
    small = RenderOptions(width=16)
    with ExitStack() as clients:
        for _ in range(6):  # the same stream is rendered once for all
            clients.enter_context(budget.taken("192.0.2.1", "a", WIDE))
        with (
            pytest.raises(web.HTTPTooManyRequests) as refused,
            budget.taken("192.0.2.1", "b", WIDE),
        ):
            pass
        assert f"allowed: {MAX_PIXELS}" in str(refused.value.text)
        with pytest.raises(web.HTTPTooManyRequests), budget.taken("192.0.2.1", "b", small):
            pass
        with budget.taken("192.0.2.1", "b", RenderOptions()), budget.taken("192.0.2.2", "b", WIDE):
            pass
    with budget.taken("192.0.2.1", "b", WIDE):
        pass
