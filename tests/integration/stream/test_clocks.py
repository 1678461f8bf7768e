"""Clocks that differ, and clocks that are set while a camera runs: what docs/deploy.md says."""

from __future__ import annotations

import re
import time
from functools import partial

import pytest

from tests.support.listening import Listener, balance, wait_for_nodes
from tests.support.processes import ROOT
from tests.support.publishing import PlainCamera
from tests.support.waiting import wait_until
from zenoh_vision.messages import Level

PAGE = (ROOT / "docs" / "deploy.md").read_text()
RATE_HZ = 30
S = 10**9
STEPS = [10**7, -(10**7), S, -S, 3600 * S, -3600 * S, -(31 * 365 * 86400) * S]
"""The camera's clock minus this one's, one after the other: each is also a step while running."""


def said_of(offset_ns: int) -> str:
    """Return what the diagnostics should say of a clock."""
    if -S < offset_ns <= 5 * 10**7:  # at -1 s the frame's way makes it more
        return "ok"
    link = "frames on vision/front/image/compressed are late: the link is congested, or "
    may_be_link = -10 * S < offset_ns <= -S
    clock = f"the camera's clock is {offset_ns / S:+.1f} s from this machine's"
    return f"{link if may_be_link else ''}{clock}"


@pytest.mark.quiet
def test_no_frame_is_lost_to_a_clock_that_is_off_or_set_and_the_difference_is_reported(
    client, quick_service
):
    quick_service("tracker")
    wait_for_nodes(client, "tracker_front")
    health = Listener(client, "@vision/diagnostics/tracker_front")
    centroids = Listener(client, "vision/front/centroid")
    camera = PlainCamera(client)
    offset_ns = 0
    with camera.at(RATE_HZ, lambda: camera.send(stamp_ns=time.time_ns() + offset_ns)):
        centroids.wait_for(10)
        for step in STEPS:
            offset_ns = step
            set_s = time.monotonic()
            centroids.wait_for(10, after_s=set_s)
            wanted = partial(said, health, set_s, said_of(offset_ns))
            wait_until(wanted, 10, lambda: last(health))
            got = centroids.messages[-1].header
            latency_ns = got["done_ns"] - got["stamp_ns"]
            assert latency_ns == pytest.approx(-offset_ns, abs=0.5 * S)
    counters = health.messages[-1].body["counters"]
    for message in health.messages[1:]:
        body = message.body
        assert body["level"] == Level.OK or "slower than its stream" in body["message"], body
    # Those of a loaded machine, not of a clock.
    losses = {name for name in counters if name.startswith("dropped.")}
    assert losses <= {"dropped.overwritten"}
    assert balance(counters) == 0


def said(health: Listener, since_s: float, words: str) -> bool:
    return any(message.body["message"] == words for message in health.since(since_s))


def last(health: Listener) -> str:
    return str([message.body["message"] for message in health.messages[-3:]])


def test_the_page_quotes_the_reports():
    assert f"`{said_of(S)}`" in PAGE
    assert "(-1.0 s)" in PAGE
    assert "`no frame on ...; dropping samples: bad_stamp`" in PAGE
    health = (ROOT / "common/zenoh_vision/health/health.py").read_text()
    late = re.findall(r"`(every frame on \.\.\. for N s) (came too late): ([^`]*)`", PAGE)
    assert late
    for _, verb, why in late:
        assert verb in health
        assert why in health
