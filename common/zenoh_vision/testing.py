"""Helpers for tests of your own service: run a router and the service, send frames, get results.

```python
def test_a_grey_frame_has_its_brightness():
    with (
        running_router() as endpoint,
        running_service(["brightness.py"], endpoint),
        publishing(endpoint, np.full((48, 64), 100, np.uint8)),
    ):
        assert first_message(endpoint, BRIGHTNESS).mean == 100
```

Everything has a free port and a deadline, so tests can run in parallel and none hangs.
"""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from zenoh_vision.image.frame import Frame
from zenoh_vision.image.pixel_formats import Pixels
from zenoh_vision.keys import DEFAULT_CAMERA
from zenoh_vision.messages import Track, Tracks
from zenoh_vision.node.inputs import Input
from zenoh_vision.node.node import Node
from zenoh_vision.topics import COMPRESSED, RAW, TRACKS, Topic, topic_named
from zenoh_vision.transport.connection import Connection
from zenoh_vision.transport.router import private_router

DEADLINE_S = 30.0
"""How long a start or a message may take on a busy machine."""

STOP_S = 10.0
POLL_S = 0.05


@contextmanager
def running_router() -> Iterator[str]:
    """Run a router in this process, on a free port of this machine; yield its endpoint."""
    with private_router() as (_, endpoint):
        yield endpoint


@contextmanager
def running_service(
    command: Sequence[str | Path], endpoint: str, **variables: str
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a service as a process of its own, and end it as Ctrl-C does.

    Args:
        command: A Python file and its flags. Other ``ZV_`` variables than the endpoint do not
            reach it.
        endpoint: Of the router; passed on as ``ZV_CONNECT``.
        variables: Further environment variables.

    Raises:
        AssertionError: It ended by itself, with a status other than 0, or not in time; the text
            has its log.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("ZV_")}
    with TemporaryFile("w+") as log:
        process = subprocess.Popen(  # noqa: S603 - the interpreter that runs the test
            [sys.executable, *map(str, command)],
            env={**kept, "ZV_CONNECT": endpoint, **variables},
            stderr=log,
        )

        def fault(what: str) -> AssertionError:
            log.seek(0)
            return AssertionError(f"{command[0]} {what}: {log.read()}")

        try:
            try:
                yield process
            except Exception as error:
                if process.poll() is None:
                    raise
                raise fault("ended by itself") from error
            if process.poll() is not None:
                raise fault("ended by itself")
            process.send_signal(signal.SIGINT)
            if process.wait(STOP_S) != 0:
                raise fault(f"ended with status {process.returncode}")
        except subprocess.TimeoutExpired:
            raise fault(f"does not end within {STOP_S:g} s") from None
        finally:
            if process.poll() is None:
                process.kill()
                process.wait(STOP_S)


@contextmanager
def publishing(
    endpoint: str,
    *pictures: Pixels,
    camera: str = DEFAULT_CAMERA,
    rate_hz: float = 20.0,
    tracks: Sequence[Track] | None = None,
) -> Iterator[None]:
    """Publish pictures as the frames of a camera, in a loop, perhaps with the tracks of each.

    Args:
        endpoint: Of the router.
        pictures: Pixels, (height, width) uint8 or uint16, or (height, width, 3) uint8 in the
            order B, G, R; sent as JPEG of quality 100, 16 bits as PNG, and raw.
        camera: Name of the camera.
        rate_hz: Frames per second.
        tracks: Sent as ``Tracks`` of each frame, as a tracker does; None sends none.
    """
    stop = threading.Event()
    topics = [COMPRESSED, RAW] if tracks is None else [COMPRESSED, RAW, TRACKS]
    with Node("camera", camera=camera, connection=at(endpoint), publishes=topics) as node:

        def run() -> None:
            for picture in itertools.cycle(pictures):
                frame = node.publish_picture(COMPRESSED, picture, quality=100).frame
                if tracks is not None and frame is not None:
                    node.publish(TRACKS, Tracks(header=frame.header, tracks=tuple(tracks)))
                if stop.wait(1 / rate_hz):
                    return

        thread = threading.Thread(target=run, name="publishing", daemon=True)
        thread.start()
        try:
            yield
        finally:
            stop.set()
            thread.join(STOP_S)


def first_message(
    endpoint: str, topic: Topic | str, camera: str = DEFAULT_CAMERA, timeout_s: float = DEADLINE_S
) -> Any:
    """Return the first message that is published on a topic from now on, with a header or without.

    Args:
        endpoint: Of the router.
        topic: A topic that carries messages, or its name in the table.
        camera: Its camera.
        timeout_s: How long to wait.

    Raises:
        AssertionError: None came in time; the text has the key.
    """
    return _first("message", endpoint, topic, camera, timeout_s)


def first_picture(
    endpoint: str,
    topic: Topic | str = COMPRESSED,
    camera: str = DEFAULT_CAMERA,
    timeout_s: float = DEADLINE_S,
) -> Frame:
    """Return the first frame that is published on a topic of pictures from now on.

    Its ``pixels``, ``bgr`` and ``header`` are those that a consumer gets. A topic that is made only
    on demand, such as ``tracked/compressed``, is made for this.

    Args:
        endpoint: Of the router.
        topic: A topic that carries pictures, or its name in the table.
        camera: Its camera.
        timeout_s: How long to wait.

    Raises:
        AssertionError: None came in time; the text has the key.
    """
    return _first("picture", endpoint, topic, camera, timeout_s)  # type: ignore[no-any-return]


def _first(what: str, endpoint: str, topic: Topic | str, camera: str, timeout_s: float) -> Any:
    row = topic_named(topic)
    with Node("tester", camera=camera, connection=at(endpoint)) as node:
        arriving: Input[Any] = (
            node.messages(row) if what == "message" else node.frames(row, max_age_s=None)
        )
        deadline_s = time.monotonic() + timeout_s
        while time.monotonic() < deadline_s:
            found = arriving.take(POLL_S)
            if found is not None:
                return found
    raise AssertionError(
        f"no {what} on {row.key(node.connection.namespace, camera)} within {timeout_s:g} s"
    )


def at(endpoint: str) -> Connection:
    """Return a connection that waits for the router only for a short time."""
    return Connection(endpoint, timeout_s=DEADLINE_S)
