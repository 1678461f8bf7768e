"""What the camera's loop sets up before it needs a router."""

from __future__ import annotations

import pytest

from zenoh_vision.errors import RouterUnreachable
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
