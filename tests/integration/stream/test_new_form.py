"""A form of pictures that nobody planned for works in a service, a snapshot and the viewer."""

from __future__ import annotations

import urllib.request
import zlib
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.support.listening import newest
from tests.support.publishing import Paced
from tests.support.routing import free_port
from tests.support.waiting import in_time, wait_until
from zenoh_vision import Node, Topic
from zenoh_vision.image import forms
from zenoh_vision.testing import running_service
from zv.tools.shared.output import Output
from zv.tools.snapshot.command import run as snapshot
from zv.tools.snapshot.options import SnapshotOptions

DEFLATED = '''
import zlib
from zenoh_vision.image import forms

class DeflatedRows(forms.RawForm):
    """Raw pixels, deflated."""

    name, encoding = "deflated", "application/x-deflated-rows"

    def check(self, payload, header):
        if not payload:
            raise forms.PayloadError("empty", "no bytes")

    def open(self, payload, header, size):
        return super().open(zlib.decompress(payload), header, size)

    def make(self, picture, quality):
        return zlib.compress(super().make(picture, quality))

forms.register(DeflatedRows())
'''
THERMAL = Topic("thermal/compressed", "application/x-deflated-rows")
PIXELS = np.random.default_rng(3).integers(0, 255, (48, 64, 3), np.uint8)


def fetched(url: str) -> bytes:
    with suppress(OSError), urllib.request.urlopen(url, timeout=10) as answer:
        return bytes(answer.read())
    return b""


def test_a_form_that_is_registered_works_everywhere(
    client, router, connection, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(forms, "FORMS", dict(forms.FORMS))
    exec(DEFLATED, {})  # here, and below in the viewer's process
    view = f"{DEFLATED}\nfrom zv.__main__ import main\nmain()"
    port = free_port()
    with (
        Node("camera", connection=connection, publishes=["image", THERMAL]) as camera,
        Node("taker", connection=connection) as taker,
        running_service(["-c", view, "view", "--port", str(port)], router.endpoint),
    ):

        def publish() -> None:
            frame = camera.publish_picture("image", PIXELS).frame
            camera.publish_picture(THERMAL, PIXELS, frame=frame)

        with Paced(20, publish):
            frames = in_time(taker, taker.frames(THERMAL))
            frame = next(iter(frames))
            assert np.array_equal(frame.pixels, PIXELS)
            key = "vision/front/thermal/compressed"
            sent = newest(client, key)
            assert sent.encoding == THERMAL.encoding
            assert zlib.decompress(sent.payload) == PIXELS.tobytes()
            options = SnapshotOptions(key=key, output=str(tmp_path / "a.png"))
            snapshot(options, connection, Output(as_json=False))
            assert np.array_equal(cv2.imread(str(tmp_path / "a.png")), PIXELS)
            url = f"http://127.0.0.1:{port}/snapshot?topic=/front/thermal/compressed"
            shown = wait_until(lambda: fetched(url), 60)
            picture = cv2.imdecode(np.frombuffer(shown, np.uint8), cv2.IMREAD_COLOR)
            assert picture.shape == PIXELS.shape
    assert forms.form_named("deflated").encoding == THERMAL.encoding
