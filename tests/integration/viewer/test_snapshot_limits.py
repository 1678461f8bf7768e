"""Pictures in ``/snapshot`` that are too many or too large are refused, and the viewer goes on."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial

import numpy as np
import zenoh

from tests.support.pictures.encoded import jpeg
from tests.support.publishing import PlainCamera
from tests.support.viewer.client import Viewer
from tests.support.waiting import wait_until
from zv.viewer.streams.registry import MAX_HELD_BYTES
from zv.viewer.web_video_server.handlers import MAX_SNAPSHOTS


def test_snapshots_that_nobody_reads_hold_a_bounded_number_of_bytes(viewer: Viewer, client):
    noise = np.random.default_rng(1).integers(0, 255, (2304, 4096, 3), np.uint8)
    large = jpeg(noise, 85)
    key = "vision/large/image/compressed"
    most = MAX_HELD_BYTES // len(large)
    assert 2 <= most < MAX_SNAPSHOTS
    path = "/snapshot?topic=/large/image/compressed&type=ros_compressed"
    with (
        client.declare_queryable(key, partial(_reply, key, large)),
        ExitStack() as readers,
    ):
        wait_until(lambda: viewer.get(path).status == 200)
        for _ in range(most):
            deaf = readers.enter_context(viewer.deaf())
            deaf.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
            assert deaf.recv(12) == b"HTTP/1.1 200"  # the rest waits in the viewer
        refused = viewer.get(path)
        assert refused.status == 503
        assert f"the maximum is {MAX_HELD_BYTES}" in refused.text
        readers.close()
        wait_until(lambda: viewer.get(path).status == 200)


def test_a_picture_over_the_limit_of_pixels_is_neither_shown_nor_a_snapshot(service, client):
    viewer = Viewer(service("view", "--port", 0, "--max-pixels", 64 * 48))
    good, large = (jpeg(np.zeros((48, width, 3), np.uint8)) for width in (64, 65))
    camera = PlainCamera(client, pictures=(good, large))
    answered = {"vision/a/image/compressed": good, "vision/b/image/compressed": large}
    with ExitStack() as stack:
        for key, picture in answered.items():
            reply = partial(_reply, key, picture)
            stack.enter_context(client.declare_queryable(key, reply))
        wait_until(lambda: viewer.get("/snapshot?topic=/a/image/compressed").status == 200)
        refused = viewer.get("/snapshot?topic=/b/image/compressed")
        assert refused.status == 502
        assert "too_large" in refused.text
    with camera.at(30), viewer.stream("topic=/front/image/compressed&width=32") as pictures:
        assert all(next(pictures).seq % 2 == 0 for _ in range(10))


def _reply(key: str, picture: bytes, query: zenoh.Query) -> None:
    query.reply(key, picture, encoding="image/jpeg")
