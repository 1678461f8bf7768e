"""Many cameras in one node: each publishes a small moving picture."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from common.frame import Frame
from common.keys import IMAGE, RAW
from common.messages import Header
from common.node import Node
from common.zenoh_config import Connection
from services.camera.scene.scene import Scene

WIDTH = 320
HEIGHT = 240


@contextmanager
def publish_cameras(endpoint: str, count: int, rate_hz: float) -> Iterator[tuple[str, ...]]:
    """Publish from so many cameras until the end; yield their names."""
    names = tuple(f"bay_{number:02d}" for number in range(1, count + 1))
    stop = threading.Event()
    with Node(
        "camera", camera=names, connection=Connection(endpoint), publishes=[IMAGE, RAW]
    ) as node:
        thread = threading.Thread(target=_publish, args=(node, rate_hz, stop))
        thread.start()
        try:
            yield names
        finally:
            stop.set()
            thread.join()


def _publish(node: Node, rate_hz: float, stop: threading.Event) -> None:
    scenes = [Scene(WIDTH, HEIGHT, seed=seed) for seed, _ in enumerate(node.cameras, 1)]
    epoch = time.time_ns()
    seq = 0
    while not stop.wait(1 / rate_hz):
        for camera, scene in zip(node.cameras, scenes, strict=True):
            header = Header(
                camera=camera,
                epoch=epoch,
                seq=seq,
                stamp_ns=time.time_ns(),
                width=WIDTH,
                height=HEIGHT,
                encoding="bgr8",
                node=node.name,
            )
            node.publish_frame(Frame(header, pixels=scene.render(round(seq * 30 / rate_hz))))
        seq += 1
