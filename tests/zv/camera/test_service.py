"""What the camera's loop sets up before it needs a router."""

from __future__ import annotations

import pytest

from zenoh_vision.config.revisions import ParameterStore
from zenoh_vision.errors import ParameterRefused, RouterUnreachable
from zenoh_vision.node.node import Node
from zenoh_vision.transport.connection import Connection
from zv.camera import service
from zv.camera.settings import CameraSettings


def test_a_camera_is_judged_by_its_configured_rate(monkeypatch: pytest.MonkeyPatch):
    made: list[Node] = []

    class Kept(Node):
        def __init__(self, *arguments: object, **options: object) -> None:
            super().__init__(*arguments, **options)  # type: ignore[arg-type]
            made.append(self)

    monkeypatch.setattr(service, "Node", Kept)
    nowhere = Connection("tcp/127.0.0.1:1", timeout_s=0.1)
    with pytest.raises(RouterUnreachable):
        service.run(CameraSettings(width=64, height=48, rate=12), nowhere)
    bounds = made[0].health.rates
    said = [bounds.judge(float(s), {"captured": 6 * s}) for s in range(20)]
    assert said[-1] == ["6 Hz captured, under the 12 Hz configured"]


@pytest.mark.parametrize(
    ("started_with", "allowed"),
    [
        ({}, {"width": 1920, "height": 1200}),
        ({"width": 3840, "height": 2160}, {"width": 2160, "height": 3840}),
        ({"max_pixels": 640 * 480}, {"width": 480, "height": 640}),
        ({"width": 160, "height": 120, "max_pixels": 3840 * 2160}, {"width": 3840, "height": 2160}),
    ],
)
def test_nobody_sets_a_size_over_the_limit_while_it_runs(started_with, allowed):
    store = ParameterStore(CameraSettings(**started_with).limited())
    store.change(allowed)
    with pytest.raises(ParameterRefused, match="is over max_pixels"):
        store.change({"height": allowed["height"] + 1})
    assert {name: getattr(store.newest.settings, name) for name in allowed} == allowed


def test_the_limit_of_pixels_is_that_of_a_size_that_the_settings_determine():
    CameraSettings(source="a.mp4", max_pixels=100_000)  # of any size
    CameraSettings(source="/dev/video0", max_pixels=100_000, width=640)
    with pytest.raises(ValueError, match="640x480 is over max_pixels"):
        CameraSettings(source="/dev/video0", max_pixels=100_000, width=640, height=480)
