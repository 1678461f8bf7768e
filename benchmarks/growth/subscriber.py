"""A service that decodes frames and notes their ages: ENDPOINT NAME CAMERA FILE.

CAMERA may be ``*``. On SIGTERM it writes two lists to FILE as JSON: when each frame was decoded, ns
since 1970, and its age, ms.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import cv2

from zenoh_vision import Connection, Node, queue

WAITING = 64


def main() -> None:
    """Receive until told to stop, and report."""
    endpoint, name, camera, file = sys.argv[1:]
    cv2.setNumThreads(1)
    decoded_ns: list[int] = []
    ages_ms: list[float] = []
    cameras = () if camera == "*" else (camera,)
    with Node(name, camera=cameras, connection=Connection(connect=endpoint)) as node:
        frames = node.frames("image/compressed", camera=camera, buffering=queue(WAITING))
        for frame in frames:
            now_ns = time.time_ns()
            decoded_ns.append(now_ns)
            ages_ms.append((now_ns - frame.header.stamp_ns) / 1e6)
    Path(file).write_text(json.dumps([decoded_ns, ages_ms]))


if __name__ == "__main__":
    main()
